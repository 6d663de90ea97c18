"""Attributes come back: structured arrays, data frames, records of laspy, clouds of Open3D."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np
import pandas
import pytest
from conftest import sheet

import lloydar

SCAN = sheet(100)
EVEN = lloydar.resample(SCAN, spacing=0.1)


def pdal_array() -> np.ndarray:
    """An array as PDAL has them."""
    kinds = [("X", "f8"), ("Y", "f8"), ("Z", "f8"), ("Intensity", "u2"), ("ReturnNumber", "u1")]
    kinds += [("NumberOfReturns", "u1"), ("Classification", "u1"), ("ScanAngleRank", "f4")]
    kinds += [("PointSourceId", "u2"), ("GpsTime", "f8"), ("Red", "u2"), ("Green", "u2")]
    kinds += [("Blue", "u2"), ("Amplitude", "f4")]
    array = np.zeros(len(SCAN), kinds)
    array["X"], array["Y"], array["Z"] = SCAN.T
    array["Intensity"] = np.arange(len(SCAN)) % 60_000
    array["ReturnNumber"], array["NumberOfReturns"] = 2, 3
    array["GpsTime"] = np.arange(len(SCAN))
    array["Amplitude"] = np.linspace(0, 1, len(SCAN))
    array["Red"] = 65_535
    array["ScanAngleRank"] = -12
    return array


def test_a_structured_array_comes_back_with_every_attribute() -> None:
    scan = pdal_array()
    cloud = lloydar.resample(scan, spacing=0.1)
    assert np.array_equal(cloud.points, EVEN.points)
    even = cloud.records
    assert even.dtype == scan.dtype
    assert np.array_equal(np.column_stack([even["X"], even["Y"], even["Z"]]), cloud.points)
    for name in ("Intensity", "GpsTime", "Amplitude", "Red", "Classification"):
        assert np.array_equal(even[name], scan[name][cloud.source])
    assert (even["ReturnNumber"] == 1).all() and (even["NumberOfReturns"] == 1).all()
    assert (scan["ReturnNumber"] == 2).all(), "the input is not changed"


def test_names_in_lower_case_packed_and_of_integers_are_read() -> None:
    scan = np.zeros(len(SCAN), [("label", "i1"), ("x", "f4"), ("y", "f4"), ("z", "f4")])
    for axis, values in zip("xyz", SCAN.T, strict=True):
        scan[axis] = values
    cloud = lloydar.resample(scan, spacing=0.1)
    assert cloud.records.dtype == scan.dtype
    assert np.allclose(cloud.records["x"], cloud.points[:, 0])
    whole = np.zeros(1600, [("X", "i4"), ("Y", "i4"), ("Z", "i4")])
    whole["X"], whole["Y"] = np.arange(1600) % 40, np.arange(1600) // 40
    cloud = lloydar.resample(whole, spacing=4)
    assert np.array_equal(cloud.records["X"], np.rint(cloud.points[:, 0]))


def test_a_structured_array_without_coordinates_is_refused() -> None:
    with pytest.raises(lloydar.InputError, match="fields X, Y, Intensity: must have X, Y and Z"):
        lloydar.resample(np.zeros(5, [("X", "f8"), ("Y", "f8"), ("Intensity", "u2")]), spacing=1)


def test_a_data_frame_is_read_and_written() -> None:
    frame = pandas.DataFrame({"X": SCAN[:, 0], "Y": SCAN[:, 1], "Z": SCAN[:, 2], "label": 7})
    cloud = lloydar.resample(frame, spacing=0.1)
    assert np.array_equal(cloud.points, EVEN.points)
    even = cloud.to_pandas()
    assert list(even.columns[:4]) == ["x", "y", "z", "label"]
    assert (even.label == 7).all() and len(even) == len(cloud)
    assert np.array_equal(even.source, cloud.source)
    assert np.array_equal(even.normal_z, cloud.normals[:, 2], equal_nan=True)


def test_records_of_laspy_come_back_with_every_attribute(street: list[Path]) -> None:
    las = laspy.read(street[0])
    las.add_extra_dim(laspy.ExtraBytesParams("reflectance", np.float32))
    las.reflectance = np.linspace(0, 9, len(las.points))
    before = las.points.array.copy()
    cloud = lloydar.resample(las, spacing=0.4)
    even = cloud.to_laspy()
    assert np.array_equal(las.points.array, before)
    assert len(even.points) == len(cloud) == even.header.point_count
    assert np.abs(even.xyz - cloud.points).max() <= 0.5001 * las.header.scales.max()
    returns = {"X", "Y", "Z", "return_number", "number_of_returns"}
    for name in set(las.point_format.dimension_names) - returns:
        assert np.array_equal(even[name], las[name][cloud.source]), name
    assert (even.return_number == 1).all() and (even.number_of_returns == 1).all()
    crs = [record.string for record in even.header.vlrs.get("WktCoordinateSystemVlr")]
    assert crs and crs == [r.string for r in las.header.vlrs.get("WktCoordinateSystemVlr")]
    assert cloud.records is even
    of_points = lloydar.resample(las.points, spacing=0.4)
    assert np.array_equal(of_points.points, cloud.points)
    assert np.array_equal(of_points.to_laspy().gps_time, even.gps_time)
    assert {"x", "intensity", "reflectance"} <= set(cloud.to_pandas().columns)


def test_other_clouds_become_las(tmp_path: Path) -> None:
    cloud = lloydar.resample(pdal_array(), spacing=0.1)
    cloud.to_laspy().write(tmp_path / "even.laz")
    read = laspy.read(tmp_path / "even.laz")
    assert np.abs(read.xyz - cloud.points).max() <= 0.5001 * read.header.scales.max()
    assert np.array_equal(read.intensity, cloud.records["Intensity"])
    assert np.array_equal(read.amplitude, cloud.records["Amplitude"])
    assert (read.red == 65_535).all() and (read.scan_angle == -2000).all()
    assert (read.return_number == 1).all()
    bare = EVEN.to_laspy(scale=0.01)
    assert (bare.header.scales == 0.01).all() and len(bare.points) == len(EVEN)


def test_names_within_those_of_the_axes_are_names() -> None:
    frame = pandas.DataFrame({"x": SCAN[:, 0], "y": SCAN[:, 1], "z": SCAN[:, 2], "xy": 1, "z_": 2})
    even = lloydar.resample(frame, spacing=0.1).to_pandas()
    assert (even["xy"] == 1).all() and (even["z_"] == 2).all()


def test_several_values_of_a_point_have_columns_or_one_dimension() -> None:
    points = np.zeros(len(SCAN), [("x", "f8"), ("y", "f8"), ("z", "f8"), ("shade", "u1", (3,)), ("echo", "f4", (5,))])
    points["x"], points["y"], points["z"] = SCAN.T
    points["shade"] = [7, 8, 9]
    cloud = lloydar.resample(points, spacing=0.1)
    even = cloud.to_pandas()
    assert (even[["shade_0", "shade_1", "shade_2"]] == [7, 8, 9]).all(axis=None) and "echo_4" in even
    with pytest.raises(lloydar.InputError, match="'echo'"):
        cloud.to_laspy()
    las = lloydar.resample(points[["x", "y", "z", "shade"]], spacing=0.1).to_laspy()
    assert (las["shade"] == [7, 8, 9]).all()


UNFIT = [("Classification", 300), ("Intensity", 70_000), ("Red", 0.5), ("note", "a")]


@pytest.mark.parametrize(("name", "value"), UNFIT)
def test_what_a_las_record_cannot_have_is_refused_by_name(name: str, value: object) -> None:
    frame = pandas.DataFrame({"x": SCAN[:, 0], "y": SCAN[:, 1], "z": SCAN[:, 2], name: value})
    cloud = lloydar.resample(frame, spacing=0.1)
    with pytest.raises(lloydar.InputError, match=name.lower()):
        cloud.to_laspy()


def test_masked_points_are_refused() -> None:
    masked = np.ma.array(SCAN, mask=SCAN > SCAN.mean())
    with pytest.raises(lloydar.InputError, match="masked"):
        lloydar.resample(masked, spacing=0.1)


def test_clouds_of_open3d_are_read_and_written() -> None:
    open3d = pytest.importorskip("open3d")
    legacy = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(SCAN))
    assert np.array_equal(lloydar.resample(legacy, spacing=0.1).points, EVEN.points)
    tensor = open3d.t.geometry.PointCloud(SCAN)
    assert np.array_equal(lloydar.resample(tensor, spacing=0.1).points, EVEN.points)
    even = lloydar.resample(pdal_array(), spacing=0.1).to_open3d()
    assert np.array_equal(np.asarray(even.points), EVEN.points)
    assert np.allclose(np.asarray(even.colors), [1, 0, 0])
    assert np.array_equal(np.asarray(even.normals), np.nan_to_num(EVEN.normals))


def test_what_laspy_cannot_be_read_as_is_a_type_error() -> None:
    with pytest.raises(TypeError, match="LasHeader"):
        lloydar.resample(laspy.LasHeader(), spacing=1)
