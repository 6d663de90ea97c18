"""From the values of parameters to the words of a command line, and from results to figures.

No QGIS is imported here.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .descriptions import ONE_OF, RESAMPLE, Algorithm, Parameter


class ValueProblem(Exception):
    """A parameter has a value that cannot be used. The message says which, and why."""


def command_line(algorithm: Algorithm, values: Mapping[str, Any]) -> list[str]:
    """Return the words after the name of the program.

    `values` has texts, numbers, truth values and lists of texts by the names of parameters; None and "" stand for
    a value that is not given, and become no option.
    """
    problem = conflict(algorithm, values)
    if problem:
        raise ValueProblem(problem)
    words = [algorithm.command]
    if algorithm.command == "run":
        # A dialog for the output's name has asked before an existing file is replaced.
        words += ["--log", "json", "--overwrite"]
    elif algorithm.command in ("measure", "info"):
        words.append("--json")
    for parameter in algorithm.parameters:
        if parameter.option:
            words += _option(parameter, values.get(parameter.name))
    if is_given(values.get("OPTIONS")):
        words += _further_options(str(values["OPTIONS"]))
    inputs = [str(path) for path in values.get("INPUT") or []]
    if not inputs:
        raise ValueProblem("No scans are given.")
    # Behind "--" a file may have any name.
    return [*words, "--", *inputs]


def conflict(algorithm: Algorithm, values: Mapping[str, Any]) -> str:
    """Return why values do not go together, or "" if they do."""
    given = [name for name in ONE_OF if is_given(values.get(name))]
    if len(given) > 1:
        return f"Give one of spacing, count and ratio, not {len(given)} of them."
    drops = values.get("TRANSIENTS") == "drop"
    has_trajectory = is_given(values.get("TRAJECTORY"))
    if drops and not has_trajectory:
        return "Cars and people that have gone are found by the way of the scanner: give a trajectory."
    if algorithm is RESAMPLE and has_trajectory and not drops:
        return "The trajectory is for cars and people that have gone: choose to drop them, or give no trajectory."
    return ""


def is_given(value: Any) -> bool:
    """Return whether a value was given at all."""
    return value is not None and value is not False and (not isinstance(value, (str, list)) or len(value) > 0)


def _option(parameter: Parameter, value: Any) -> list[str]:
    if not is_given(value) or (parameter.kind == "choice" and value == parameter.default):
        return []
    if parameter.kind == "switch":
        return [parameter.option]
    if parameter.kind == "choices":
        return [f"{parameter.option}={','.join(value)}"]
    if parameter.kind == "files":
        # One option takes all of them; "--" ends them.
        return [parameter.option, *map(str, value)]
    if parameter.kind == "extent":
        return [f"{parameter.option}={','.join(repr(float(side)) for side in value)}"]
    # Joined by "=", so that a value may begin with a minus.
    return [f"{parameter.option}={str(value).strip()}"]


def _further_options(text: str) -> list[str]:
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise ValueProblem(f"Further options: {error}: {text}") from error
    for word in words:
        if word.split("=")[0] in ("--output", "-o", "--output-tiles", "--log", "--quiet", "-q", "--"):
            raise ValueProblem(f"Further options: {word} cannot be given here.")
    return words


def shown(words: Sequence[str]) -> str:
    """Return a command line as it would be written in a terminal."""
    return " ".join(shlex.quote(word) for word in words)


def report_path(output: str) -> Path:
    """Return where a job writes its figures."""
    return Path(f"{output}.report.json")


def job_directory(output: str) -> Path:
    """Return where a job keeps what is done until it is complete."""
    return Path(f"{output}.job")


def figures_of_job(report: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of `resample` and `mesh` from the report of a job."""
    figures = {"POINTS": report.get("points"), "SPACING_USED": report.get("spacing")}
    mesh = report.get("mesh")
    if isinstance(mesh, dict):
        figures["TRIANGLES"] = mesh.get("triangles")
    return figures


def figures_of_measure(text: str) -> dict[str, Any]:
    """Return the figures of `measure` from what the program prints."""
    measured = json.loads(text)
    uniformity = measured.get("uniformity") or {}
    accuracy = measured.get("accuracy") or {}
    return {
        "POINTS": measured.get("points"),
        "SPACING_USED": measured.get("spacing"),
        "DELTA": uniformity.get("delta"),
        "ENERGY_RATIO": uniformity.get("energy_ratio"),
        "CELL_AREA_CV": uniformity.get("cell_area_cv"),
        "PACKING": uniformity.get("packing"),
        "MEAN_DISTANCE": accuracy.get("mean"),
        "MAX_DISTANCE": accuracy.get("max"),
    }


def read_headers(text: str) -> list[dict[str, Any]]:
    """Return the headers from the lines that `info` prints, one a file."""
    return [json.loads(line) for line in text.splitlines() if line.strip()]


def header_sentences(header: Mapping[str, Any]) -> list[str]:
    """Return what a user wants to know of a scan, a line each."""
    version = ".".join(map(str, header.get("version") or []))
    points = header.get("points")
    lines = [
        f"{header.get('file')}",
        f"  {header.get('kind')} {version}, format {header.get('format')}, {points:,} points"
        if isinstance(points, int)
        else f"  {header.get('kind')} {version}, format {header.get('format')}",
        f"  CRS: {header.get('crs') or 'none stated'}",
    ]
    lower, upper = header.get("min"), header.get("max")
    if lower and upper:
        sides = zip("xyz", lower, upper)
        lines.append("  " + "; ".join(f"{axis} {low:.3f} to {high:.3f}" for axis, low, high in sides))
    return lines
