"""Points as others have them: arrays, structured arrays, records of laspy, clouds of Open3D, data frames.

Whatever comes in is read as one array of positions, and remembers how to give the attributes of chosen
points back in the form in which they came.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import InputError

__all__ = ["Points", "read"]


@dataclass(frozen=True)
class Points:
    """Points that were read.

    Attributes
    ----------
    positions : numpy.ndarray
        Shape (n, 3), float64 or float32, aligned and in native order; a view where that is possible.
    scale : float or None
        The step of the grid on which the coordinates lie, if they have one.
    pick : callable
        Gives, for indices of points and new positions, the points in the form of the input, with all
        attributes.
    fields : callable
        Gives all attributes of the points at some indices by name, without the positions.
    """

    positions: npt.NDArray[Any]
    scale: float | None
    pick: Callable[[npt.NDArray[np.intp], npt.NDArray[np.float64]], Any]
    fields: Callable[[npt.NDArray[np.intp]], dict[str, npt.NDArray[Any]]]

    def __len__(self) -> int:
        return len(self.positions)


def read(points: Any) -> Points:
    """Reads points in any of the supported forms.

    Raises
    ------
    InputError
        If the shape is wrong, or a coordinate is missing or masked.
    TypeError
        If the values are no real numbers.
    """
    package = type(points).__module__.partition(".")[0]
    if package == "laspy":
        return _of_laspy(points)
    if package == "open3d":
        points = _of_open3d(points)
    if package == "pandas":
        points = points.to_records(index=False)
    if isinstance(points, np.ma.MaskedArray) and np.ma.is_masked(points):
        raise InputError("points has masked values: give the rows without them, such as numpy.ma.compress_rows(points)")
    array = np.asarray(points)
    if array.dtype.names is not None:
        return _of_structured(array)
    return Points(
        positions=_positions(array),
        scale=None,
        pick=lambda _, positions: positions,
        fields=lambda _: {},
    )


def _positions(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Checks shape and type; float64 and float32 stay as they are, other numbers become float64."""
    if array.ndim != 2 or array.shape[1] != 3:
        empty = "; there are no points" if array.size == 0 else ""
        raise InputError(f"points has shape {array.shape}: must be (n, 3){empty}")
    if array.dtype.kind not in "fiu":
        raise TypeError(f"points has dtype {array.dtype}: must be of real numbers")
    if array.dtype not in (np.float64, np.float32):
        array = array.astype(np.float64)
    # Columns of structured arrays, or bytes of a file, may lie at any address.
    return array if array.flags.aligned else array.copy()


def _of_structured(array: npt.NDArray[Any]) -> Points:
    """Structured arrays, with the coordinates under the names of PDAL or in lower case."""
    flat = np.asarray(array).reshape(-1)
    names = flat.dtype.names or ()
    axes = next((axes for axes in (tuple("XYZ"), tuple("xyz")) if set(axes) <= set(names)), None)
    if axes is None:
        raise InputError(f"points has fields {', '.join(names)}: must have X, Y and Z")
    columns = [np.asarray(flat[axis], dtype=np.float64) for axis in axes]

    def pick(source: npt.NDArray[np.intp], positions: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        picked = flat[source]
        for axis, values in zip(axes, positions.T, strict=True):
            whole = picked.dtype[axis].kind in "iu"
            picked[axis] = np.rint(values) if whole else values
        _set_single_return(picked, names)
        return picked

    def fields(source: npt.NDArray[np.intp]) -> dict[str, npt.NDArray[Any]]:
        picked = flat[source]
        _set_single_return(picked, names)
        return {name: picked[name] for name in names if name not in axes}

    return Points(np.column_stack(columns), None, pick, fields)


#: Names of the number of a return and of the returns of its pulse: of PDAL, and of laspy.
_RETURNS = ("ReturnNumber", "NumberOfReturns", "return_number", "number_of_returns")


def _set_single_return(picked: Any, names: Iterable[str]) -> None:
    """No pulse returned a point of the output: it is return 1 of 1, as in the files of the program."""
    for name in _RETURNS:
        if name in names:
            picked[name] = np.ones(len(picked), dtype=np.uint8)


def _of_laspy(las: Any) -> Points:
    """A `laspy.LasData`, or its points."""
    import laspy

    record = las.points if isinstance(las, laspy.LasData) else las
    if not isinstance(record, laspy.ScaleAwarePointRecord):
        raise TypeError(f"points is a {type(las).__name__}: give laspy.LasData or its points")
    names = [name for name in record.point_format.dimension_names if name not in tuple("XYZ")]

    def pick(source: npt.NDArray[np.intp], positions: npt.NDArray[np.float64]) -> laspy.LasData:
        if isinstance(las, laspy.LasData):
            picked = laspy.LasData(copy.deepcopy(las.header), points=record[source])
        else:
            header = laspy.LasHeader(version="1.4", point_format=record.point_format)
            header.scales, header.offsets = record.scales, record.offsets
            picked = laspy.LasData(header, points=record[source])
        picked.x, picked.y, picked.z = positions.T
        _set_single_return(picked, names)
        picked.update_header()
        return picked

    def fields(source: npt.NDArray[np.intp]) -> dict[str, npt.NDArray[Any]]:
        picked = record[source]
        _set_single_return(picked, names)
        return {name: np.asarray(picked[name]) for name in names}

    columns = [np.asarray(axis, dtype=np.float64) for axis in (record.x, record.y, record.z)]
    return Points(np.column_stack(columns), float(np.min(record.scales)), pick, fields)


def _of_open3d(cloud: Any) -> npt.NDArray[Any]:
    """A cloud of Open3D: legacy, or a tensor."""
    if hasattr(cloud, "points"):
        return np.asarray(cloud.points)
    if hasattr(cloud, "point"):
        return np.asarray(cloud.point.positions.cpu().numpy())
    raise TypeError(f"points is a {type(cloud).__name__}: give a PointCloud")
