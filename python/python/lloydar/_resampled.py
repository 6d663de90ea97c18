"""What `resample` gives."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._errors import InputError
from ._pages import cloud_page
from ._points import Points

if TYPE_CHECKING:
    # Names that exist for type checkers only are private.
    import laspy as _laspy
    import open3d as _open3d
    import pandas as _pandas

__all__ = ["Resampled"]


class Resampled:
    """An even cloud in memory. All arrays have one row for each output point, in the same order.

    The arrays own the memory in which the points were computed; nothing was copied.

    Attributes
    ----------
    points : numpy.ndarray
        Positions, shape (m, 3), float64, in the unit of the input.
    source : numpy.ndarray
        Index of the input point nearest to each output point, shape (m,): ``colors[even.source]`` takes any
        attribute along.
    normals : numpy.ndarray
        Unit normals of the surface with z ≥ 0, shape (m, 3); NaN where the input describes no surface.
    area : numpy.ndarray
        Areas of the Voronoi cells on the surface, in square units, shape (m,); NaN at borders, and where the
        input describes no surface.
    curvature : numpy.ndarray
        Mean curvatures in 1 / unit, shape (m,), positive where the surface bends towards the normal; NaN where
        the input describes no surface.
    uniformity : dict
        How evenly the points are spread: ``delta`` (deviation of the nearest distances over their mean),
        ``energy_ratio`` (1 for the hexagonal lattice), ``packing``, ``cell_area_cv`` and others.
    spacing : float
        The spacing of the output: the requested one, or the one found for a count or a ratio.
    """

    def __init__(self, origin: Points, fields: dict[str, Any]) -> None:
        # The positions of the input are not kept, only what gives its attributes.
        self._points_in = len(origin)
        self._pick, self._fields_at = origin.pick, origin.fields
        self._rings = fields["rings"]
        self.points: npt.NDArray[np.float64] = fields["points"]
        # Indices with a sign are what numpy's own functions expect.
        self.source: npt.NDArray[np.intp] = fields["source"].view(np.intp)
        self.normals: npt.NDArray[np.float64] = fields["normals"]
        self.area: npt.NDArray[np.float64] = fields["area"]
        self.curvature: npt.NDArray[np.float64] = fields["curvature"]
        self.uniformity: dict[str, float] = fields["uniformity"]
        self.spacing: float = fields["spacing"]

    def __len__(self) -> int:
        return len(self.points)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if copy is True:
            return np.array(self.points, dtype=dtype)
        return np.asarray(self.points, dtype=dtype)

    def __repr__(self) -> str:
        figures = self.uniformity
        return (
            f"<lloydar.Resampled: {len(self):,} of {self._points_in:,} points, "
            f"spacing {self.spacing:.4g}, delta {figures['delta']:.3f}, "
            f"energy ratio {figures['energy_ratio']:.4f}>"
        )

    def _repr_html_(self) -> str:
        return cloud_page(self, self._points_in)

    @cached_property
    def records(self) -> Any:
        """The output in the form of the input, with every attribute of the nearest input point.

        A structured array for a structured array or a data frame, a `laspy.LasData` for records of laspy, the
        positions for an array. Numbers of returns are 1 of 1: no pulse returned these points.
        """
        return self._pick(self.source, self.points)

    @cached_property
    def triangles(self) -> npt.NDArray[np.uint32]:
        """Triangles between the output points, by their indices, shape (t, 3): a mesh of the surfaces.

        No edge has more than two triangles, narrow holes are closed, and points where the input describes no
        surface have none. Corners run counter-clockwise as seen from the side that a triangle looks to: upwards, or
        outwards where a piece of the mesh encloses a volume. It is the mesh that `run` writes for the same points,
        found when it is first asked for.
        """
        triangles: npt.NDArray[np.uint32] = self._rings.triangles(self.points, self.normals)
        return triangles

    def ring(self, index: int) -> tuple[npt.NDArray[np.uint32], bool]:
        """Returns the neighbours of an output point.

        Parameters
        ----------
        index : int
            The output point.

        Returns
        -------
        neighbors : numpy.ndarray
            Indices of the output points whose Voronoi cells share an edge with that of the point,
            counter-clockwise seen from the tip of the normal; empty where the input describes no surface.
        is_closed : bool
            Whether neighbours bound the cell all around; otherwise the point lies at a border.
        """
        if not -len(self) <= index < len(self):
            raise IndexError(f"index {index} is out of bounds for {len(self)} points")
        neighbors, is_closed = self._rings.of(index % len(self))
        return neighbors, is_closed

    def to_pandas(self) -> _pandas.DataFrame:
        """Returns a data frame: positions, attributes of the nearest input points, and what was computed.

        Returns
        -------
        pandas.DataFrame
            Columns x, y, z, the attributes under their names in the input, normal_x, normal_y, normal_z, area,
            curvature and source. An attribute of several values has a column for each, with its number behind the
            name: rgb_0, rgb_1, rgb_2. What was computed replaces attributes of the same name.
        """
        import pandas

        columns: dict[str, npt.NDArray[Any]] = dict(zip("xyz", self.points.T, strict=True))
        for name, values in self._fields().items():
            # Rows of values are one column each.
            several = values.reshape(len(values), -1).T if values.ndim > 1 else ()
            columns.update({f"{name}_{number}": column for number, column in enumerate(several)} or {name: values})
        columns.update(zip(("normal_x", "normal_y", "normal_z"), self.normals.T, strict=True))
        columns.update(area=self.area, curvature=self.curvature, source=self.source)
        return pandas.DataFrame(columns)

    def to_open3d(self) -> _open3d.geometry.PointCloud:
        """Returns a cloud of Open3D with positions, normals, and colours if the input has them.

        Returns
        -------
        open3d.geometry.PointCloud
            Points without a surface have the normal 0, 0, 0.
        """
        import open3d

        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(self.points))
        cloud.normals = open3d.utility.Vector3dVector(np.nan_to_num(self.normals))
        fields = {name.lower(): values for name, values in self._fields().items()}
        if {"red", "green", "blue"} <= fields.keys():
            colors = np.column_stack([fields[name] for name in ("red", "green", "blue")])
            # Many writers put colours of eight bits into fields of sixteen.
            largest = 255 if colors.max(initial=0) <= 255 else 65_535
            cloud.colors = open3d.utility.Vector3dVector(colors / largest)
        return cloud

    def to_laspy(self, scale: float | None = None) -> _laspy.LasData:
        """Returns a cloud of laspy with every attribute of the nearest input points.

        Parameters
        ----------
        scale : float, optional
            The step of the coordinates, for input that did not come from laspy; a power of ten below a
            thousandth of the spacing by default.

        Returns
        -------
        laspy.LasData
            For records of laspy the same format, scale, offset and CRS. Otherwise of point format 7, with
            attributes under the names of PDAL or laspy in their fields, and others as extra dimensions.

        Raises
        ------
        InputError
            If an attribute is no number, or has a value that its field of a LAS record cannot have.
        """
        import laspy

        if isinstance(self.records, laspy.LasData):
            return self.records
        header = laspy.LasHeader(version="1.4", point_format=7)
        step = scale or 10.0 ** math.floor(math.log10(self.spacing / 1000))
        header.scales = np.full(3, step)
        header.offsets = np.floor(self.points.min(axis=0, initial=0))
        fields = {_name_in_las(name): values for name, values in self._fields().items()}
        standard = set(header.point_format.dimension_names)
        for name, values in fields.items():
            if name not in standard and name != "scan_angle_rank":
                header.add_extra_dim(laspy.ExtraBytesParams(name=name, type=_extra_type(name, values)))
        las = laspy.LasData(header)
        las.x, las.y, las.z = self.points.T
        for name, values in fields.items():
            if name == "scan_angle_rank":
                # From format 6 on angles are in steps of 0.006 degrees.
                las.scan_angle = np.rint(values / 0.006).astype(np.int16)
            else:
                _set_exactly(las, name, values)
        las.return_number[:] = las.number_of_returns[:] = 1
        return las

    def _fields(self) -> dict[str, npt.NDArray[Any]]:
        return self._fields_at(self.source)


def _extra_type(name: str, values: npt.NDArray[Any]) -> str:
    """The type of an extra dimension with these values, one or up to three in each row."""
    kind, count = values.dtype, math.prod(values.shape[1:])
    if kind.kind not in "iuf" or kind.itemsize == 2 and kind.kind == "f" or kind.itemsize > 8 or not 1 <= count <= 3:
        raise InputError(f"attribute {name!r} ({kind}, shape {values.shape}) is no extra dimension of a LAS file")
    return f"{count}{kind.kind}{kind.itemsize}" if values.ndim > 1 else f"{kind.kind}{kind.itemsize}"


def _set_exactly(las: _laspy.LasData, name: str, values: npt.NDArray[Any]) -> None:
    """Sets a dimension to values, all of which it must be able to have."""
    try:
        las[name] = values
        fits = np.array_equal(np.asarray(las[name]), values, equal_nan=values.dtype.kind == "f")
    except (OverflowError, ValueError):
        fits = False
    if not fits:
        span = f"from {values.min()} to {values.max()}"
        raise InputError(f"attribute {name!r} has values {span}, which its field of a LAS record cannot have")


def _name_in_las(name: str) -> str:
    """The name that laspy has for a dimension of PDAL: ``PointSourceId`` is ``point_source_id``."""
    if not name.isascii() or len(name) > 32:
        raise InputError(f"attribute {name!r} has no name of at most 32 ASCII letters")
    words = "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name)
    return {"_infrared": "nir"}.get(words, words.lstrip("_"))
