"""What can go wrong: one base, and a class for each who can help."""

from __future__ import annotations

import re
from collections.abc import Sequence

__all__ = [
    "Error",
    "InputError",
    "InternalError",
    "OptionError",
    "OutputError",
    "RequestError",
    "ResourceError",
    "StoppedError",
]


def _with_keywords(message: str) -> str:
    """Writes the options in a message of the program as keywords: ``--tile-size`` as ``tile_size``."""
    return re.sub(r"--([a-z][a-z-]*)", lambda flag: flag[1].replace("-", "_"), message)


class Error(Exception):
    """Base of all exceptions of this package. The message has the numbers and the remedy."""

    def __init__(self, message: str) -> None:
        super().__init__(_with_keywords(message))


class RequestError(Error, ValueError):
    """What was requested cannot be done with these points: a spacing is too wide, a count too high."""


class OptionError(RequestError):
    """An option is unknown, out of its range, or names a file that cannot be used.

    Attributes
    ----------
    option : str or None
        The name of the option, if one alone is at fault.
    """

    def __init__(self, message: str, option: str | None = None) -> None:
        super().__init__(message)
        self.option = option


class InputError(Error, ValueError):
    """Points or files cannot be used.

    Attributes
    ----------
    files : list of (str, str)
        The files at fault, each with the reason; empty for points in memory.
    index : int or None
        The index of the first point at fault, if one point is.
    """

    def __init__(
        self, message: str, files: Sequence[tuple[str, str]] = (), index: int | None = None
    ) -> None:
        super().__init__(message)
        self.files = list(files)
        self.index = index


class OutputError(Error, OSError):
    """The output cannot be written: it exists already, its name has no known ending, the disk refuses it.

    Attributes
    ----------
    files : list of (str, str)
        The files at fault, each with the reason.
    """

    def __init__(self, message: str, files: Sequence[tuple[str, str]] = ()) -> None:
        super().__init__(message)
        self.files = list(files)


class ResourceError(Error, RuntimeError):
    """Memory, disk or threads are too little for the job. The message says what it needs."""


class StoppedError(Error, RuntimeError):
    """The work was cancelled. A job on files can be continued by the same call."""


class InternalError(Error, RuntimeError):
    """The package is at fault. Please report the message."""
