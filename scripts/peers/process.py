"""Runs a process and measures its time and memory."""

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass


@dataclass
class Measured:
    """What a process took: seconds from its start to its end, and its peak memory in MiB."""

    seconds: float
    peak: float
    output: str


def measured(command):
    """Runs a command that must succeed.

    Linux counts what the parent holds while it forks as memory of the child, so that the parent
    imports neither numpy nor laspy, and never holds points.
    """
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as errors:
        start = time.monotonic()
        process = subprocess.Popen([*map(str, command)], stdout=output, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.monotonic() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        errors.seek(0)
        if status != 0:
            sys.exit(f"{command}: failed: {errors.read().decode(errors='replace')[-500:]}")
        text = output.read().decode(errors="replace")
    return Measured(seconds, usage.ru_maxrss / 1024, text)
