"""Compares clouds of all levels of an octree with those of the levels that `--levels auto` reads.

    compare.py PROGRAM WORK [SCAN...]     WORK/street: a simulated street
"""

import json
import subprocess
import sys
from pathlib import Path

from write import write

# Points of the scan to one of the output.
RATIOS = (20, 80, 320, 1280)
# How much less even a cloud may be, if it has so many points that chance does not decide.
LESS_EVEN, LEAST_POINTS = 1.1, 500


def call(program, *words):
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{words}: {done.stderr}")
    return done.stdout


def main(program, work, *scans):
    work = Path(work)
    streets = sorted((work / "street").glob("*.laz"))
    jobs = [("street", streets, work / "street")] + [(Path(scan).stem, [scan], None) for scan in scans]
    print("| scan | spacing | points read, of all | points out | δ | energy | to the truth: mean, p99 | from the scan: p99 |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    good = True
    for name, paths, truth in jobs:
        octree = work / f"{name}.copc.laz"
        write(paths, octree)
        for ratio in RATIOS:
            plan = json.loads(call(program, "plan", octree, "--ratio", f"{100 / ratio}%", "--json"))
            spacing = f"{plan['spacing']:.3g}"
            figures = {}
            for levels in ("all", "auto"):
                output = work / "out.laz"
                call(program, "run", octree, "-o", output, "--spacing", spacing, "--levels", levels, "--overwrite", "--quiet")
                report = json.loads(Path(f"{output}.report.json").read_text())
                read = sum(given["read"] for given in report["inputs"])
                measured = json.loads(call(program, "measure", output, "--json", "--against", octree,
                                           *(["--truth", truth] if truth else [])))
                figures[levels] = (read, report["points"], measured)
            everything = figures["all"][0]
            for levels, (read, points, measured) in figures.items():
                even = measured["uniformity"]
                away = f"{measured['truth']['mean']:.4f}, {measured['truth']['p99']:.3f}" if truth else ""
                gap = f"{measured['coverage']['p99']:.3f}"
                print(f"| {name}, {levels} | {spacing} | {read} ({100 * read / everything:.0f} %) | {points} | {even['delta']:.4f} "
                      f"| {even['energy_ratio']:.4f} | {away} | {gap} |", flush=True)
            deltas = [figures[levels][2]["uniformity"]["delta"] for levels in ("all", "auto")]
            if figures["auto"][1] >= LEAST_POINTS and deltas[1] > LESS_EVEN * deltas[0]:
                print(f"{name} at {spacing}: less even")
                good = False
    if not good:
        sys.exit("test-octree-levels: a cloud of upper levels is less even than that of all")


if __name__ == "__main__":
    main(*sys.argv[1:])
