"""Times whole jobs on real scans and simulated streets against decoding them once and against
CloudCompare; scripts/bench-job runs it.

    scans.py WORK [DIR] [--scans NAME,…] [--ratios N,…] [--rounds N] [--programs NAME=PATH,…]
"""

import argparse
import csv
import json
import math
import os
import statistics
import sys
from collections import defaultdict
from pathlib import Path

import cloudcompare
from process import measured
from street import simulated

SCANS = "street_tls_182,noisy_trees_crop,dense_tls_crop,handheld_mls_crop,street-5M,street-20M"
RATIOS = "20,50,100,300,1000"
# CloudCompare's points may be more or fewer than ours by this share.
TOLERANCE = 0.03
TRIALS = 12
# How lloydar is told how many points to make, and what of CloudCompare is timed.
ASKED = ["--spacing", "--ratio"]
THINNED, WHOLE = "CloudCompare's subsampling", "CloudCompare, whole process"


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("work", type=Path)
    arguments.add_argument("folder", nargs="?", default=os.environ.get("LLOYDAR_SCANS"))
    arguments.add_argument("--scans", default=SCANS)
    arguments.add_argument("--ratios", default=RATIOS)
    arguments.add_argument("--rounds", type=int, default=5)
    arguments.add_argument("--programs", default="lloydar=target/release/lloydar")
    options = arguments.parse_intermixed_args()
    programs = dict(given.split("=", 1) for given in options.programs.split(","))
    ratios = [int(ratio) for ratio in options.ratios.split(",")]
    first = next(iter(programs.values()))
    scans = []
    for name in options.scans.split(","):
        if paths := files_of(name, options.folder, first, options.work):
            scans.append(Scan(name, paths, options.work))
        else:
            print(f"{name}: skipped, for want of a folder that contains it (LLOYDAR_SCANS)\n")
    for scan in scans:
        for ratio in ratios:
            scan.prepare(ratio, first)
    rounds = Rounds(options.work / "rounds.csv")
    for number in range(options.rounds):
        print(f"round {number + 1} of {options.rounds}", file=sys.stderr, flush=True)
        for scan in scans:
            scan.run(ratios, programs, rounds)
    for scan in scans:
        print_table(scan, ratios, list(programs), rounds, options.rounds)


def files_of(name, folder, program, work):
    """The files of a scan: found by name in a folder, or, for `street-NM`, simulated."""
    if name.startswith("street-"):
        street = simulated(program, work, name.removeprefix("street-"))
        return sorted(street.glob("*.laz"))
    found = Path(folder).rglob(f"{name}.la[sz]") if folder else []
    return sorted(found)[:1]


class Rounds:
    """What was measured, by scan, ratio and job: `[(seconds, peak, points)]`, a round each.

    Each is written to a table as well, so that an interrupted run is not lost.
    """

    def __init__(self, path):
        self.runs = defaultdict(list)
        self.file = open(path, "w", newline="")
        self.table = csv.writer(self.file)
        self.table.writerow(["scan", "ratio", "job", "seconds", "peak_mib", "points"])

    def add(self, key, seconds, peak, points=None):
        self.runs[key].append((seconds, peak, points))
        self.table.writerow([*key, f"{seconds:.4f}", f"{peak:.1f}", points])
        self.file.flush()

    def seconds(self, *key):
        return [seconds for seconds, _, _ in self.runs[key]]

    def peak(self, *key):
        return max((peak for _, peak, _ in self.runs[key]), default=0)

    def points(self, *key):
        return self.runs[key][-1][2]


