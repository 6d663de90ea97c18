"""Resamples every scan of a folder at two spacings and checks what independent readers read.

    scans.py PROGRAM DIR WORK

A folder named `malformed` contains files that must be answered quickly, by success or by a
message that names the file.
"""

import math
import pathlib
import subprocess
import sys
import time

import laspy

program, folder, work = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
CHECK = pathlib.Path(__file__).with_name("reading.py")
SLOW = 10.0
failures = 0


def run(scans, spacing):
    out = work / f"{scans[0].stem}.{len(scans)}.{spacing:.4g}.laz"
    started = time.monotonic()
    command = [program, "run", *map(str, scans), "-o", str(out), "--overwrite", "--quiet"]
    done = subprocess.run(
        command + ["--spacing", f"{spacing:.4g}"], capture_output=True, text=True
    )
    return out, done, time.monotonic() - started


def spacings(scans):
    """Twice and five times the mean spacing of the scans from above."""
    # From the points: a header may say anything.
    read = [laspy.read(path) for path in scans]
    points = sum(len(scan.points) for scan in read)
    low = [min(scan[axis].min() for scan in read) for axis in "xy"]
    high = [max(scan[axis].max() for scan in read) for axis in "xy"]
    area = (high[0] - low[0]) * (high[1] - low[1])
    mean = math.sqrt(area / points) if area > 0 and points else 1.0
    return [2 * mean, 5 * mean]


def say(scans, spacing, ok, text):
    global failures
    failures += not ok
    names = scans[0].name if len(scans) == 1 else f"{scans[0].name} and {len(scans) - 1} more"
    print(f"| {names} | {spacing:.3g} | {'yes' if ok else 'NO'} | {text} |", flush=True)


files = sorted(p for p in folder.rglob("*") if p.suffix.lower() in (".las", ".laz"))
jobs = [[path] for path in files if path.parent.name != "malformed"]
families = {}
for path in files:
    if "_" in path.stem and path.parent.name != "formats":
        families.setdefault((path.parent, path.stem.split("_")[0]), []).append(path)
jobs += [
    family
    for (parent, _), family in families.items()
    if len(family) > 1 and parent.name not in ("malformed", "street")
]
print("| scan | spacing | holds | what the readers saw |\n| --- | --- | --- | --- |")
for scans in jobs:
    for spacing in spacings(scans):
        out, done, seconds = run(scans, spacing)
        if done.returncode != 0:
            say(scans, spacing, False, f"exit {done.returncode}: {done.stderr.strip()}")
            continue
        check = subprocess.run(
            [sys.executable, CHECK, out, *scans], capture_output=True, text=True
        )
        text = check.stdout.strip() or check.stderr.strip().splitlines()[-1]
        out.unlink()
        say(scans, spacing, check.returncode == 0, f"{text}; {seconds:.1f} s")
for path in files:
    if path.parent.name == "malformed":
        out, done, seconds = run([path], 1.0)
        said = " ".join(done.stderr.split())
        answered = done.returncode in (0, 3) or (done.returncode == 1 and path.name in said)
        say([path], 1.0, answered and seconds < SLOW, f"exit {done.returncode} {said}; {seconds:.1f} s")
sys.exit(failures > 0)
