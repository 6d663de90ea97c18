"""The plug-in under ``qgis_process``: list, help, run, Ctrl-C, continue.

    by_qgis_process.py QGIS_PROCESS PROGRAM WORK PYTHON_WITH_LASPY
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

EXECUTOR, PROGRAM, WORK, LASPY = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]), sys.argv[4]
SCANS = WORK / "scans"
ENVIRONMENT = {**os.environ, "PATH": f"{PROGRAM.parent}:{os.environ['PATH']}"}


def executor(*words: str, code: int | None = 0, environment: dict[str, str] = ENVIRONMENT) -> str:
    """Run ``qgis_process`` and return what it prints on both streams."""
    done = subprocess.run(
        [EXECUTOR, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=environment,
        check=False,
        timeout=600,
    )
    text = done.stdout.decode("utf-8", "replace")
    assert code is None or done.returncode == code, f"code {done.returncode} of {words}:\n{text}"
    return text


def run(algorithm: str, code: int = 0, **parameters: str) -> str:
    """Run an algorithm of the plug-in."""
    words = [f"{name}={value}" for name, value in parameters.items()]
    return executor("run", f"lloydar:{algorithm}", "--", *words, code=code)


def result(text: str, name: str) -> str:
    """Return a result that ``qgis_process`` lists."""
    return next(line.split("\t")[-1] for line in text.splitlines() if line.startswith(f"{name}:"))


def points_of(path: Path) -> int:
    """Return the number of points that laspy reads."""
    code = "import laspy, sys; print(len(laspy.read(sys.argv[1]).points))"
    return int(subprocess.run([LASPY, "-c", code, str(path)], check=True, capture_output=True).stdout)


def lists_and_helps() -> None:
    executor("plugins", "enable", "lloydar_processing")
    listed = executor("list")
    for identifier in ("resample", "mesh", "measure", "render", "info"):
        assert f"lloydar:{identifier}\t" in listed, listed
    assert "units of the CRS" in executor("help", "lloydar:resample")
    version = next(line for line in executor("--version").splitlines() if line.startswith("QGIS "))
    print(f"the provider lists five algorithms in {version}")


def runs(scan: Path, spacing: str, name: str) -> None:
    out = WORK / f"{name}.copc.laz"
    text = run("resample", INPUT=str(scan), SPACING=spacing, ATTRIBUTES="normals", OUTPUT=str(out))
    points = int(result(text, "POINTS"))
    assert points == points_of(out), text
    by_hand = WORK / f"{name}.by-hand.copc.laz"
    words = ["run", str(scan), f"--spacing={spacing}", "--with=normals", "-o", str(by_hand), "--quiet"]
    subprocess.run([PROGRAM, *words], check=True)
    assert out.read_bytes() == by_hand.read_bytes(), "the plug-in and the program give the same bytes"
    print(f"{name}: resampled to {points} points, read by laspy, the bytes of the command line")
    text = run("measure", INPUT=str(out), AGAINST=str(scan), OUTPUT=str(WORK / "figures.json"))
    figures = json.loads((WORK / "figures.json").read_text())
    assert float(result(text, "DELTA")) == figures["uniformity"]["delta"] < 0.3, text
    assert int(result(text, "POINTS")) == points
    run("render", INPUT=str(out), VIEW="top", SIZE="400x300", OUTPUT=str(WORK / f"{name}.png"))
    assert (WORK / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    text = run("info", INPUT=str(out))
    assert (result(text, "FILES"), result(text, "POINTS")) == ("1", str(points)), text
    print(f"{name}: measured (delta {figures['uniformity']['delta']:.4f}), drawn, and its header listed")


def drops_what_has_gone() -> None:
    """Scans of two passes, and the way of the scanner."""
    out, by_hand, way = WORK / "still.laz", WORK / "still.by-hand.laz", SCANS / "trajectory.csv"
    run("resample", INPUT=str(SCANS), SPACING="0.2", TRANSIENTS="drop", TRAJECTORY=str(way), OUTPUT=str(out))
    words = ["run", SCANS, "--spacing=0.2", "--transients=drop", f"--trajectory={way}", "-o", by_hand, "--quiet"]
    subprocess.run([PROGRAM, *words], check=True)
    assert out.read_bytes() == by_hand.read_bytes(), "the plug-in and the program give the same bytes"
    counts = json.loads(Path(f"{out}.report.json").read_text())["transients"]
    assert counts["things"] > 0, counts
    print(f"{counts['points']} points of {counts['things']} things that have gone left out")


def stops_and_continues() -> None:
    """Interrupt ``qgis_process`` as Ctrl-C does, while it solves tiles."""
    common = {"INPUT": str(SCANS), "SPACING": "0.08", "MEMORY": "256MiB"}
    whole, parts = WORK / "whole.laz", WORK / "parts.laz"
    run("resample", **common, OUTPUT=str(whole))
    words = [f"{name}={value}" for name, value in {**common, "OUTPUT": str(parts)}.items()]
    started = subprocess.Popen(
        [EXECUTOR, "run", "lloydar:resample", "--", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=ENVIRONMENT,
    )
    assert started.stdout is not None
    printed = b""
    while b"Solving tiles; 1 of" not in printed:
        piece = os.read(started.stdout.fileno(), 1 << 16)
        assert piece, printed.decode()
        printed += piece
    started.send_signal(signal.SIGINT)
    start = time.monotonic()
    printed += started.communicate(timeout=60)[0]
    assert started.returncode != 0, "a job that was stopped is no success"
    seconds = time.monotonic() - start
    assert b"the same call" in printed, printed.decode()
    assert not parts.exists() and Path(f"{parts}.job").is_dir(), printed.decode()
    running = subprocess.run(["ps", "-eo", "args"], capture_output=True, check=True).stdout.decode()
    assert f"--output={parts}" not in running, "no program is left behind"
    text = run("resample", **common, OUTPUT=str(parts))
    assert whole.read_bytes() == parts.read_bytes(), "the same bytes as without a stop"
    assert not Path(f"{parts}.job").exists()
    print(f"stopped {seconds:.1f} s after SIGINT, continued to the same bytes: {result(text, 'POINTS')} points")


def says_what_is_wrong() -> None:
    out = str(WORK / "wrong.laz")
    assert "there is no such file" in run("resample", code=1, INPUT="nope.laz", SPACING="1", OUTPUT=out)
    assert "one of spacing, count and ratio" in run(
        "resample", code=1, INPUT=str(SCANS), SPACING="1", COUNT="5", OUTPUT=out
    )
    assert "give a trajectory" in run("resample", code=1, INPUT=str(SCANS), SPACING="1", TRANSIENTS="drop", OUTPUT=out)
    broken = WORK / "broken.laz"
    broken.write_text("no scan")
    text = executor("run", "lloydar:info", "--", f"INPUT={broken}", f"INPUT={SCANS}")
    assert "is no LAS or LAZ file" in text and result(text, "FILES") == "2", text
    bare = {**ENVIRONMENT, "PATH": "/usr/bin:/bin", "HOME": str(WORK / "home")}
    words = ("run", "lloydar:info", "--", f"INPUT={SCANS}")
    text = executor(*words, code=None, environment=bare)
    assert "was not found" in text and "cargo install" in text, text
    old = WORK / "old" / "lloydar"
    old.parent.mkdir(exist_ok=True)
    old.write_text("#!/bin/sh\necho lloydar 0.0.3\n")
    old.chmod(0o755)
    text = executor(*words, code=1, environment={**ENVIRONMENT, "PATH": f"{old.parent}:/usr/bin:/bin"})
    assert "needs 0.1 or later" in text, text
    print("missing files, missing and old programs are answered with what to do")


def real_scans() -> list[tuple[Path, str]]:
    """Return scans of the folder that the environment names, with spacings."""
    folder = os.environ.get("LLOYDAR_SCANS")
    if not folder:
        print("SKIPPED: real scans, for want of a folder (LLOYDAR_SCANS)")
        return []
    scans = sorted(path for path in Path(folder).rglob("*.laz") if 5e5 < path.stat().st_size < 15e6)
    return [(path, "1%") for path in scans]


def runs_on_real_scans() -> None:
    done = 0
    for scan, ratio in real_scans():
        out = WORK / "real.copc.laz"
        words = ("run", "lloydar:resample", "--", f"INPUT={scan}", f"RATIO={ratio}", f"OUTPUT={out}")
        text = executor(*words, code=None)
        if "Results" not in text:
            last = [line for line in text.splitlines() if line.startswith("ERROR")]
            print(f"{scan.name}: refused: {last[-1] if last else text[-200:]}")
            continue
        assert int(result(text, "POINTS")) == points_of(out)
        print(f"{scan.name}: {result(text, 'POINTS')} points")
        done += 1
    assert done or not os.environ.get("LLOYDAR_SCANS")


lists_and_helps()
runs(SCANS, "0.2", "street")
drops_what_has_gone()
stops_and_continues()
says_what_is_wrong()
runs_on_real_scans()
