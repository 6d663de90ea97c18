"""Reprojects 10 000 points from one system to another, and compares them with what PROJ makes of them.

    reprojection.py PROGRAM WORK

The points are so far from each other that each of them is a point of the output. Between systems on one datum, and
between those that EPSG defines as coinciding with WGS 84, the program has to be within a millimetre of PROJ.
"""

import pathlib
import subprocess
import sys

import laspy
import numpy as np
import pyproj
from scipy.spatial import cKDTree

PROGRAM, WORK = sys.argv[1], pathlib.Path(sys.argv[2])
POINTS = 10_000
WORST_METRES = 0.001
# Source, target, and an area in degrees.
CASES = [
    (4326, 32633, (14.0, 50.0, 15.0, 50.8)),
    (4326, 32701, (-177.5, -40.3, -176.9, -39.9)),
    (4326, 32660, (179.2, 0.2, 179.9, 0.8)),
    (4326, 32631, (1.5, 83.5, 4.5, 83.9)),
    (32632, 32633, (11.8, 50.0, 12.4, 50.5)),
    (32633, 32632, (11.8, 50.0, 12.4, 50.5)),
    (4171, 2154, (2.0, 48.5, 2.8, 49.0)),
    (4326, 2154, (2.0, 48.5, 2.8, 49.0)),
    (2154, 25831, (2.0, 48.5, 2.8, 49.0)),
    (4326, 3857, (13.0, 52.2, 13.6, 52.7)),
    (4152, 2994, (-123.4, 43.9, -122.9, 44.2)),
    (4269, 2992, (-123.4, 43.9, -122.9, 44.2)),
    (2994, 3740, (-123.4, 43.9, -122.9, 44.2)),
    (2180, 25834, (20.8, 52.0, 21.4, 52.4)),
    (3035, 25832, (9.0, 48.5, 9.6, 49.0)),
]


def metres_per_unit(code):
    crs = pyproj.CRS(code)
    return 1.0 if crs.is_geographic else crs.axis_info[0].unit_conversion_factor


def compared(source, target, area):
    """The largest and the mean distance to the points of PROJ, in metres."""
    generator = np.random.default_rng(source + target)
    west, south, east, north = area
    places = generator.uniform((west, south), (east, north), (POINTS, 2))
    crs = pyproj.CRS(source)
    if not crs.is_geographic:
        # Anywhere in the area is as good as anywhere else: the datum does not matter here.
        places = np.stack(pyproj.Proj(crs)(*places.T), axis=1)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = [1e-9 if crs.is_geographic else 1e-4] * 2 + [0.001]
    header.offsets = [*places.mean(axis=0).round(), 0.0]
    las = laspy.LasData(header)
    las.x, las.y, las.z = *places.T, generator.uniform(0.0, 100.0, POINTS)
    scan, output = WORK / "places.laz", WORK / "placed.laz"
    las.write(scan)
    job = [PROGRAM, "run", scan, "-o", output, "--crs", f"EPSG:{source}", "--reproject", f"EPSG:{target}"]
    subprocess.run([*job, "--spacing", "1cm", "--overwrite", "--quiet"], check=True)
    with laspy.open(output) as reader:
        stated = reader.header.vlrs.get("WktCoordinateSystemVlr")[0].string
        found = reader.read()
    assert pyproj.CRS.from_wkt(stated).is_projected, stated
    assert stated.rstrip("\0").endswith(f'AUTHORITY["EPSG","{target}"]]'), stated
    transformer = pyproj.Transformer.from_crs(source, target, always_xy=True)
    # The places as stored.
    wanted = np.stack(transformer.transform(np.asarray(las.x), np.asarray(las.y)), axis=1)
    assert len(found) == POINTS, len(found)
    unit = metres_per_unit(target)
    distances, matches = cKDTree(wanted).query(np.stack([found.x, found.y], axis=1))
    assert len(set(matches)) == POINTS
    source_unit = metres_per_unit(source)
    heights = np.asarray(las.z)[matches] * source_unit / unit
    assert np.abs(np.asarray(found.z) - heights).max() * unit < WORST_METRES
    return distances.max() * unit, distances.mean() * unit


def vertical_part():
    """The vertical system of a scan in degrees is that of the output, as PROJ reads its text."""
    scan, output = WORK / "heights.laz", WORK / "heights-out.laz"
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [1e-9, 1e-9, 0.001], [15.0, 50.0, 0.0]
    for vertical, name in [("EPSG:4326+3855", "EPSG:3855"), ("EPSG:4979", None)]:
        crs = pyproj.CRS(vertical)
        las = laspy.LasData(header)
        las.x, las.y, las.z = 15.0 + np.arange(50) * 1e-4, np.full(50, 50.0), np.arange(50) * 0.5
        las.header.vlrs.clear()
        las.header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(crs.to_wkt("WKT2_2019")))
        las.header.global_encoding.wkt = True
        las.write(scan)
        job = [PROGRAM, "run", scan, "-o", output, "--reproject", "auto", "--spacing", "1cm"]
        subprocess.run([*job, "--overwrite", "--quiet"], check=True)
        with laspy.open(output) as reader:
            stated = pyproj.CRS.from_wkt(reader.header.vlrs.get("WktCoordinateSystemVlr")[0].string)
            assert abs(np.asarray(reader.read().z).max() - 24.5) < 1e-6
        if name:
            horizontal, heights = stated.sub_crs_list
            assert horizontal.to_epsg() == 32633, horizontal
            assert heights.to_authority() == tuple(name.split(":")), heights
        else:
            # PROJ joins heights above the ellipsoid with the plane: one system with three axes.
            assert len(stated.axis_info) == 3 and "llipsoid" in stated.axis_info[2].name, stated


for source, target, area in CASES:
    worst, mean = compared(source, target, area)
    print(f"EPSG:{source} to EPSG:{target}: at most {1000 * worst:.3f} mm, in the mean {1000 * mean:.3f} mm")
    assert worst <= WORST_METRES
vertical_part()
print("vertical systems are kept")
