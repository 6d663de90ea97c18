"""Arrays of every kind give the same cloud, and errors say which point and where."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from conftest import sheet, sphere

import lloydar

SCAN = sheet(120)
EVEN = lloydar.resample(SCAN, spacing=0.1)


def same(cloud: lloydar.Resampled) -> bool:
    return np.array_equal(cloud.points, EVEN.points) and np.array_equal(cloud.source, EVEN.source)


def test_shapes_and_types_are_as_documented() -> None:
    count = len(EVEN)
    assert EVEN.points.shape == EVEN.normals.shape == (count, 3)
    assert EVEN.source.shape == EVEN.area.shape == EVEN.curvature.shape == (count,)
    assert EVEN.points.dtype == EVEN.area.dtype == np.float64
    assert EVEN.source.dtype == np.intp
    assert EVEN.spacing == 0.1
    assert EVEN.uniformity["cell_area_cv"] < 0.1
    assert np.asarray(EVEN) is EVEN.points


@pytest.mark.parametrize(
    "form",
    [
        np.asfortranarray,
        lambda scan: np.repeat(scan, 2, axis=0)[::2],
        lambda scan: np.column_stack([scan, scan])[:, :3],
        lambda scan: scan[::-1].copy()[::-1],
        lambda scan: scan.astype(">f8"),
        lambda scan: np.ndarray(scan.shape, scan.dtype, b"x" + scan.tobytes(), offset=1),
        lambda scan: scan.tolist(),
        lambda scan: scan.view(np.matrix),
    ],
    ids=["fortran", "strided", "columns", "negative", "big-endian", "unaligned", "list", "matrix"],
)
@pytest.mark.filterwarnings("ignore:the matrix subclass")
def test_the_layout_of_an_array_does_not_matter(form) -> None:
    assert same(lloydar.resample(form(SCAN), spacing=0.1))


def test_a_read_only_array_is_read_and_no_array_is_changed() -> None:
    scan = SCAN.copy()
    scan.flags.writeable = False
    assert same(lloydar.resample(scan, spacing=0.1))
    assert np.array_equal(scan, SCAN)


def test_single_precision_is_read_as_it_is() -> None:
    single = SCAN.astype(np.float32)
    cloud = lloydar.resample(single, spacing=0.1)
    assert np.array_equal(cloud.points, lloydar.resample(single.astype(float), spacing=0.1).points)


def test_integers_are_read_as_numbers() -> None:
    grid = np.array([[x, y, 0] for x in range(40) for y in range(40)])
    cloud = lloydar.resample(grid, spacing=4)
    assert np.array_equal(cloud.points, lloydar.resample(grid.astype(float), spacing=4).points)


def test_the_order_of_points_and_the_threads_do_not_matter() -> None:
    order = np.random.default_rng(1).permutation(len(SCAN))
    cloud = lloydar.resample(SCAN[order], spacing=0.1, threads=3)
    assert np.array_equal(cloud.points, EVEN.points)
    assert np.array_equal(order[cloud.source], EVEN.source)


def test_the_source_is_the_nearest_point() -> None:
    apart = np.linalg.norm(EVEN.points[:, None] - SCAN[None], axis=2)
    assert np.allclose(apart[np.arange(len(EVEN)), EVEN.source], apart.min(axis=1))


def test_a_sphere_has_its_area_and_its_normals() -> None:
    even = lloydar.resample(sphere(30_000), count=2000)
    assert abs(len(even) - 2000) < 60
    assert even.area.sum() == pytest.approx(4 * np.pi, rel=0.01)
    assert np.abs(np.sum(even.normals * even.points, axis=1)).min() > 0.99
    neighbors, is_closed = even.ring(0)
    assert is_closed and len(neighbors) >= 3
    assert 0 in even.ring(neighbors[0])[0]
    assert np.array_equal(even.ring(-len(even))[0], neighbors)
    with pytest.raises(IndexError):
        even.ring(len(even))


def test_arrays_own_their_memory_without_a_copy() -> None:
    cloud = lloydar.resample(SCAN, spacing=0.1)
    points, source = cloud.points, cloud.source
    assert points.base is not None and source.base is not None and points.flags.writeable
    gone = weakref.ref(cloud)
    del cloud
    gc.collect()
    assert gone() is None
    assert np.array_equal(points, EVEN.points) and np.array_equal(source, EVEN.source)


def test_every_option_is_passed_on() -> None:
    others = {
        "iterations": 3,
        "accelerate": "none",
        "seeds": "poisson",
        "patch": "plane",
        "smooth": 0.3,
        "restrict": 0.001,
        "seed": 7,
        "scale": 0.01,
    }
    for option, value in others.items():
        cloud = lloydar.resample(SCAN, spacing=0.1, **{option: value})
        assert not same(cloud), option
    with_hole = SCAN[np.linalg.norm(SCAN[:, :2] - 1, axis=1) > 0.15]
    filled = [len(lloydar.resample(with_hole, spacing=0.1, fill=width)) for width in (0, 0.5)]
    assert filled[0] < filled[1]
    assert [len(lloydar.resample(SCAN, count=count, exact=True)) for count in (321, 543)] == [321, 543]


def test_it_says_what_it_is() -> None:
    assert repr(EVEN).startswith(f"<lloydar.Resampled: {len(EVEN):,} of 14,400 points")
    page = EVEN._repr_html_()
    assert page.count("<circle") == len(EVEN) and "energy ratio" in page


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e13])
def test_a_wrong_coordinate_is_named_by_its_index(value: float) -> None:
    scan = SCAN.copy()
    scan[[77, 99], [1, 2]] = value
    with pytest.raises(ValueError, match="point 77: ") as raised:
        lloydar.resample(scan, spacing=0.1)
    assert isinstance(raised.value, lloydar.InputError) and raised.value.index == 77


@pytest.mark.parametrize(
    "points",
    [[], np.empty((0, 3)), np.zeros(3), np.zeros((5, 2)), np.zeros((3, 5)), np.zeros((2, 5, 3)), 1.0],
    ids=str,
)
def test_a_wrong_shape_is_named(points: object) -> None:
    with pytest.raises(lloydar.InputError, match="shape|no points") as raised:
        lloydar.resample(points, spacing=1)
    assert isinstance(raised.value, ValueError)


@pytest.mark.parametrize("points", [None, "scan.laz", [["a", "b", "c"]], np.zeros((4, 3), complex), {}])
def test_what_is_no_number_is_a_type_error(points: object) -> None:
    with pytest.raises((TypeError, lloydar.InputError)):
        lloydar.resample(points, spacing=1)


def test_one_point_and_equal_points_are_answered() -> None:
    for scan in (np.ones((1, 3)), np.ones((1000, 3))):
        with pytest.raises(ValueError, match="equal") as raised:
            lloydar.resample(scan, count=10)
        assert isinstance(raised.value, lloydar.RequestError)
        cloud = lloydar.resample(scan, spacing=1)
        assert np.allclose(cloud.points, 1) and len(cloud) == 1
        assert cloud.uniformity["delta"] != cloud.uniformity["delta"]
        assert "nan" in repr(cloud) and cloud._repr_html_()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "give one of spacing, count and ratio \\(0 given\\)"),
        ({"spacing": 1, "count": 5}, "\\(2 given\\)"),
        ({"spacing": 0}, "spacing 0: must be a length above zero"),
        ({"spacing": float("nan")}, "spacing NaN"),
        ({"ratio": -1}, "ratio -1"),
        ({"count": -1}, "count -1: must be from 0"),
        ({"count": 0}, "count 0"),
        ({"spacing": 0.1, "seeds": "best"}, "seeds best: .*hexagonal"),
        ({"spacing": 0.1, "patch": "cubic"}, "patch cubic: .*quadratic"),
        ({"spacing": 0.1, "accelerate": "yes"}, "accelerate yes: .*relaxation"),
        ({"spacing": 0.1, "iterations": 1001}, "iterations 1001"),
        ({"spacing": 0.1, "threads": 0}, "threads 0"),
        ({"spacing": 0.1, "threads": 100_000}, "threads 100000"),
        ({"spacing": 0.1, "seed": -1}, "seed -1"),
        ({"spacing": 0.1, "smooth": -0.1}, "smooth -0.1"),
        ({"spacing": 0.1, "scale": 0}, "scale 0"),
    ],
    ids=str,
)
def test_an_option_out_of_range_is_named(options: dict[str, object], said: str) -> None:
    with pytest.raises(lloydar.OptionError, match=said) as raised:
        lloydar.resample(SCAN, **options)
    assert isinstance(raised.value, ValueError)


@pytest.mark.parametrize("options", [{"spacing": "wide"}, {"count": 1.5}, {"spacing": 1, "color": 1}])
def test_an_option_of_the_wrong_type_is_a_type_error(options: dict[str, object]) -> None:
    with pytest.raises((TypeError, ValueError)):
        lloydar.resample(SCAN, **options)


def test_a_request_that_the_points_do_not_carry_is_refused_with_the_numbers() -> None:
    with pytest.raises(lloydar.RequestError, match="spacing 5 is too wide.*2"):
        lloydar.resample(SCAN, spacing=5)
    with pytest.raises(lloydar.RequestError, match="count 1000000 is more than 14400"):
        lloydar.resample(SCAN, count=1_000_000)


def test_triangles_of_a_sphere_are_watertight() -> None:
    k = np.arange(40_000)
    z = 1 - (2 * k + 1) / len(k)
    turn, wide = k * np.pi * (3 - 5**0.5), np.sqrt(1 - z * z)
    even = lloydar.resample(np.column_stack([wide * np.cos(turn), wide * np.sin(turn), z]), spacing=0.1)
    triangles = even.triangles
    assert triangles.dtype == np.uint32 and triangles.shape[1] == 3
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all()
    assert len(even) - len(counts) + len(triangles) == 2
    a, b, c = (even.points[triangles[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a) * a).sum(axis=1).min() > 0, "outwards"
    assert even.triangles is triangles, "found once"
