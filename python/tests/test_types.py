"""Types: mypy finds nothing in the package and in an example, and the stubs are what is compiled."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mypy")
PACKAGE = Path(__file__).parents[1]


def said(*words: object) -> str:
    done = subprocess.run(
        [sys.executable, "-m", *map(str, words)], cwd=PACKAGE, capture_output=True, text=True
    )
    return f"{done.returncode}: {done.stdout}{done.stderr}"


def test_the_package_and_an_example_are_typed(tmp_path: Path) -> None:
    words = ["mypy", "--strict", "--cache-dir", tmp_path, PACKAGE / "tests" / "typed_example.py"]
    assert said(*words).startswith("0: Success")
    assert said("mypy", "--strict", "--cache-dir", tmp_path, "-p", "lloydar").startswith("0: Success")


def test_a_wrong_type_is_found(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.py"
    wrong.write_text('import lloydar\nlloydar.run("a.laz", "b.laz", spaceing=1)\n')
    assert "spaceing" in said("mypy", "--strict", "--cache-dir", tmp_path, wrong)


def test_the_stubs_are_what_is_compiled() -> None:
    allowed = PACKAGE / "tests" / "stubtest_allowlist.txt"
    options = ["--concise", "--mypy-config-file", PACKAGE / "pyproject.toml", "--allowlist", allowed]
    assert said("mypy.stubtest", "lloydar", *options).startswith("0:")
