"""Lines of the log become progress that never falls, and messages."""

from __future__ import annotations

import json

from lloydar_processing.log import Log, duration


class Clock:
    """A clock that is set by hand, in seconds."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def event(**fields: object) -> str:
    base = {"event": "progress", "stage": "solve", "done": 1, "total": 4, "seconds": 1.0}
    return json.dumps({**base, "remaining": None, "memory": 2**20, "budget": 2**30, **fields}) + "\n"


def test_the_forecast_of_the_program_decides_the_percentage() -> None:
    clock = Clock()
    log = Log(clock)
    line = log.read(event(event="begin", stage="scatter", done=0, total=100))
    assert line is not None and log.percent == 0
    log.read(event(stage="scatter", done=50, total=100))
    assert log.percent == 10
    clock.now = 30.0
    line = log.read(event(remaining=90.0))
    assert log.percent == 25
    assert line is not None and line.kind == "progress"
    assert line.text == "Solving tiles; 1 of 4; memory 1 of 1,024 MiB; 1:30 left"


def test_progress_never_falls_and_is_complete_only_at_the_end() -> None:
    clock = Clock()
    log = Log(clock)
    clock.now = 99.9
    log.read(event(remaining=0.0))
    assert log.percent == 99
    log.read(event(remaining=1000.0))
    assert log.percent == 99
    log.finish()
    assert log.percent == 100


def test_notes_and_other_lines_are_messages() -> None:
    log = Log()
    note = log.read('{"event":"note","text":"spacing 0.1"}\n')
    assert note is not None and (note.kind, note.text) == ("note", "spacing 0.1")
    error = log.read("lloydar: nope.laz: there is no such file\n")
    assert error is not None and error.kind == "text"
    for strange in ("[1]", "3", "null", '{"a":1}', "{broken"):
        assert log.read(strange).kind == "text"
    assert log.read("\n") is None
    assert log.read('{"event":"of a later version"}') is None
    assert log.read(event(done="many", total=None, remaining="soon", memory=True)).text == "Solving tiles"


def test_a_duration_is_read_at_a_glance() -> None:
    assert [duration(seconds) for seconds in (0.4, 95, 3599.6, 36061)] == ["0:00", "1:35", "1:00:00", "10:01:01"]
