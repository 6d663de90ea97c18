"""Points in memory."""

from __future__ import annotations

import json
import math
import operator
from typing import Any, Literal, SupportsFloat, SupportsIndex, TypeAlias

from . import _lloydar
from ._errors import OptionError
from ._points import read
from ._resampled import Resampled
from ._tasks import ProgressOption, follow

__all__ = ["Acceleration", "Patch", "SeedRule", "resample"]

SeedRule: TypeAlias = Literal["hexagonal", "poisson", "area", "random"]
Acceleration: TypeAlias = Literal["none", "relaxation", "anderson", "anderson-global"]
Patch: TypeAlias = Literal["quadratic", "plane"]


def resample(
    points: Any,
    *,
    spacing: SupportsFloat | None = None,
    count: SupportsIndex | None = None,
    ratio: SupportsFloat | None = None,
    exact: bool = False,
    iterations: SupportsIndex | None = None,
    accelerate: Acceleration | None = None,
    seeds: SeedRule | None = None,
    patch: Patch | None = None,
    smooth: SupportsFloat | None = None,
    fill: SupportsFloat | None = None,
    restrict: SupportsFloat | None = None,
    seed: SupportsIndex | None = None,
    scale: SupportsFloat | None = None,
    threads: SupportsIndex | None = None,
    progress: ProgressOption = False,
) -> Resampled:
    """Moves points to even positions on the surfaces that they were scanned from.

    The result depends neither on the order of the points nor on the number of threads. It is that of `run` on
    a file with the same points and the same scale. It takes some 150 bytes for each input point and 2 KB for
    each output point while it works; other Python threads go on meanwhile.

    Parameters
    ----------
    points : array_like of shape (n, 3), structured array, laspy.LasData, open3d PointCloud or pandas.DataFrame
        Positions, in any unit of length. float64 and float32 in any memory layout are read as they are, other
        numbers as float64. Structured arrays and data frames have columns X, Y, Z (the names of PDAL) or x, y, z.
    spacing : float, optional
        Distance between neighbouring output points, in the unit of the points: the edge of the hexagonal lattice
        with as many points to the area. One of `spacing`, `count` and `ratio` must be given.
    count : int, optional
        Number of output points, met within 0.3 %.
    ratio : float, optional
        Number of output points for each input point, met as nearly: 0.02 keeps one in fifty.
    exact : bool, default False
        Meet `count` or `ratio` exactly.
    iterations : int, default 20
        Lloyd iterations.
    accelerate : {"relaxation", "none", "anderson", "anderson-global"}, optional
        How centroids are extrapolated to the next positions.
    seeds : {"hexagonal", "poisson", "area", "random"}, optional
        How the seeds are chosen.
    patch : {"quadratic", "plane"}, optional
        The surface that is fitted around each point.
    smooth : float, optional
        Radius of the surface fit, 1.2 spacings by default. A larger one smooths noise away first, a smaller one
        keeps finer detail.
    fill : float, optional
        Width of the widest hole to close, 0 for none; four spacings by default.
    restrict : float, optional
        How far from the nearest input point an output point may lie; by default the spacing of the input there.
    seed : int, default 0
        Seed of every random choice. Other seeds give other points that are as even.
    scale : float, optional
        Step of the grid to which coordinates are rounded first; by default that of laspy's records, or a power
        of ten below a five-thousandth of the spacing.
    threads : int, optional
        Threads that work, at most 1024; one per core by default.
    progress : bool or callable, default False
        ``True`` shows a bar of tqdm if it is installed; a callable is called with a `Progress`.

    Returns
    -------
    Resampled
        Positions, indices of the nearest input points, normals, areas, curvatures, figures of uniformity.

    Raises
    ------
    InputError
        If there are no points, the shape is wrong, or a coordinate is not finite; `index` is that of the point.
    OptionError
        If an option is out of its range.
    RequestError
        If the points do not carry what is requested: a spacing too wide or too fine, a count too high.

    Examples
    --------
    >>> import numpy as np, lloydar
    >>> x, y = np.meshgrid(np.linspace(0, 2, 200), np.linspace(0, 2, 200))
    >>> scan = np.column_stack([x.ravel(), y.ravel(), 0.1 * np.sin(3 * x.ravel())])
    >>> even = lloydar.resample(scan, spacing=0.1)
    >>> even.points.shape[1], bool(even.uniformity["cell_area_cv"] < 0.1)
    (3, True)
    """
    cloud = read(points)
    lengths = {"spacing": spacing, "ratio": ratio, "smooth": smooth, "fill": fill}
    lengths |= {"restrict": restrict, "scale": cloud.scale if scale is None else scale}
    options: dict[str, Any] = {
        name: float(value) for name, value in lengths.items() if value is not None
    }
    if count is not None:
        options["count"] = _whole("count", count, 2**63)
    if exact:
        options["exact"] = True
    if seed is not None:
        options["seed"] = _whole("seed", seed, 2**63)
    if iterations is not None:
        options["iterations"] = _whole("iterations", iterations, 2**32)
    names = {"accelerate": accelerate, "seeds": seeds, "patch": patch}
    options |= {name: value for name, value in names.items() if value is not None}
    given = {"spacing", "count", "ratio"} & options.keys()
    if len(given) != 1:
        raise OptionError(f"give one of spacing, count and ratio ({len(given)} given)")
    workers = None if threads is None else _whole("threads", threads, 2**32)
    task = _lloydar.resample(cloud.positions, options, threads=workers)
    fields = follow(task, progress)
    fields["uniformity"] = _figures(fields["uniformity"])
    return Resampled(cloud, fields)


def _whole(option: str, value: SupportsIndex, limit: int) -> int:
    """Returns `value` as an integer, if it is one from 0 to below `limit`."""
    number = operator.index(value)
    if not 0 <= number < limit:
        raise OptionError(f"{option} {number}: must be from 0 to {limit - 1}", option)
    return number


def _figures(text: str) -> dict[str, float]:
    """Figures from JSON, where a figure of nothing is null."""
    figures = json.loads(text)
    return {name: math.nan if value is None else value for name, value in figures.items()}
