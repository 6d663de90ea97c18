"""Compares `lloydar.resample` with packages from PyPI that thin points, at the same number of points.

    packages.py [--points 1M] [--count 50000] [--length 60]

Each package thins a simulated street. One process searches for the size that meets the count to 0.5 %; another
one, which has imported what it needs, thins once and is timed. Prints a table for docs/PYTHON.md: time, processor
time, added peak memory, and figures of `lloydar.measure`, which fits its cells to the points that it is given,
whatever made them. A package that is not installed is left out, with a word.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np

import lloydar
from thinning import by_open3d_voxels, by_pymeshlab

Sampler = Callable[[np.ndarray, float], np.ndarray]


def by_lloydar(points: np.ndarray, spacing: float) -> np.ndarray:
    return lloydar.resample(points, spacing=spacing).points


def by_point_cloud_utils(points: np.ndarray, radius: float) -> np.ndarray:
    import point_cloud_utils

    return points[point_cloud_utils.downsample_point_cloud_poisson_disk(points, radius, random_seed=1)]


def by_fpsample(points: np.ndarray, count: float) -> np.ndarray:
    import fpsample

    return points[fpsample.bucket_fps_kdline_sampling(points, int(count), h=9)]


#: Name, function, and whether its number is a count of points; otherwise it is a length.
METHODS: list[tuple[str, Sampler, bool]] = [
    ("lloydar", by_lloydar, False),
    ("open3d `voxel_down_sample`", by_open3d_voxels, False),
    ("point_cloud_utils Poisson", by_point_cloud_utils, False),
    ("pymeshlab Poisson", by_pymeshlab, False),
    ("fpsample farthest points", by_fpsample, True),
]


def matched(sampler: Sampler, points: np.ndarray, count: int, first: float) -> float:
    """The length at which `sampler` gives `count` points to 0.5 %, by secants of the logarithms."""
    tried: list[tuple[float, float]] = []
    length = first
    for _ in range(12):
        given = len(sampler(points, length))
        if abs(given / count - 1) <= 0.005:
            return length
        tried.append((np.log(length), np.log(given / count)))
        slope = -2.0
        if len(tried) > 1 and tried[-1][0] != tried[-2][0]:
            slope = (tried[-1][1] - tried[-2][1]) / (tried[-1][0] - tried[-2][0])
            slope = min(max(slope, -4.0), -0.5)
        length = float(np.exp(tried[-1][0] - tried[-1][1] / slope))
    raise RuntimeError(f"{count} points are not met: {given}")


def resident(which: str) -> int:
    """The memory of this process now (VmRSS), or its peak (VmHWM), in bytes."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(which))


def search(index: int, scan: Path, out: Path, count: int) -> None:
    """Writes the size at which the count is met."""
    name, sampler, is_count = METHODS[index]
    points = np.load(scan)
    extent = np.ptp(points, axis=0)
    first = float(np.sqrt(2 * extent[0] * extent[1] / count))
    try:
        size = count if is_count else matched(sampler, points, count, first)
    except ImportError as error:
        print(f"{name}: not installed ({error})", file=sys.stderr)
        os._exit(3)
    out.with_suffix(".size").write_text(repr(float(size)))
    # Some packages end their process with a crash of their own.
    os._exit(0)


def trial(index: int, scan: Path, out: Path, _: int) -> None:
    """Thins once, and writes points and costs."""
    _, sampler, is_count = METHODS[index]
    points = np.load(scan)
    size = float(out.with_suffix(".size").read_text())
    # Imports and pools are not counted.
    few = points[:: len(points) // 1000]
    sampler(few, 100 if is_count else float(np.ptp(few)) / 20)
    before = resident("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")
    start, used = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF)
    thinned = sampler(points, size)
    wall, now = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF)
    cpu = now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime
    added = resident("VmHWM") - before
    np.save(out, thinned)
    costs = {"points": len(thinned), "wall": wall, "cpu": cpu, "memory": added}
    out.with_suffix(".json").write_text(json.dumps(costs))
    os._exit(0)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--points", default="1M")
    parser.add_argument("--count", type=int, default=50_000)
    parser.add_argument("--length", type=float, default=60.0)
    given = parser.parse_args()
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        street = lloydar.simulate(Path(folder, "street"), points=given.points, length=given.length)
        points = np.concatenate([laspy.read(path).xyz for path in street])
        points -= np.floor(points.min(axis=0))
        scan = Path(folder, "scan.npy")
        np.save(scan, points)
        print(f"{len(points):,} points to {given.count:,}:\n")
        print("| package | points | seconds | processor s | added MiB | δ | energy ratio | packing | area CV |")
        print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
        for index, (name, _, _) in enumerate(METHODS):
            out = Path(folder, f"{index}.npy")
            for step in (search, trial):
                process = context.Process(target=step, args=(index, scan, out, given.count))
                process.start()
                process.join()
                if process.exitcode != 0:
                    break
            if process.exitcode != 0:
                print(f"{name} failed with code {process.exitcode}", file=sys.stderr)
                continue
            costs = json.loads(out.with_suffix(".json").read_text())
            figures = lloydar.measure(np.load(out)).uniformity
            columns = [name, f"{costs['points']:,}", f"{costs['wall']:.2f}", f"{costs['cpu']:.2f}"]
            columns += [f"{costs['memory'] / 2**20:.0f}"]
            columns += [f"{figures[key]:.3f}" for key in ("delta", "energy_ratio", "packing", "cell_area_cv")]
            print(f"| {' | '.join(columns)} |", flush=True)


if __name__ == "__main__":
    main()
