"""Writes clouds with a place a thousand times denser than the rest, or of leaves alone, and finds spacings for a scan.

    clouds.py write NAME OUT [MILLIONS]          writes one of CLOUDS as LAS
    clouds.py spacings SCAN N                    prints N spacings as JSON, the coarsest first
"""

import json
import math
import sys

import laspy
import numpy

FEWEST, MOST = 50, 4_000_000
# A plane of any direction meets 1.5 voxels, and has 1.15 points of a hexagonal lattice, to the square
# of an edge.
POINTS_PER_VOXEL = 1.155 / 1.5
# The finest voxels are this power of two to the extent.
LEVELS = 14
# The spacings of a cloud without extent.
FALLBACK = 0.001, 5.0


def patch(random, count):
    """Half of the points in 0.3 m × 0.3 m of a plane of 40 m × 40 m."""
    plane = square(random, count // 2, 40.0)
    return numpy.vstack([plane, square(random, count - len(plane), 0.3) + [7.1, -3.3, 0.0]])


def pole(random, count):
    """Half of the points on a pole of 8 m, 0.1 m thick, that stands on a plane of 40 m × 40 m."""
    plane = square(random, count // 2, 40.0)
    rest = count - len(plane)
    angle, height = random.uniform(0, 2 * numpy.pi, rest), random.uniform(0, 8, rest)
    radius = random.normal(0.05, 0.002, rest)
    around = [radius * numpy.cos(angle) + 7.1, radius * numpy.sin(angle) - 3.3, height]
    return numpy.vstack([plane, numpy.column_stack(around)])


def heap(_random, count):
    """All points at one position."""
    return numpy.tile([3.0, 4.0, 5.0], (count, 1))


def heap_on_plane(random, count):
    """Half of the points at one position of a plane of 40 m × 40 m."""
    plane = square(random, count // 2, 40.0)
    return numpy.vstack([plane, numpy.tile([7.1, -3.3, 0.0], (count - len(plane), 1))])


def standing(random, count):
    """A street of 200 m × 20 m between walls of 12 m, from one position 1.8 m above it: rays of even
    angles, so that the foot of the scanner is ten thousand times denser than the ends."""
    rays = 3 * count
    azimuth = random.uniform(0, 2 * numpy.pi, rays)
    elevation = random.uniform(-numpy.pi / 3, numpy.pi / 3, rays)
    east, north = numpy.cos(azimuth), numpy.sin(azimuth)
    slope = numpy.tan(elevation)
    with numpy.errstate(divide="ignore"):
        ground = numpy.where(slope < 0, -1.8 / slope, numpy.inf)
        reach = numpy.minimum(ground, 10.0 / numpy.abs(north))
    points = numpy.column_stack([reach * east, reach * north, 1.8 + reach * slope])
    points = points[(numpy.abs(points[:, 0]) < 100.0) & (points[:, 2] < 12.0)][:count]
    return points + random.normal(0, 0.003, points.shape)


def leaves(random, count):
    """Crowns of trees without trunks: points anywhere in balls of 3 m radius, on no surface."""
    centers = random.uniform([0, 0, 4], [60, 60, 10], (40, 3))
    directions = random.normal(size=(count, 3))
    directions /= numpy.linalg.norm(directions, axis=1)[:, None]
    radii = 3 * random.uniform(0, 1, count) ** (1 / 3)
    return centers[random.integers(len(centers), size=count)] + radii[:, None] * directions


CLOUDS = {cloud.__name__: cloud for cloud in [patch, pole, heap, heap_on_plane, standing, leaves]}


def square(random, count, edge):
    xy = random.uniform(-edge / 2, edge / 2, (count, 2))
    return numpy.column_stack([xy, random.normal(0, 0.002, count)])


def write(name, path, count):
    points = CLOUDS[name](numpy.random.default_rng(2026), count)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.0001] * 3, points.min(axis=0).round()
    scan = laspy.LasData(header)
    scan.x, scan.y, scan.z = points.T
    scan.write(path)


def spacings(path, count):
    """Spacings for evenly spread numbers of points: from 50 to one and a half of the scan's, or four
    million.

    The number of points at a spacing is that of the occupied voxels with this edge, times a
    constant. Voxels with fewer than four points in the mean show the sampling rather than the
    surface: for more points than that, the surface is taken to be a plane.
    """
    points = laspy.read(path).xyz
    points = points[numpy.isfinite(points).all(axis=1)]
    extent = float(numpy.ptp(points, axis=0).max()) if len(points) else 0.0
    most = min(1.5 * len(points), MOST)
    if extent == 0.0 or most < 2 * FEWEST:
        return [geometric(*FALLBACK, count), [extent / 10]][extent > 0.0]
    edge = extent / 2**LEVELS
    codes = sorted_codes(numpy.floor((points - points.min(axis=0)) / edge).astype("int64"))
    curve = []
    for level in range(LEVELS):
        voxels = 1 + numpy.count_nonzero(numpy.diff(codes >> 3 * level))
        curve.append((math.log(voxels * POINTS_PER_VOXEL), math.log(edge * 2**level)))
    reliable = math.log(max(len(points) / 4, 2) * POINTS_PER_VOXEL)
    curve = [known for known in curve if known[0] <= reliable] or curve
    curve.sort()
    return [spacing_for(math.log(wanted), curve) for wanted in geometric(FEWEST, most, count)]


def sorted_codes(cells):
    """The Morton codes of voxels in order: without its last three bits a code is that of the voxel
    of twice the edge."""
    codes = numpy.zeros(len(cells), "int64")
    for axis in range(3):
        for bit in range(LEVELS + 1):
            codes |= (cells[:, axis] >> bit & 1) << 3 * bit + axis
    codes.sort()
    return codes


def spacing_for(log_count, curve):
    """Interpolates `curve`, (logarithm of points, logarithm of spacing); beyond it, a plane."""
    last = curve[-1]
    if log_count > last[0]:
        return math.exp(last[1] - (log_count - last[0]) / 2)
    return math.exp(numpy.interp(log_count, *zip(*curve)))


def geometric(first, last, count):
    return [first * (last / first) ** (i / max(count - 1, 1)) for i in range(count)]


if __name__ == "__main__":
    if sys.argv[1] == "write":
        write(sys.argv[2], sys.argv[3], int(float(sys.argv[4]) * 1e6))
    else:
        print(json.dumps(spacings(sys.argv[2], int(sys.argv[3]))))
