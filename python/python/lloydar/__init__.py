"""Laser scans to evenly spaced points.

There are two doors:

* `resample` takes points in memory and gives points in memory, as numpy arrays;
* `run` takes files of any size and writes one cloud, within a memory budget; it continues after it was killed.

`plan` says what a run would take, `measure` how even a cloud is, `info` what is in the headers of scans;
`simulate` makes a street to try everything on, and `render` draws clouds.

Notes are logged under the name ``lloydar``. All exceptions are `Error`; those about values are `ValueError`, too.
"""

from ._errors import (
    Error,
    InputError,
    InternalError,
    OptionError,
    OutputError,
    RequestError,
    ResourceError,
    StoppedError,
)
from ._files import JobOptions, info, measure, plan, render, run, simulate
from ._lloydar import __version__
from ._memory import resample
from ._records import Measured, Plan, Record, Report
from ._resampled import Resampled
from ._tasks import Progress

__all__ = [
    "Error",
    "InputError",
    "InternalError",
    "JobOptions",
    "Measured",
    "OptionError",
    "OutputError",
    "Plan",
    "Progress",
    "Record",
    "Report",
    "RequestError",
    "Resampled",
    "ResourceError",
    "StoppedError",
    "__version__",
    "info",
    "measure",
    "plan",
    "render",
    "resample",
    "run",
    "simulate",
]
