"""The program ``lloydar``, in this process."""

from __future__ import annotations

import signal
import sys

from . import _lloydar


def main() -> int:
    """Runs the program with the arguments of the process, and returns its exit code."""
    # The program has its own way to stop. Python's handler would wait until it has ended.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _lloydar.main(["lloydar", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
