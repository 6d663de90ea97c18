"""The system's allocator, made to return freed memory where a job has a budget.

The C library of most Linux systems keeps freed pieces of up to 32 MiB for every thread that allocated some: a job
with 256 MiB took 280. A fixed limit ends that. The program sets it in the environment and starts itself once more;
within a process that is not its own, it is set by a call.
"""

from __future__ import annotations

import ctypes
import sys

__all__ = ["return_freed_memory"]

#: M_MMAP_THRESHOLD of malloc.h: larger pieces are mapped, and unmapped when they are freed.
_MMAP_THRESHOLD = -3
#: The limit of the program, in bytes.
_LIMIT = 4 << 20


def return_freed_memory() -> None:
    """Sets the limit, where the C library has one. Other allocators return freed memory by themselves."""
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_MMAP_THRESHOLD, _LIMIT)
