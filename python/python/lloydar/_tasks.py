"""Waiting for work in the background: Ctrl-C, progress and notes are dealt with here, in the caller's thread."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Union

from ._lloydar import Task

__all__ = ["Progress", "ProgressOption"]

#: Notes on inputs and runs are logged here at level INFO, the stages of jobs at level DEBUG.
logger = logging.getLogger("lloydar")

#: Seconds between two looks at the work.
_INTERVAL = 0.05
#: Seconds that the work has to stop by itself after an interruption. A job can be stopped at any
#: moment, so that nothing is lost if it takes longer: then it ends by itself, in the background.
_GRACE = 0.5

#: Work that was interrupted, and has not ended yet. It still holds its job directory.
_abandoned: list[Task] = []

# The threads of the parent do not exist in a child.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_abandoned.clear)


@dataclass(frozen=True)
class Progress:
    """How far the work is, as a callable given as ``progress`` receives it.

    Attributes
    ----------
    stage : str
        The stage of the work: ``"resample"`` in memory; ``"scatter"``, ``"solve"``, … of a job.
    done, total : int
        Units of the stage that are done, and how many there are.
    unit : str
        ``"points"``, ``"tiles"`` or ``"%"``.
    memory : int or None
        Memory of the process in bytes, if a job knows it.
    remaining : float or None
        Seconds until the whole job is done, if they can be estimated.
    """

    stage: str
    done: int
    total: int
    unit: str
    memory: int | None = None
    remaining: float | None = None

    @property
    def share(self) -> float:
        """The share of the stage that is done, from 0 to 1."""
        return self.done / self.total if self.total else 1.0


#: ``True`` shows a bar (if tqdm is installed; else lines are logged), ``False`` shows nothing, a callable is
#: called with a `Progress` whenever something has changed, at most twenty times a second, in the caller's thread.
ProgressOption = Union[bool, Callable[[Progress], object]]


def follow(task: Task, progress: ProgressOption) -> Any:
    """Waits for the end of `task`, and returns its result.

    An exception in the meantime, such as a `KeyboardInterrupt` or one of the callable, cancels the task and
    is raised within a second.
    """
    listener = _Listener(progress)
    try:
        while not task.wait(_INTERVAL):
            listener.look_at(task)
        listener.look_at(task)
    except BaseException:
        task.cancel()
        _abandoned.append(task)
        if task.wait(_GRACE):
            _forget(task)
        raise
    finally:
        listener.close()
    return task.result()


def wait_for_abandoned() -> None:
    """Waits until interrupted work has ended: the next job may want its directory."""
    for task in list(_abandoned):
        while not task.wait(_INTERVAL):
            pass
        _forget(task)


def _forget(task: Task) -> None:
    # Another thread that waited for the task may have been first.
    with suppress(ValueError):
        _abandoned.remove(task)


class _Listener:
    """Hands the reports of a task on."""

    def __init__(self, progress: ProgressOption) -> None:
        self._last: Progress | None = None
        self._stage = ""
        self._bar: _Bar | None = None
        self._call: Callable[[Progress], object] | None = None
        if callable(progress):
            self._call = progress
        elif progress:
            self._bar = _Bar.new()
            self._call = self._bar.show if self._bar else _log

    def look_at(self, task: Task) -> None:
        fields, notes = task.reports()
        for note in notes:
            logger.info("%s", note)
        current = Progress(**fields)
        if not current.stage or current == self._last:
            return
        if current.stage != self._stage:
            self._stage = current.stage
            logger.debug("%s: %d %s", current.stage, current.total, current.unit)
        self._last = current
        if self._call is not None:
            self._call(current)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def _log(progress: Progress) -> None:
    logger.info("%s: %.0f %%", progress.stage, 100 * progress.share)


class _Bar:
    """A bar of tqdm for each stage."""

    def __init__(self, tqdm: Any) -> None:
        self._tqdm = tqdm
        self._bar: Any = None
        self._stage = ""

    @classmethod
    def new(cls) -> _Bar | None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return None
        return cls(tqdm)

    def show(self, progress: Progress) -> None:
        if progress.stage != self._stage:
            self.close()
            self._stage = progress.stage
            scaled = progress.unit == "points"
            self._bar = self._tqdm(desc=progress.stage, unit=f" {progress.unit}", unit_scale=scaled)
        self._bar.total = progress.total
        self._bar.update(progress.done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None
