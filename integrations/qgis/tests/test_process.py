"""The process reports lines as they come, and stops when the user cancels."""

from __future__ import annotations

import sys
import time

import pytest
from lloydar_processing import process
from lloydar_processing.process import follow

#: A program that stops at SIGINT as lloydar does, with its exit code.
STOPS = """
import signal, sys, time
def stop(*_):
    print("stopping", file=sys.stderr, flush=True)
    sys.exit(130)
signal.signal(signal.SIGINT, stop)
print("begun", file=sys.stderr, flush=True)
time.sleep(60)
"""
IGNORES = STOPS.replace("sys.exit(130)", "pass").replace("time.sleep(60)", "[time.sleep(1) for _ in range(60)]")


def python(code: str) -> list[str]:
    return [sys.executable, "-c", code]


def test_lines_and_output_are_kept_apart() -> None:
    lines: list[str] = []
    code = "import sys; print('result'); print('one\\ntwo', file=sys.stderr); print('x' * 10**6); sys.exit(3)"
    outcome = follow(python(code), lines.append, lambda: False)
    assert (outcome.code, outcome.cancelled) == (3, False)
    assert outcome.output.startswith("result") and len(outcome.output) > 10**6
    assert [line.strip() for line in lines] == ["one", "two"]


def test_cancelling_stops_as_ctrl_c_does() -> None:
    lines: list[str] = []
    start = time.monotonic()
    outcome = follow(python(STOPS), lines.append, lambda: bool(lines))
    assert (outcome.code, outcome.cancelled) == (130, True)
    assert [line.strip() for line in lines] == ["begun", "stopping"]
    assert time.monotonic() - start < 5


def test_ctrl_c_in_a_terminal_cancels() -> None:
    lines: list[str] = []
    raised: list[bool] = []

    def on_line(line: str) -> None:
        lines.append(line)
        if not raised:
            raised.append(True)
            raise KeyboardInterrupt

    outcome = follow(python(STOPS), on_line, lambda: False)
    assert (outcome.code, outcome.cancelled) == (130, True)


def test_what_does_not_stop_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "GRACE", 0.3)
    lines: list[str] = []
    outcome = follow(python(IGNORES), lines.append, lambda: bool(lines))
    assert outcome.cancelled and outcome.code not in (0, 130)


def test_what_is_done_before_it_could_stop_was_not_cancelled() -> None:
    lines: list[str] = []
    code = "import signal, sys\nsignal.signal(signal.SIGINT, lambda *_: sys.exit(0))\n"
    code += "print('x', file=sys.stderr, flush=True)\nsignal.pause()"
    outcome = follow(python(code), lines.append, lambda: bool(lines))
    assert (outcome.code, outcome.cancelled) == (0, False)


def test_an_error_of_the_listener_ends_the_process() -> None:
    with pytest.raises(ValueError, match="mine"):
        follow(python(STOPS), lambda line: (_ for _ in ()).throw(ValueError("mine")), lambda: False)
