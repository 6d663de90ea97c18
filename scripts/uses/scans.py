"""Simulated scans with known truth: the program's street, a torus and a terrain.

Coordinates in memory are metres from the corner of the scan; files have those of the world.
"""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np

# Where `lloydar simulate` puts its street: the origin, and the angle from east to its direction.
STREET_ORIGIN, STREET_ANGLE = np.array([431_000.0, 5_400_000.0, 100.0]), np.radians(20.0)
# The vehicle of the simulated street: height of the scanners (m), speed (m/s), lane of the first pass.
SCANNER_HEIGHT, SPEED, LANE = 2.4, 8.0, -1.6

# The torus: its radii (m), the noise of the ranges and the distance of the stations from its middle (m).
TORUS, TORUS_NOISE, STATION_DISTANCE = (1.0, 0.4), 0.004, 5.0
# The terrain: its edge, the heap's centre, radius and height (m), which make a slope of 34°.
TERRAIN_EDGE, HEAP_CENTER, HEAP_RADIUS, HEAP_HEIGHT = 30.0, (14.0, 16.0), 4.0, 2.7
# The drone: its height above ground and the noise of its ranges (m), the share of returns from plants.
FLIGHT_HEIGHT, FLIGHT_NOISE, PLANT_SHARE = 40.0, 0.02, 0.1
GROUND, PLANT = 2, 3


@dataclass
class Scan:
    """Points of a scan, and the files that they are read from."""

    files: list
    offset: np.ndarray
    points: np.ndarray
    classes: np.ndarray
    gps_time: np.ndarray
    # Classes that are used, of those in the files; None for all.
    kept: list | None = None


def load(files, kept=None, offset=None):
    """Reads files, and keeps the points of some classes."""
    files = sorted(files)
    read = [laspy.read(file) for file in files]
    points = np.concatenate([np.asarray(scan.xyz) for scan in read])
    classes = np.concatenate([np.asarray(scan.classification) for scan in read])
    gps_time = np.concatenate([np.asarray(scan.gps_time) for scan in read])
    chosen = np.isin(classes, kept) if kept else np.ones(len(points), dtype=bool)
    offset = np.floor(points.min(axis=0)) if offset is None else offset
    return Scan(files, offset, points[chosen] - offset, classes[chosen], gps_time[chosen], kept)


def save(path, points, classes=None, like=None, scale=0.001):
    """Writes world coordinates with their classes; `like` is a file whose other attributes stay."""
    if like:
        scan = laspy.read(like)
    else:
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.scales, header.offsets = [scale] * 3, np.floor(points.min(axis=0))
        scan = laspy.LasData(header)
    scan.x, scan.y, scan.z = points.T
    if classes is not None:
        scan.classification = classes.astype(np.uint8)
    scan.write(str(path))
    return path


def street(program, work, seed, length, points, noise=0.01):
    """The folder of a simulated street of two passes."""
    folder = work / f"street-{seed}-{length}-{points}-{noise}"
    if not folder.exists():
        asked = ["--length", length, "--points", points, "--noise", noise, "--seed", seed, "-o", folder]
        subprocess.run([program, "simulate", *map(str, asked)], check=True, stdout=subprocess.DEVNULL)
    return folder


def one_in_each_voxel(points, edge):
    """The first of the points in each cube of a grid with edges of `edge`."""
    _, first = np.unique(np.floor(points / edge).astype(np.int64), axis=0, return_index=True)
    return points[first]


def along_and_across(world):
    """Street coordinates (along, across) of points of the world."""
    x, y = (world - STREET_ORIGIN)[:, :2].T
    cos, sin = np.cos(STREET_ANGLE), np.sin(STREET_ANGLE)
    return cos * x + sin * y, cos * y - sin * x


def scanner_positions(gps_time):
    """Where the vehicle was at these times, in the world. The first pass goes forth, the second back."""
    number, seconds = np.divmod(gps_time - 300_000.0, 3600.0)
    # The file says how far the vehicle came; the way back begins at the end of the street.
    driven = seconds * SPEED
    is_back = number % 2 == 1
    along = np.where(is_back, driven.max() - driven, driven)
    across = np.where(is_back, -LANE, LANE)
    cos, sin = np.cos(STREET_ANGLE), np.sin(STREET_ANGLE)
    from_origin = [cos * along - sin * across, sin * along + cos * across, np.full(len(along), SCANNER_HEIGHT)]
    return STREET_ORIGIN + np.stack(from_origin, axis=1)


def torus_distance(points):
    """Signed distance to the torus around z."""
    ring = np.hypot(points[:, 0], points[:, 1]) - TORUS[0]
    return np.hypot(ring, points[:, 2]) - TORUS[1]


