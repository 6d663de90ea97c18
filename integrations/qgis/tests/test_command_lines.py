"""Values of parameters become the words of the program."""

from __future__ import annotations

import json

import pytest
from lloydar_processing.command_lines import (
    ValueProblem,
    command_line,
    figures_of_job,
    figures_of_measure,
    header_sentences,
    read_headers,
    shown,
)
from lloydar_processing.descriptions import INFO, MEASURE, MESH, RENDER, RESAMPLE


def test_what_is_not_given_is_no_option() -> None:
    values = {"INPUT": ["a.laz"], "OUTPUT": "out.copc.laz", "SPACING": "5cm", "COUNT": "", "ISOLATED": "keep"}
    words = command_line(RESAMPLE, {**values, "RESTART": False, "LOAD": True, "EXTENT": None, "ATTRIBUTES": []})
    assert words == ["run", "--log", "json", "--overwrite", "--spacing=5cm", "--output=out.copc.laz", "--", "a.laz"]


def test_every_kind_of_value_becomes_an_option() -> None:
    values = {
        "INPUT": ["a b.laz", "-c.laz"],
        "OUTPUT": "out.laz",
        "MESH": "m.ply",
        "RATIO": "2%",
        "EXTENT": [431000.1, 5399990, 431030, 5400010.25],
        "ATTRIBUTES": ["normals", "area"],
        "ISOLATED": "drop",
        "SCANNER": "-1,2,3",
        "THREADS": 3,
        "RESTART": True,
        "OPTIONS": "--iterations 30 --crs 'my crs.wkt'",
    }
    words = command_line(MESH, values)
    assert "--bounds=431000.1,5399990.0,431030.0,5400010.25" in words
    for word in ("--with=normals,area", "--isolated=drop", "--threads=3", "--restart", "--mesh=m.ply"):
        assert word in words
    assert "--scanner=-1,2,3" in words, "a value may begin with a minus"
    assert words[words.index("--crs") + 1] == "my crs.wkt"
    assert words[-3:] == ["--", "a b.laz", "-c.laz"], "a file may have any name"
    assert "'a b.laz'" in shown(words)


def test_what_has_gone_is_found_by_a_trajectory_towards_which_a_mesh_looks_anyway() -> None:
    values = {"INPUT": ["a.laz"], "OUTPUT": "out.laz", "TRANSIENTS": "drop", "TRAJECTORY": "my way.csv"}
    for algorithm in (RESAMPLE, MESH):
        words = command_line(algorithm, values)
        assert "--transients=drop" in words and "--trajectory=my way.csv" in words
    words = command_line(MESH, {**values, "TRANSIENTS": "keep"})
    assert "--trajectory=my way.csv" in words and not any(word.startswith("--transients") for word in words)


def test_files_to_compare_with_end_before_the_cloud() -> None:
    words = command_line(MEASURE, {"INPUT": ["even.laz"], "AGAINST": ["a.laz", "b.laz"], "OUTPUT": "f.json"})
    assert words == ["measure", "--json", "--against", "a.laz", "b.laz", "--", "even.laz"]
    assert command_line(INFO, {"INPUT": ["a.laz"]}) == ["info", "--json", "--", "a.laz"]
    words = command_line(RENDER, {"INPUT": ["a.laz"], "OUTPUT": "a.png", "VIEW": "top", "BY": "auto"})
    assert words == ["render", "--view=top", "--output=a.png", "--", "a.laz"]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"INPUT": []}, "No scans"),
        ({"INPUT": ["a"], "SPACING": "1", "COUNT": "5"}, "one of spacing"),
        ({"INPUT": ["a"], "TRANSIENTS": "drop", "TRAJECTORY": ""}, "give a trajectory"),
        ({"INPUT": ["a"], "TRANSIENTS": "keep", "TRAJECTORY": "way.csv"}, "or give no trajectory"),
        ({"INPUT": ["a"], "OPTIONS": "--crs 'x"}, "quotation"),
        ({"INPUT": ["a"], "OPTIONS": "--output=b"}, "cannot be given"),
        ({"INPUT": ["a"], "OPTIONS": "-- b"}, "cannot be given"),
    ],
)
def test_what_cannot_be_used_is_refused_with_a_reason(values: dict, reason: str) -> None:
    with pytest.raises(ValueProblem, match=reason):
        command_line(RESAMPLE, values)


def test_figures_are_read_from_reports() -> None:
    assert figures_of_job({"points": 5, "spacing": 0.1, "mesh": {"triangles": 8}}) == {
        "POINTS": 5,
        "SPACING_USED": 0.1,
        "TRIANGLES": 8,
    }
    assert "TRIANGLES" not in figures_of_job({"points": 5, "spacing": 0.1, "mesh": None})
    measured = {"points": 7, "spacing": 0.2, "uniformity": {"delta": 0.04}, "accuracy": None}
    figures = figures_of_measure(json.dumps(measured))
    assert figures["DELTA"] == 0.04 and figures["MEAN_DISTANCE"] is None


def test_headers_are_said_in_lines() -> None:
    header = {"file": "a.laz", "kind": "LAZ", "version": [1, 4], "format": 7, "points": 12000, "crs": None}
    (read,) = read_headers(json.dumps({**header, "min": [0, 1, 2], "max": [3, 4, 5]}) + "\n")
    said = "\n".join(header_sentences(read))
    assert "LAZ 1.4, format 7, 12,000 points" in said and "none stated" in said and "y 1.000 to 4.000" in said