class Scan:
    def __init__(self, name, paths, work):
        self.name, self.paths, self.work = name, paths, work
        self.bytes = sum(path.stat().st_size for path in paths)
        self.ply = work / f"{name}.ply"
        self.output = work / "lloydar.laz"
        self.prepared = {}

    def prepare(self, ratio, program):
        """Finds the spacing that `--ratio` finds, and the distance with which CloudCompare leaves as
        many points; both are remembered in the work directory."""
        cache = self.work / "prepared.json"
        known = json.loads(cache.read_text()) if cache.exists() else {}
        key = f"{self.name}, {self.bytes} bytes, 1/{ratio}"
        entry = known.get(key) or self.by_ratio(ratio, program)
        if cloudcompare.is_here():
            if not self.ply.exists():
                measured([sys.executable, Path(__file__).with_name("decoding.py"), "ply",
                          self.ply, *self.paths])
            entry["distance"] = entry.get("distance") or self.distance(entry)
        known[key] = self.prepared[ratio] = entry
        cache.write_text(json.dumps(known, indent=1))

    def by_ratio(self, ratio, program):
        measured(self.job(program, "--ratio", 1 / ratio))
        report = self.report()
        read = sum(given["read"] for given in report["inputs"])
        return {"spacing": report["spacing"], "points": report["points"], "read": read}

    def distance(self, entry):
        """The distance for CloudCompare, by a secant of the logarithms of distance and points."""
        distance, wanted, exponent = 0.83 * entry["spacing"], entry["points"], -2.0
        last = None
        for _ in range(TRIALS):
            points = cloudcompare.subsample(self.ply, distance, self.work / "thinned.ply").points
            print(f"{self.name}: CloudCompare leaves {points} of {wanted} at {distance:.5g}",
                  file=sys.stderr, flush=True)
            if abs(points / wanted - 1) <= TOLERANCE:
                return distance
            if last and points != last[1]:
                exponent = log_ratio(points, last[1]) / log_ratio(distance, last[0])
                # Between a curve's and a volume's, whatever two trials that are close say.
                exponent = min(max(exponent, -3.5), -0.7)
            last = distance, points
            distance *= (wanted / max(points, 1)) ** (1 / exponent)
        sys.exit(f"{self.name}: no distance leaves {wanted} points")

    def job(self, program, *asked):
        return [program, "run", *self.paths, "-o", self.output, *asked, "--overwrite", "--quiet"]

    def report(self):
        return json.loads(Path(f"{self.output}.report.json").read_text())

    def run(self, ratios, programs, rounds):
        """One round: decoding, then for each ratio every job in turn."""
        decoding = Path(__file__).with_name("decoding.py")
        done = measured([sys.executable, decoding, "once", *self.paths])
        rounds.add((self.name, None, "decoding"), float(done.output), done.peak)
        for ratio in ratios:
            prepared = self.prepared[ratio]
            for name, program in programs.items():
                for asked in zip(ASKED, [prepared["spacing"], 1 / ratio]):
                    done = measured(self.job(program, *asked))
                    key = self.name, ratio, f"{name} {asked[0]}"
                    rounds.add(key, done.seconds, done.peak, self.report()["points"])
            if cloudcompare.is_here():
                thinned = self.work / "thinned.ply"
                done = cloudcompare.subsample(self.ply, prepared["distance"], thinned)
                key = self.name, ratio, THINNED
                rounds.add(key, done.seconds, done.process.peak, done.points)
                key = self.name, ratio, WHOLE
                rounds.add(key, done.process.seconds, done.process.peak, done.points)


def log_ratio(a, b):
    return math.log(a / b)


def print_table(scan, ratios, programs, rounds, count):
    """Prints medians; ratios are medians of those of single rounds."""
    decoding = rounds.seconds(scan.name, None, "decoding")
    read = next(iter(scan.prepared.values()))["read"]
    print(f"### {scan.name}\n\n{read} points, {scan.bytes / 1e6:.1f} MB; decoding once "
          f"{span(decoding)} s, {rounds.peak(scan.name, None, 'decoding'):.0f} MiB; {count} rounds, "
          "medians (least to most)\n")
    thinning = cloudcompare.is_here()
    head = ["one in", "program", "points"]
    for asked in ASKED:
        head += [f"`{asked}`, s", "÷ decoding"] + ["÷ CloudCompare"] * thinning
        head += [f"÷ {programs[0]}"] * (len(programs) > 1)
    head.append("peak MiB")
    print_row(head)
    print_row(["---"] * len(head))
    for ratio in ratios:
        thinned = rounds.seconds(scan.name, ratio, THINNED)
        for program in programs:
            row = [ratio, program, rounds.points(scan.name, ratio, f"{program} {ASKED[0]}")]
            for asked in ASKED:
                ours = rounds.seconds(scan.name, ratio, f"{program} {asked}")
                first = rounds.seconds(scan.name, ratio, f"{programs[0]} {asked}")
                row += [span(ours), times(ours, decoding)] + [times(ours, thinned)] * thinning
                row += [times(ours, first)] * (len(programs) > 1)
            peak = max(rounds.peak(scan.name, ratio, f"{program} {asked}") for asked in ASKED)
            print_row(row + [f"{peak:.0f}"])
        for name in [THINNED, WHOLE] if thinning else []:
            key = scan.name, ratio, name
            row = [ratio, name, rounds.points(*key), span(rounds.seconds(*key))]
            row.append(times(rounds.seconds(*key), decoding))
            print_row(row + [""] * (len(head) - len(row) - 1) + [f"{rounds.peak(*key):.0f}"])
    print(flush=True)


def span(seconds):
    median = statistics.median(seconds)
    return f"{median:.2f} ({min(seconds):.2f} - {max(seconds):.2f})"


def times(ours, theirs):
    return f"{statistics.median(a / b for a, b in zip(ours, theirs)):.2f}"


def print_row(cells):
    print("| " + " | ".join(map(str, cells)) + " |")


main()
