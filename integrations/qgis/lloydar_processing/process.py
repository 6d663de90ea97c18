"""The program as a process that reports lines and can be stopped. No QGIS is imported here."""

from __future__ import annotations

import os
import queue
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import IO

from .program import no_window

#: Exit codes of the program.
DONE, FAILED, USAGE, INCOMPLETE, STOPPED = 0, 1, 2, 3, 130

#: Seconds that the program has to stop by itself before it is killed; it needs less than one.
GRACE = 5.0
#: Seconds between two looks at whether the user has cancelled.
BETWEEN_LOOKS = 0.1


@dataclass(frozen=True)
class Outcome:
    """How the process ended."""

    code: int
    #: Standard output.
    output: str
    #: Whether the user stopped it. A process that was done before it could stop was not stopped.
    cancelled: bool


def follow(
    words: Sequence[str],
    on_line: Callable[[str], None],
    is_cancelled: Callable[[], bool],
) -> Outcome:
    """Run `words` until the process ends or `is_cancelled`; `on_line` gets each line of standard error.

    A user who cancels stops the process as Ctrl-C would. A job can be stopped at any moment, and killed too: the
    same words continue it. Ctrl-C in a terminal (`KeyboardInterrupt` here) cancels as well. All calls of
    `on_line` and `is_cancelled` are made in the thread of the caller.
    """
    process = subprocess.Popen(
        list(words),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **no_window(),
    )
    lines: queue.Queue[str | None] = queue.Queue()
    output: list[bytes] = []
    assert process.stdout is not None and process.stderr is not None
    readers = [
        threading.Thread(target=_read_lines, args=(process.stderr, lines), daemon=True),
        threading.Thread(target=_read_all, args=(process.stdout, output), daemon=True),
    ]
    for reader in readers:
        reader.start()
    deadline = None
    is_open = True
    while is_open:
        try:
            try:
                line = lines.get(timeout=BETWEEN_LOOKS)
                is_open = line is not None
                if line is not None:
                    on_line(line)
            except queue.Empty:
                pass
            cancels = is_cancelled()
        except KeyboardInterrupt:
            cancels = True
        except BaseException:
            process.kill()
            raise
        if cancels and deadline is None and is_open:
            deadline = time.monotonic() + GRACE
            _stop(process)
        elif deadline is not None and time.monotonic() > deadline:
            process.kill()
    code = process.wait()
    for reader in readers:
        reader.join()
    text = b"".join(output).decode("utf-8", "replace")
    return Outcome(code, text, deadline is not None and code not in (DONE, INCOMPLETE))


def _stop(process: subprocess.Popen[bytes]) -> None:
    if os.name == "nt":
        process.terminate()
    else:
        process.send_signal(signal.SIGINT)


def _read_lines(stream: IO[bytes], lines: queue.Queue[str | None]) -> None:
    with stream:
        for line in stream:
            lines.put(line.decode("utf-8", "replace"))
    lines.put(None)


def _read_all(stream: IO[bytes], output: list[bytes]) -> None:
    with stream:
        output.append(stream.read())
