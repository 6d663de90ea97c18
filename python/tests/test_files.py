"""Files: the functions give the bytes of the command line, have all of its options, and say what is wrong."""

from __future__ import annotations

import json
import logging
import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import pytest
from conftest import PROGRAM, sheet

import lloydar

Command = Callable[..., str]


def options_of(command: Command, name: str) -> set[str]:
    """Names of the options in the help of a command, as keywords."""
    flags = set(re.findall(r"^ +(?:-\w, )?--([a-z-]+)", command(name, "--help"), re.MULTILINE))
    # A list of inputs is a list in Python, not a file.
    others = {"help", "version", "quiet", "log", "json", "from-list", "input-file-list"}
    keywords = {flag.replace("-", "_") for flag in flags - others}
    words = {"class": "class_", "with": "with_"}
    return {words.get(keyword, keyword) for keyword in keywords}


def test_every_option_of_the_command_line_is_a_keyword(command: Command) -> None:
    assert options_of(command, "run") == lloydar.JobOptions.__annotations__.keys() | {"output", "restart"}
    assert options_of(command, "plan") == lloydar.JobOptions.__annotations__.keys() | {"output"}
    for name in ("measure", "simulate", "render"):
        function = getattr(lloydar, name)
        keywords = set(function.__annotations__) - {"return", "cloud", "clouds"}
        assert options_of(command, name) == keywords, name


@pytest.mark.parametrize(
    ("ending", "options", "flags"),
    [
        (".laz", {"spacing": 0.4}, ["--spacing", "0.4"]),
        (".copc.laz", {"count": 4000, "with_": ["normals", "area"]}, ["--count=4K", "--with=normals,area"]),
        (".las", {"ratio": "2%", "seeds": "poisson", "seed": 3}, ["--ratio=0.02", "--seeds=poisson", "--seed=3"]),
        (
            ".ply",
            {"spacing": "50cm", "fill": 0, "color": "mean", "class_": "majority", "iterations": np.int64(5)},
            ["--spacing=0.5", "--fill=0", "--color=mean", "--class=majority", "--iterations=5"],
        ),
        (
            ".laz",
            {"spacing": np.float32(0.5), "bounds": (430_990, 5_399_980, 431_020, 5_400_020), "memory": 1 << 29},
            ["--spacing=0.5", "--bounds=430990,5399980,431020,5400020", "--memory=512MiB"],
        ),
    ],
)
def test_the_bytes_are_those_of_the_command_line(
    street: list[Path],
    tmp_path: Path,
    command: Command,
    ending: str,
    options: dict[str, object],
    flags: list[str],
) -> None:
    # A file knows its own name in its record of how it was made, if at all: both have the same.
    (tmp_path / "python").mkdir()
    (tmp_path / "program").mkdir()
    ours, theirs = tmp_path / "python" / f"even{ending}", tmp_path / "program" / f"even{ending}"
    report = lloydar.run(street, ours, **options)
    command("run", *street, "-o", theirs, "--quiet", *flags)
    assert ours.read_bytes() == theirs.read_bytes()
    assert report.output == ours and report.is_complete and report.page.exists()
    assert report == lloydar.Report(json.loads(Path(f"{ours}.report.json").read_text()))
    written = json.loads(Path(f"{theirs}.report.json").read_text())
    for name in ("points", "spacing", "uniformity", "accuracy", "histogram"):
        assert report[name] == written[name]


def test_a_mesh_is_that_of_the_command_line(
    street: list[Path], tmp_path: Path, command: Command
) -> None:
    ours, theirs = tmp_path / "ours.ply", tmp_path / "theirs.ply"
    places = [(431_000.0, 5_400_000.0, 110.0), (431_020.0, 5_400_000.0, 110.0)]
    report = lloydar.run(street, tmp_path / "a.laz", spacing=0.5, mesh=ours, scanner=places)
    flag = "--scanner=431000,5400000,110;431020,5400000,110"
    words = [*map(str, street), "-o", str(tmp_path / "b.laz"), "--spacing=0.5"]
    command("run", *words, f"--mesh={theirs}", flag, "-q")
    assert ours.read_bytes() == theirs.read_bytes()
    assert report["mesh"]["triangles"] > 1000


def test_points_in_memory_and_the_file_give_the_same_positions(street: list[Path], tmp_path: Path) -> None:
    lloydar.run(street, tmp_path / "even.laz", spacing=0.4)
    written = laspy.read(tmp_path / "even.laz")
    scans = [laspy.read(path) for path in street]
    points = np.concatenate([scan.xyz for scan in scans])
    even = lloydar.resample(points, spacing=0.4, scale=scans[0].header.scales[0])
    assert len(even) == len(written.points)
    assert np.abs(even.points - written.xyz).max() <= 0.5001 * written.header.scales[0]


