"""Names of algorithms and parameters are in the models of users: they stay, with their defaults."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from lloydar_processing.descriptions import ALGORITHMS, PROVIDER, Algorithm, Parameter, help_page

ROOT = Path(__file__).parents[3]
PLUGIN = Path(__file__).parents[1] / "lloydar_processing"

JOB = (
    "INPUT:files SPACING:text COUNT:text RATIO:text KEEP_CLASS:text DROP_CLASS:text EXTENT:extent POLYGON:file "
    "SMOOTH:text FILL:text ISOLATED:choice COLOR:choice CLASS:choice ATTRIBUTES:choices TRANSIENTS:choice "
)
REST = "MEMORY:text THREADS:integer OPTIONS:text RESTART:switch LOAD:switch OUTPUT:output"

#: What users may rely on. Lines may get longer, by optional parameters; nothing here may change.
FROZEN = {
    "lloydar:resample": JOB + "TRAJECTORY:file " + REST,
    "lloydar:mesh": JOB + "MESH_OF:choice SCANNER:text TRAJECTORY:file " + REST + " MESH:output",
    "lloydar:measure": "INPUT:files AGAINST:files MEMORY:text OUTPUT:output",
    "lloydar:render": "INPUT:files VIEW:choice BY:choice SIZE:text POINT_SIZE:text OUTPUT:output",
    "lloydar:info": "INPUT:files OUTPUT:output",
}
FROZEN_CHOICES = {
    "ISOLATED": ("keep", "drop", "mark"),
    "COLOR": ("nearest", "mean"),
    "CLASS": ("nearest", "majority"),
    "ATTRIBUTES": ("normals", "curvature", "area", "density", "distance", "spacing"),
    "TRANSIENTS": ("keep", "drop"),
    "MESH_OF": ("surfaces", "all"),
    "VIEW": ("top", "oblique", "street"),
    "BY": ("auto", "height", "intensity", "class"),
}
FROZEN_FIGURES = {
    "resample": {"POINTS", "SPACING_USED"},
    "mesh": {"POINTS", "SPACING_USED", "TRIANGLES"},
    "measure": {"POINTS", "SPACING_USED", "DELTA", "ENERGY_RATIO", "CELL_AREA_CV", "PACKING"}
    | {"MEAN_DISTANCE", "MAX_DISTANCE"},
    "render": set(),
    "info": {"FILES", "POINTS"},
}
REQUIRED = {"INPUT", "OUTPUT", "MESH"}
PARAMETERS = [(algorithm, parameter) for algorithm in ALGORITHMS for parameter in algorithm.parameters]


def test_identifiers_and_parameters_are_frozen() -> None:
    described = {
        f"{PROVIDER}:{algorithm.identifier}": " ".join(f"{p.name}:{p.kind}" for p in algorithm.parameters)
        for algorithm in ALGORITHMS
    }
    assert described == FROZEN
    for algorithm in ALGORITHMS:
        assert set(algorithm.figures) == FROZEN_FIGURES[algorithm.identifier]


@pytest.mark.parametrize(("algorithm", "parameter"), PARAMETERS)
def test_words_of_choices_are_frozen_and_only_old_parameters_are_required(
    algorithm: Algorithm, parameter: Parameter
) -> None:
    assert parameter.choices == FROZEN_CHOICES.get(parameter.name, ())
    assert parameter.optional or parameter.name in REQUIRED
    if parameter.kind == "choice":
        assert parameter.default in parameter.choices


@pytest.mark.parametrize(("algorithm", "parameter"), PARAMETERS)
def test_help_is_a_sentence_and_lengths_have_a_unit(algorithm: Algorithm, parameter: Parameter) -> None:
    assert parameter.help[-1] in ".3" and len(parameter.help) > 20, parameter.help
    if parameter.name in ("SPACING", "SMOOTH", "FILL", "EXTENT", "POINT_SIZE", "SCANNER", "TRAJECTORY", "ATTRIBUTES"):
        assert re.search("unit", parameter.help)
    assert parameter.help in help_page(algorithm)


def test_the_program_has_every_option_and_every_word() -> None:
    """The options of the program are read from its sources, so that one that is renamed there is missed here."""
    sources = "".join(path.read_text() for path in (ROOT / "src" / "cli").glob("*.rs"))
    for _, parameter in PARAMETERS:
        name = parameter.option.removeprefix("--")
        field = name.replace("-", "_")
        assert not name or re.search(rf'long = "{name}"|\b{field}: |\b(?:r#)?{field}_?: ', sources), parameter.option


def test_versions_are_those_of_the_program() -> None:
    from lloydar_processing.program import NEWEST, OLDEST

    cargo = (ROOT / "Cargo.toml").read_text()
    version = re.search(r'^version = "([\d.]+)"', cargo, re.MULTILINE)[1]
    metadata = (PLUGIN / "metadata.txt").read_text()
    assert f"\nversion={version}\n" in metadata
    assert OLDEST <= tuple(map(int, version.split(".")))[:2] <= NEWEST


def test_modules_without_qgis_import_none_and_all_are_python_3_8() -> None:
    with_qgis = {"algorithm", "enumerations", "parameters", "plugin", "provider"}
    for path in PLUGIN.glob("*.py"):
        tree = ast.parse(path.read_text(), feature_version=(3, 8))
        modules = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        modules |= {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        uses = any(module.split(".")[0] in ("qgis", "processing") for module in modules)
        assert uses == (path.stem in with_qgis), path
        assert not any(module.startswith(("PyQt", "sip")) for module in modules), f"{path}: qgis.PyQt is for 5 and 6"
