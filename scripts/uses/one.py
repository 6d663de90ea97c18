"""Runs one use on one simulated scan and writes its figures as JSON; all.py runs it.

    one.py PROGRAM USE SEED OUT WORK FRONT [quick]
"""

import importlib
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path


@dataclass
class Context:
    """What all steps share: the program, a directory for files, and lloydar's latest spacing (m)."""

    program: str
    work: Path
    seed: int
    spacing: float = 0.0
    # Where lloydar writes a mesh, too, and the compiled advancing front, if there are any.
    mesh: Path | None = None
    front: Path | None = None


def main():
    program, use, seed, out, work, front = sys.argv[1:7]
    begun = time.monotonic()
    front = Path(front)
    context = Context(program, Path(work), int(seed), front=front if front.exists() else None)
    found = importlib.import_module(use).run(int(seed), context, sys.argv[7:] == ["quick"])
    print(f"{use}, scan {seed}: {time.monotonic() - begun:.0f} s", file=sys.stderr, flush=True)
    Path(out).write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
