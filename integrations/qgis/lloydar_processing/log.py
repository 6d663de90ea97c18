"""The lines that ``lloydar --log json`` writes on standard error, as progress and messages.

No QGIS is imported here.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

#: What stages are called in sentences. Names that are not here are shown as they are.
STAGES = {
    "visits": "Finding when every place was seen",
    "sight lines": "Following sight lines",
    "scatter": "Reading the scans",
    "start": "Solving tiles, first half",
    "solve": "Solving tiles",
    "stitch": "Joining tiles",
    "write": "Writing",
    "mesh": "Meshing",
    "order": "Ordering the mesh",
    "levels": "Coarser levels of the mesh",
    "look": "Drawing the overview",
    "sort": "Writing the octree",
}

#: The share of the progress bar that the stages before the first forecast have, in per cent.
BEFORE_FORECAST = 20.0


@dataclass(frozen=True)
class Line:
    """What one line of the log means to a user."""

    #: "progress", "note" or "text": the last is a line that is not JSON, such as an error.
    kind: str
    text: str


class Log:
    """The state of a job, from the lines of its log.

    The forecast of the program, ``remaining`` seconds until the end, decides the percentage as soon as there is
    one; before, the stages that read the scans have a fifth of the bar.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._start = clock()
        #: Share of the job that is done, in per cent. It never falls, and is 100 only after `finish`.
        self.percent = 0.0

    def read(self, line: str) -> Line | None:
        """Return what `line` says, or None if it says nothing; `percent` is brought up to date."""
        line = line.rstrip()
        if not line:
            return None
        try:
            event = json.loads(line)
        except ValueError:
            event = None
        if not isinstance(event, dict) or "event" not in event:
            return Line("text", line)
        if event["event"] == "note":
            return Line("note", str(event.get("text", "")))
        if event["event"] not in ("begin", "progress", "end"):
            return None
        self.percent = max(self.percent, min(99.0, self._share(event)))
        return Line("progress", _sentence(event))

    def finish(self) -> None:
        """Note that the job is complete."""
        self.percent = 100.0

    def _share(self, event: dict[str, Any]) -> float:
        remaining = _number(event.get("remaining"))
        if remaining is not None:
            elapsed = self._clock() - self._start
            return 100.0 * elapsed / max(elapsed + remaining, 1e-9)
        if event.get("stage") == "scatter":
            done, total = _number(event.get("done")) or 0.0, _number(event.get("total")) or 0.0
            return BEFORE_FORECAST * min(1.0, done / total) if total else 0.0
        return 0.0


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def _sentence(event: dict[str, Any]) -> str:
    name = str(event.get("stage", ""))
    parts = [STAGES.get(name, name)]
    done, total = _number(event.get("done")), _number(event.get("total"))
    if done is not None and total:
        parts.append(f"{done:,.0f} of {max(done, total):,.0f}")
    memory, budget = _number(event.get("memory")), _number(event.get("budget"))
    if memory and budget:
        parts.append(f"memory {memory / 2**20:,.0f} of {budget / 2**20:,.0f} MiB")
    remaining = _number(event.get("remaining"))
    if remaining is not None and event["event"] != "end":
        parts.append(f"{duration(remaining)} left")
    return "; ".join(parts)


def duration(seconds: float) -> str:
    """Return minutes and seconds, with hours before them if there are any.

    >>> duration(95), duration(3600)
    ('1:35', '1:00:00')
    """
    whole = round(max(0.0, seconds))
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"