def torus_points(count, random):
    """Points on the torus, evenly at random."""
    angles = []
    while sum(map(len, angles)) < count:
        tube = random.uniform(0, 2 * np.pi, count)
        is_taken = random.uniform(0, TORUS[0] + TORUS[1], count) < TORUS[0] + TORUS[1] * np.cos(tube)
        angles.append(tube[is_taken])
    tube = np.concatenate(angles)[:count]
    turn = random.uniform(0, 2 * np.pi, count)
    ring = TORUS[0] + TORUS[1] * np.cos(tube)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), TORUS[1] * np.sin(tube)], axis=1)


def torus_scan(work, seed, count=200_000):
    """A file of the torus, scanned from eight stations whose rays are even in angle.

    Returns the path, and the station of each point.
    """
    random = np.random.default_rng(seed)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    stations = corners / np.sqrt(3) * STATION_DISTANCE
    points, origins = [], []
    for station in stations:
        # Rays into the cone that contains the torus.
        towards = -station / np.linalg.norm(station)
        across = np.linalg.svd(towards[None])[2][1:]
        rays = count // 2
        spread = 0.36 * np.sqrt(random.uniform(0, 1, rays))
        turn = random.uniform(0, 2 * np.pi, rays)
        rays = towards + spread[:, None] * (np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1])
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        ranges = np.full(len(rays), STATION_DISTANCE - TORUS[0] - TORUS[1] - 0.1)
        for _ in range(200):
            distance = torus_distance(station + rays * ranges[:, None])
            ranges += distance
        hits = (np.abs(distance) < 1e-6) & (ranges < 2 * STATION_DISTANCE)
        ranges = ranges[hits] + TORUS_NOISE * random.standard_normal(hits.sum())
        found = station + rays[hits] * ranges[:, None]
        found = found[: count // len(stations)]
        points.append(found)
        origins.append(np.tile(station, (len(found), 1)))
    path = work / f"torus-{seed}.laz"
    save(path, np.concatenate(points), scale=0.0001)
    return path, np.concatenate(origins)


def terrain_base(x, y):
    """Height of the ground without the heap."""
    waves = 0.20 * np.sin(x / 1.3 + 0.5) * np.cos(y / 1.7) + 0.5 * np.sin(x / 5) * np.sin(y / 6 + 1)
    return 0.04 * x - 0.02 * y + waves


def terrain_height(x, y):
    """Height of the ground: a cone on the base."""
    away = np.hypot(x - HEAP_CENTER[0], y - HEAP_CENTER[1])
    return terrain_base(x, y) + HEAP_HEIGHT * np.maximum(0, 1 - away / HEAP_RADIUS)


def terrain_scan(work, seed, per_square_metre=120):
    """A file of the terrain, surveyed by a drone in two lines that cross. Some returns are of plants."""
    random = np.random.default_rng(seed)
    count = int(per_square_metre * TERRAIN_EDGE**2 / 2)
    points, classes = [], []
    for line in range(2):
        # A pulse is aimed at a place of the ground from the line above the terrain's middle.
        x, y = random.uniform(0, TERRAIN_EDGE, (2, count))
        middle = np.full(count, TERRAIN_EDGE / 2 + random.uniform(-3, 3))
        above = np.stack([x, middle] if line == 0 else [middle, y], axis=1)
        drone = np.column_stack([above, np.full(count, FLIGHT_HEIGHT)])
        rays = np.stack([x, y, terrain_height(x, y)], axis=1) - drone
        ranges = np.linalg.norm(rays, axis=1)
        rays /= ranges[:, None]
        # Steep rays over gentle ground: what a ray meets first is what it was aimed at.
        is_plant = random.uniform(0, 1, count) < PLANT_SHARE
        ranges = ranges - np.where(is_plant, random.uniform(0.1, 0.6, count), 0)
        ranges += FLIGHT_NOISE * random.standard_normal(count)
        points.append(drone + rays * ranges[:, None])
        classes.append(np.where(is_plant, PLANT, GROUND))
    path = work / f"terrain-{seed}.laz"
    return save(path, np.concatenate(points), np.concatenate(classes))


def truth_distances(program, folder, world, path):
    """Mean distance of points of the world to the true surfaces of a street, by `lloydar measure`."""
    save(path, world, scale=0.0001)
    words = [program, "measure", path, "--truth", folder, "--json"]
    done = subprocess.run(list(map(str, words)), check=True, capture_output=True, text=True)
    Path(path).unlink()
    return json.loads(done.stdout)["truth"]["mean"]
