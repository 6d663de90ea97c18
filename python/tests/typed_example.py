"""An example that mypy checks in its strict mode; it is not run."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

import lloydar


def show(progress: lloydar.Progress) -> None:
    print(progress.stage, progress.share)


def intensities(scan: npt.NDArray[np.float64], values: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
    even: lloydar.Resampled = lloydar.resample(scan, count=np.int64(50_000), progress=show)
    delta: float = even.uniformity["delta"]
    neighbors, is_closed = even.ring(0)
    print(delta, even.points[neighbors], is_closed)
    return values[even.source]


def job(scans: list[Path]) -> int:
    try:
        report = lloydar.run(scans, "even.copc.laz", spacing="5cm", memory="4GiB", with_=["normals"])
    except lloydar.InputError as error:
        print(error.files, error.index)
        return 0
    plan = lloydar.plan("scans/*.laz", spacing=0.05, keep_class=(2, 6))
    measured = lloydar.measure(report.output, against=scans)
    print(plan and plan.seconds, measured.accuracy, report.page.name)
    return report.points
