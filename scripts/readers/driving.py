"""Reads PCD files by Open3D, and the index of PCD tiles by PyYAML as Autoware's loader takes it.

    driving.py PROGRAM WORK

WORK contains the folder `scans`.
"""

import pathlib
import subprocess
import sys

import laspy
import numpy as np
import open3d
import yaml

PROGRAM, WORK = sys.argv[1], pathlib.Path(sys.argv[2])


def run(output, *options):
    job = [PROGRAM, "run", WORK / "scans", "-o", WORK / output, "--spacing", "0.3", "--overwrite", "--quiet"]
    subprocess.run([*job, *options], check=True)
    return WORK / output


def cloud(path):
    """The fields of a PCD file, each a column."""
    point = open3d.t.io.read_point_cloud(str(path)).point
    return {name: point[name].numpy() for name in point}


def origin(path):
    with open(path, "rb") as file:
        for line in file:
            if line.startswith(b"# origin "):
                return np.array(line.split()[2:], dtype=float)
    raise AssertionError(f"{path} states no origin")


def in_order(points):
    return points[np.lexsort(points.T)]


las = laspy.read(run("all.laz", "--with", "normals"))
truth = in_order(np.stack([las.x, las.y, las.z], axis=1))
flat = {}
for encoding in ["binary", "compressed"]:
    path = run(f"{encoding}.pcd", "--pcd", encoding, "--with", "normals")
    flat[encoding] = cloud(path)
    positions = flat[encoding]["positions"].astype(float) + origin(path)
    assert len(positions) == len(truth)
    # Single precision moves points by less than this, and so hardly changes their order.
    far = np.abs(in_order(positions.round(3)) - truth.round(3)).max(axis=1) > 0.0015
    assert far.mean() < 0.01, far.mean()
    normals = flat[encoding]["normals"]
    lengths = np.linalg.norm(normals, axis=1)
    assert np.all(np.isnan(lengths) | (np.abs(lengths - 1.0) < 1e-5))
    assert {"intensity", "label"} <= set(flat[encoding])
    print(f"{path.name}: {len(positions)} points")
for name, column in flat["binary"].items():
    assert np.array_equal(column, flat["compressed"][name], equal_nan=column.dtype.kind == "f"), name

for encoding in ["binary", "compressed"]:
    folder = run("map", "--output-tiles", "20", "--format", "pcd", "--pcd-origin", "mgrs", "--pcd", encoding)
    index = yaml.safe_load((folder / "pointcloud_map_metadata.yaml").read_text())
    edges = np.array([index.pop("x_resolution"), index.pop("y_resolution")])
    assert edges.dtype == float and np.all(edges == 20.0)
    assert set(index) == {path.name for path in folder.glob("*.pcd")}
    count = 0
    for name, corner in index.items():
        assert [type(c) for c in corner] == [int, int]
        positions = np.asarray(open3d.io.read_point_cloud(str(folder / name)).points)[:, :2]
        # A rounding step of single precision at 100 km.
        assert np.all(positions >= np.array(corner) - 0.008), name
        assert np.all(positions <= np.array(corner) + edges + 0.008), name
        count += len(positions)
    assert count == len(truth), (count, len(truth))
    print(f"{len(index)} {encoding} tiles: {count} points")
