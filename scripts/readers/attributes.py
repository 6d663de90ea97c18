"""Compares filters, means, majorities and computed attributes with numpy, scipy and shapely.

    attributes.py PROGRAM WORK SCAN...
"""

import json
import pathlib
import subprocess
import sys

import laspy
import numpy as np
import shapely
from scipy.spatial import cKDTree

PROGRAM, WORK, SCANS = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3:]


def lloydar(*arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode in (0, 3), (arguments, done.stderr)
    return done.stdout


def places(las):
    return np.vstack([las.x, las.y, las.z]).T


def filters(path):
    """The same points as numpy and shapely choose; classes as in the formats from 6 on."""
    las = laspy.read(path)
    at = places(las)
    classes = np.asarray(las.classification)
    if las.point_format.id < 6:
        classes = np.where(classes == 12, 1, classes)
    low, high = np.quantile(at[:, :2], [0.2, 0.7], axis=0)
    middle, span = (low + high) / 2, (high - low).max()
    star = shapely.Polygon(
        [
            middle + span * (0.4 + 0.5 * (k % 2)) * np.array([np.cos(k / 3), np.sin(k / 3)])
            for k in range(18)
        ],
        [[middle + 0.1 * span * np.array(c) for c in ([0, 0], [1, 0], [0, 1])]],
    )
    wkt, geojson = WORK / "ground.wkt", WORK / "ground.geojson"
    wkt.write_text(star.wkt)
    geojson.write_text(shapely.to_geojson(shapely.MultiPolygon([star])))
    box = ",".join(repr(float(c)) for c in [*low, *high])
    inside = (at[:, :2] >= low).all(1) & (at[:, :2] <= high).all(1)
    in_star = shapely.intersects_xy(star, at[:, 0], at[:, 1])
    common = np.bincount(classes).argsort()[::-1][:2]
    withheld = np.asarray(las.withheld).astype(bool)
    cases = [
        (["--bounds", box], inside),
        (["--polygon", wkt], in_star),
        (["--polygon", geojson], in_star),
        (["--keep-class", ",".join(map(str, common))], np.isin(classes, common)),
        (["--drop-class", common[0]], classes != common[0]),
        (["--drop-withheld"], ~withheld),
        (["--bounds", box, "--polygon", wkt, "--drop-class", common[0], "--drop-withheld"],
         inside & in_star & (classes != common[0]) & ~withheld),
    ]
    said = []
    for options, kept in cases:
        if kept.sum() < 100:
            continue
        plan = lloydar("plan", path, "-o", WORK / "plan.laz", "--ratio", "0.1", "--json", *options)
        counted = json.loads(plan)["points"]
        assert counted == kept.sum(), (path, options, counted, kept.sum())
        said.append(f"{options[0]} {counted}")
    print(f"{pathlib.Path(path).name}: {', '.join(said)}")


def rules(path):
    """Every mean, majority, density and distance, to the last bit of what is stored."""
    out = WORK / "rules.laz"
    las = laspy.read(path)
    count = max(200, len(las.points) // 30)
    lloydar(
        "run", path, "-o", out, "--count", count, "--color", "mean", "--class", "majority",
        "--with", "normals,curvature,area,density,distance", "--overwrite", "--quiet",
    )
    spacing = json.loads(pathlib.Path(f"{out}.report.json").read_text())["spacing"]
    result = laspy.read(out)
    at, scan = places(result), places(las)
    tree = cKDTree(at)
    away, cell = tree.query(scan, 2)
    own = away[:, 0] <= spacing
    # Of two that are equally near, and of what is just a spacing away, either is right.
    unsure = (away[:, 1] - away[:, 0] < 1e-6) | (np.abs(away[:, 0] - spacing) < 1e-6)
    is_sure = np.ones(len(at), dtype=bool)
    is_sure[cell[unsure].ravel()] = False
    cell = cell[own, 0]
    points = np.bincount(cell, minlength=len(at))
    is_sure &= points > 0
    checked = 0
    for name in ("intensity", "red", "green", "blue", "nir"):
        if name in las.point_format.dimension_names:
            values = np.asarray(las[name]).astype(np.uint64)[own]
            sums = np.zeros(len(at), dtype=np.uint64)
            np.add.at(sums, cell, values)
            means = (2 * sums + points.astype(np.uint64)) // np.maximum(2 * points, 1).astype(np.uint64)
            wrong = (means != np.asarray(result[name]))[is_sure]
            assert not wrong.any(), (name, wrong.sum(), is_sure.sum())
            checked += 1
    classes = np.asarray(las.classification)
    if las.point_format.id < 6:
        classes = np.where(classes == 12, 1, classes)
    counts = np.zeros((len(at), 256), dtype=int)
    np.add.at(counts, (cell, classes[own]), 1)
    chosen = counts[np.arange(len(at)), np.asarray(result.classification)]
    assert (chosen == counts.max(1))[is_sure].all()
    distance = cKDTree(scan).query(at)[0]
    # To the nearest of the points that thinning keeps.
    farther = np.asarray(result.InputDistance) - distance
    assert (farther > -1e-6 * (1 + distance)).all() and (farther < 0.5 * spacing).all()
    area = np.asarray(result.CellArea)
    bounded = is_sure & np.isfinite(area)
    assert np.allclose((points / area)[bounded], result.InputDensity[bounded], rtol=1e-5)
    normals = np.vstack([result.NormalX, result.NormalY, result.NormalZ]).T
    length = np.linalg.norm(normals, axis=1)
    assert (np.isnan(length) | (np.abs(length - 1) < 1e-5)).all() and not (normals[:, 2] < 0).any()
    print(
        f"{pathlib.Path(path).name}: {checked} means and the majority in {is_sure.sum()} of "
        f"{len(at)} cells, {bounded.sum()} densities, {len(at)} distances"
    )


for scan_path in SCANS:
    filters(scan_path)
    rules(scan_path)
