"""Every snippet of the documents runs, in the order in which it stands there; so do the docstrings and the notebook."""

from __future__ import annotations

import ast
import doctest
import json
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import lloydar
from lloydar import _memory

ROOT = Path(__file__).parents[2]
#: Packages that a snippet may need, and the tests may do without.
OPTIONAL = ("open3d", "pdal")


def snippets(document: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", (ROOT / document).read_text(), re.DOTALL | re.MULTILINE)


@pytest.fixture()
def workplace(tmp_path: Path, street: list[Path]) -> Iterator[Path]:
    """A directory with the scans that the snippets read."""
    (tmp_path / "scans").mkdir()
    for path in street:
        shutil.copy(path, tmp_path / "scans")
    shutil.copy(street[0], tmp_path / "scan.laz")
    here = Path.cwd()
    os.chdir(tmp_path)
    yield tmp_path
    os.chdir(here)


def needed(code: str) -> set[str]:
    """Names of the packages that `code` imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
    return names


@pytest.mark.parametrize(
    ("document", "index"),
    [(document, i) for document in ("docs/PYTHON.md", "docs/RECIPES.md") for i in range(len(snippets(document)))],
)
def test_a_snippet_runs(document: str, index: int, workplace: Path) -> None:
    code = snippets(document)[index]
    for name in needed(code) & set(OPTIONAL):
        pytest.importorskip(name)
    exec(compile(code, f"{document}, snippet {index}", "exec"), {"__name__": "snippet"})


def test_the_readme_of_the_package_says_what_runs(workplace: Path) -> None:
    import numpy as np

    points = np.random.default_rng(0).uniform(0, 1, (200_000, 3)) * [1, 1, 0]
    (code,) = snippets("python/README.md")
    exec(code.replace("50_000", "5_000").replace("0.05", "0.4"), {"points": points})


def test_the_second_command_of_the_readme_runs() -> None:
    (code,) = re.findall(r'^    python -c "(import lloydar.*?)"$', (ROOT / "README.md").read_text(), re.MULTILINE)
    exec(code, {})


def test_the_examples_of_docstrings_are_right() -> None:
    results = doctest.testmod(_memory)
    assert results.attempted > 3 and results.failed == 0


def test_every_public_name_is_documented() -> None:
    for name in set(lloydar.__all__) - {"__version__"}:
        assert getattr(lloydar, name).__doc__, name


def test_the_notebook_runs_and_has_pictures(workplace: Path) -> None:
    shell = pytest.importorskip("IPython.core.interactiveshell").InteractiveShell.instance()
    notebook = json.loads((ROOT / "examples" / "python.ipynb").read_text())
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    outputs = [output for cell in cells for output in cell["outputs"]]
    pictures = [output for output in outputs if {"image/png", "text/html"} & output.get("data", {}).keys()]
    assert len(pictures) >= 3
    for cell in cells:
        shell.run_cell("".join(cell["source"])).raise_error()
