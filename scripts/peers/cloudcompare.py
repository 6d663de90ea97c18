"""CloudCompare's spatial subsampling: the points of a cloud that keep a distance to each other."""

import os
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass

from process import Measured

OPTIONS = "-SILENT -AUTO_SAVE OFF -C_EXPORT_FMT PLY -PLY_EXPORT_FMT BINARY_LE -O -GLOBAL_SHIFT AUTO"


def is_here():
    return shutil.which("CloudCompare") is not None


def write_ply(points, path):
    """Writes points as CloudCompare reads them fastest: Debian's build reads no LAS."""
    with open(path, "wb") as ply:
        coordinates = "".join(f"property double {axis}\n" for axis in "xyz")
        head = "ply\nformat binary_little_endian 1.0\n"
        ply.write(f"{head}element vertex {len(points)}\n{coordinates}end_header\n".encode())
        points.astype("<f8").tofile(ply)


@dataclass
class Subsampled:
    """The points that were left, the seconds of the subsampling alone, and the whole process."""

    points: int
    seconds: float
    process: Measured


def subsample(ply, distance, result):
    """Subsamples a PLY file in a process of its own.

    The seconds are those between two lines of its output, which is made to arrive line by line:
    loading, which every program does in its own way, and saving are left out.
    """
    thinned = ["-SS", "SPATIAL", str(distance), "-SAVE_CLOUDS", "FILE", str(result)]
    command = ["stdbuf", "-oL", "CloudCompare", *OPTIONS.split(), str(ply), *thinned]
    start = time.monotonic()
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
    )
    began = points = seconds = None
    lines = []
    for line in process.stdout:
        lines.append(line)
        words = line.split()
        if words[:2] == ["Processing", "cloud"]:
            began = time.monotonic()
        elif words[:1] == ["Result:"] and began is not None:
            points, seconds = int(words[1]), time.monotonic() - began
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if status != 0 or points is None:
        sys.exit(f"{command}: failed: {''.join(lines)[-500:]}")
    whole = Measured(time.monotonic() - start, usage.ru_maxrss / 1024, "")
    return Subsampled(points, seconds, whole)