def test_a_plan_says_what_a_run_would_take_and_leaves_nothing(
    street: list[Path], tmp_path: Path, command: Command
) -> None:
    plan = lloydar.plan(street[0].parent, tmp_path / "even.laz", spacing=0.4, threads=2)
    assert plan is not None and not list(tmp_path.iterdir())
    flags = ["--spacing=0.4", "--threads=2", "--json", "--quiet"]
    theirs = json.loads(command("plan", street[0].parent, "-o", tmp_path / "even.laz", *flags))
    for name in ("points", "points_out", "spacing", "tiles", "halo"):
        assert plan.get(name) == theirs.get(name)
    assert plan.points == 200_000 and plan.tiles == 1 and plan.seconds > 0 and plan.memory > 0
    assert "points_out" in repr(plan) and "<table>" in plan._repr_html_()


def test_files_and_points_are_measured(street: list[Path], tmp_path: Path, command: Command) -> None:
    lloydar.run(street, tmp_path / "even.ply", spacing=0.4)
    measured = lloydar.measure(tmp_path / "even.ply", against=street, truth=street[0].parent)
    words = ["measure", tmp_path / "even.ply", "--json", "--truth", street[0].parent, "--against", *street]
    assert measured == lloydar.Measured(json.loads(command(*words)))
    assert measured.accuracy is not None and measured.accuracy["mean"] < measured.spacing
    assert measured.truth is not None and "delta" in repr(measured)
    scan = sheet(100)
    even = lloydar.resample(scan, spacing=0.1)
    of_points = lloydar.measure(even.points, against=scan)
    assert of_points.points == len(even) and of_points.uniformity["delta"] < 0.1
    assert of_points.coverage is not None and of_points.coverage["max"] < 0.1
    with pytest.raises(lloydar.RequestError, match="no two different points"):
        lloydar.measure(np.ones((5, 3)))


def test_headers_are_read(street: list[Path], command: Command) -> None:
    headers = lloydar.info(street)
    assert [json.loads(line) for line in command("info", "--json", *street).splitlines()] == headers
    assert sum(header["points"] for header in headers) == 200_000
    with pytest.raises(lloydar.InputError) as raised:
        lloydar.info(street[0].with_name("missing.laz"))
    assert raised.value.files[0][0].endswith("missing.laz")


def test_a_street_is_that_of_the_command_line_and_can_be_drawn(
    street: list[Path], tmp_path: Path, command: Command
) -> None:
    command("simulate", "--points=200K", "--length=40", "-o", tmp_path / "street")
    for path in street:
        assert path.read_bytes() == (tmp_path / "street" / path.name).read_bytes()
    picture = lloydar.render(street, tmp_path / "street.png", view="top", size=(320, 200))
    command("render", *street, "-o", tmp_path / "theirs.png", "--view=top", "--size=320x200")
    assert picture.read_bytes() == (tmp_path / "theirs.png").read_bytes()
    with pytest.raises(lloydar.RequestError, match="a street is 20 m"):
        lloydar.simulate(tmp_path / "short", length=1)


def test_names_of_any_kind_are_paths(street: list[Path], tmp_path: Path) -> None:
    class Name(os.PathLike[str]):
        def __fspath__(self) -> str:
            return str(tmp_path / "größe -o=ü.laz")

    report = lloydar.run(street, Name(), count="3K")
    assert report.output == Path(Name()) and Path(Name()).exists()
    pattern = f"{street[0].parent}/*.laz"
    here = Path.cwd()
    os.chdir(tmp_path)
    try:
        os.link(street[0], "-x.laz")
        assert lloydar.info("-x.laz")[0]["points"] == 100_000
        assert lloydar.run(pattern, "-even.laz", count=3000).points == report.points
    finally:
        os.chdir(here)


def test_a_job_that_is_complete_is_reported_again(street: list[Path], tmp_path: Path) -> None:
    output = tmp_path / "even.laz"
    first = lloydar.run(street, output, count=3000)
    with pytest.raises(lloydar.OutputError, match="exists already.* or overwrite") as raised:
        lloydar.run(street, output, count=3000)
    assert isinstance(raised.value, OSError) and raised.value.files[0][0] == str(output)
    assert lloydar.run(street, output, count=3000, overwrite=True)["histogram"] == first["histogram"]


