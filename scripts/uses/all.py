"""Runs the four uses on several simulated scans, each in a process of its own, and writes the tables.

    all.py PROGRAM WORK PAGE --command TEXT --commit TEXT [--scans N] [--only USE,…] [--keep] [--quick]
"""

import argparse
import datetime
import importlib.metadata
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import page

PACKAGES = ["pymeshlab", "open3d", "small_gicp", "py4dgeo", "scipy", "numpy"]


def version_of(package):
    try:
        return f"{package} {importlib.metadata.version(package)}"
    except importlib.metadata.PackageNotFoundError:
        return f"{package} is not installed: left out"


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("work", type=Path)
    arguments.add_argument("page", type=Path)
    arguments.add_argument("--command", required=True)
    arguments.add_argument("--commit", required=True)
    arguments.add_argument("--scans", type=int, default=12)
    arguments.add_argument("--only", default=",".join(page.TITLES))
    arguments.add_argument("--quick", action="store_true")
    arguments.add_argument("--keep", action="store_true")
    options = arguments.parse_args()
    options.date = datetime.date.today().isoformat()
    asked = [options.program, "--version"]
    options.version = subprocess.run(asked, check=True, capture_output=True, text=True).stdout.strip()
    uses = options.only.split(",")
    # Figures of another build are never taken for those of this one.
    folder = options.work.resolve() / "figures" / options.commit
    if not options.keep:
        shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)

    begun, results = time.monotonic(), {use: [] for use in uses}
    for seed in range(1, options.scans + 1):
        files = options.work.resolve() / "files"
        for use in uses:
            out = folder / f"{use}-{seed}.json"
            if not out.exists():
                shutil.rmtree(files, ignore_errors=True)
                files.mkdir()
                one = Path(__file__).resolve().with_name("one.py")
                words = [sys.executable, one, options.program, use, seed, out, files, files.with_name("front")]
                words += ["quick"] if options.quick else []
                # py4dgeo writes its log into the directory that it is run in.
                done = subprocess.run(list(map(str, words)), cwd=files)
                if done.returncode != 0:
                    sys.exit(f"{use}, scan {seed}: failed")
            results[use].append(json.loads(out.read_text()))
        shutil.rmtree(files, ignore_errors=True)
    print(f"{(time.monotonic() - begun) / 60:.0f} minutes", file=sys.stderr)
    page.write(options.page, results, options, ", ".join(map(version_of, PACKAGES)))


if __name__ == "__main__":
    main()