def test_files_that_cannot_be_used_are_named(street: list[Path], tmp_path: Path) -> None:
    bad = tmp_path / "bad.laz"
    bad.write_bytes(street[0].read_bytes()[:100_000])
    with pytest.raises(lloydar.InputError) as raised:
        lloydar.run([street[0], bad], tmp_path / "even.laz", spacing=0.5)
    assert [name for name, _ in raised.value.files] == [str(bad)]
    assert isinstance(raised.value, ValueError) and "on_bad_file skip" in str(raised.value)
    report = lloydar.run([street[0], bad], tmp_path / "even.laz", spacing=0.5, on_bad_file="skip")
    assert not report.is_complete
    for missing in (tmp_path / "missing.laz", tmp_path / "*.las", tmp_path / "none"):
        with pytest.raises(lloydar.InputError):
            lloydar.run(missing, tmp_path / "even2.laz", spacing=0.5)


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"spacing": 1, "count": 5}, lloydar.OptionError, "give one of spacing, count and ratio \\(2 given\\)"),
        ({"spacing": -1}, lloydar.OptionError, "spacing -1"),
        ({"spacing": "5 parsecs"}, lloydar.OptionError, "parsecs"),
        ({"spacing": 1, "seeds": "best"}, lloydar.OptionError, "hexagonal"),
        ({"spacing": 1, "threads": 0}, lloydar.OptionError, "threads 0"),
        ({"spacing": 1, "memory": "little"}, lloydar.OptionError, "512MiB"),
        ({"spacing": 1, "memory": "1MiB"}, lloydar.OptionError, "memory 1 MiB is too little"),
        ({"spacing": 1, "keep_class": 300}, lloydar.OptionError, "300"),
        ({"spacing": 1, "keep_class": [99]}, lloydar.RequestError, "leaves no point"),
        ({"spacing": 1, "crs": "EPSG:1"}, lloydar.OptionError, "EPSG:1"),
        ({"spacing": 1, "config": "none.toml"}, lloydar.OptionError, "none.toml"),
        ({"spacing": 500}, lloydar.RequestError, "500 is too wide"),
        ({"count": 10**12}, lloydar.RequestError, "count 1000000000000"),
    ],
    ids=str,
)
def test_what_cannot_be_done_is_said(
    street: list[Path], tmp_path: Path, options: dict[str, object], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        lloydar.run(street, tmp_path / "even.laz", **options)
    assert not (tmp_path / "even.laz").exists()


def test_an_output_that_cannot_be_written_is_named(street: list[Path], tmp_path: Path) -> None:
    with pytest.raises(lloydar.OptionError, match="even.txt"):
        lloydar.run(street, tmp_path / "even.txt", spacing=1)
    with pytest.raises(lloydar.OutputError, match="even"):
        lloydar.run(street, tmp_path / "missing/even.laz", spacing=1)


def test_misspelt_keywords_are_type_errors(street: list[Path], tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="unknown options: spaceing"):
        lloydar.run(street, tmp_path / "even.laz", spaceing=1)
    with pytest.raises(TypeError, match="spacing is a dict"):
        lloydar.run(street, tmp_path / "even.laz", spacing={})
    with pytest.raises(lloydar.OptionError, match="inputs is empty"):
        lloydar.run([], tmp_path / "even.laz", spacing=1)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not say the peak")
def test_memory_is_kept_to_the_budget(tmp_path: Path) -> None:
    scans = lloydar.simulate(tmp_path / "street", points="2M", length=80)
    work = (
        "import lloydar, sys\n"
        "lloydar.run(sys.argv[1:-1], sys.argv[-1], spacing=0.2, memory='256MiB', threads=2)\n"
        "print(next(line.split()[1] for line in open('/proc/self/status') if 'VmHWM' in line))"
    )
    words = [PROGRAM.with_name("python"), "-c", work, *scans, tmp_path / "even.laz"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert 64 << 20 < int(done.stdout) * 1024 < 256 << 20


def test_notes_are_logged_and_progress_is_reported(
    street: list[Path], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[lloydar.Progress] = []
    with caplog.at_level(logging.INFO, "lloydar"):
        lloydar.run(street, tmp_path / "even.laz", count=8000, progress=seen.append)
    assert {"scatter", "solve"} & {report.stage for report in seen}
    assert all(0 <= report.share <= 1 and report.done <= report.total for report in seen)
    assert any("spacing" in record.getMessage() for record in caplog.records)


def test_the_command_is_the_same_program(tmp_path: Path) -> None:
    run = lambda *words: subprocess.run([PROGRAM, *words], capture_output=True, text=True)  # noqa: E731
    assert run("--version").stdout.strip() == f"lloydar {lloydar.__version__}"
    wrong = run("run", "scan.laz", "--spaceing", "1")
    assert wrong.returncode == 2 and "--spacing" in wrong.stderr
    assert run("info", "missing.laz").returncode == 1
