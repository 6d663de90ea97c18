"""Reads a COPC file that lloydar wrote with independent readers.

    copc.py OUT [REFERENCE]

copclib walks the hierarchy: every node's points must lie in its cube, all nodes together
must be all points of the header, and each level must be twice as dense along an edge as the
one before. laspy reads the same file as LAZ, and queries a part of it by its octree. With
REFERENCE, a LAS or LAZ file, the points must be the same as in that file, in any order.
"""

import sys

import copclib
import laspy
import numpy as np
from scipy.spatial import cKDTree


def places(points):
    return np.vstack([points.x, points.y, points.z]).T


def in_order(points):
    """Their records, by place and then by all that they are."""
    names = points.point_format.dimension_names
    columns = [np.asarray(points[name]).reshape(len(points.X), -1).T for name in names]
    columns = np.vstack(columns)
    return columns[:, np.lexsort(columns[::-1])]


def check(path, reference=None):
    reader = copclib.FileReader(path)
    config, info = reader.copc_config.las_header, reader.copc_config.copc_info
    whole = laspy.read(path)
    assert config.point_count == len(whole.points) > 0, config.point_count
    assert reader.ValidateSpatialBounds(False)

    low = np.array([info.center_x, info.center_y, info.center_z]) - info.halfsize
    nodes = reader.GetAllNodes()
    seen, by_level = 0, {}
    for node in nodes:
        points = reader.GetPoints(node)
        assert len(points) == node.point_count, (node.key, len(points))
        if not node.point_count:
            continue
        at = np.array([[p.x, p.y, p.z] for p in points])
        edge = 2 * info.halfsize / 2**node.key.d
        corner = low + edge * np.array([node.key.x, node.key.y, node.key.z])
        slack = 1e-9 * np.abs(corner).max()
        assert (at >= corner - slack).all() and (at <= corner + edge + slack).all(), node.key
        seen += node.point_count
        by_level.setdefault(node.key.d, []).append(at)
    assert seen == config.point_count, (seen, config.point_count)
    keys = {(n.key.d, n.key.x, n.key.y, n.key.z) for n in nodes}
    for d, x, y, z in keys:
        assert d == 0 or (d - 1, x >> 1, y >> 1, z >> 1) in keys, (d, x, y, z)

    # Spacing: the median distance to the nearest of all points up to a level.
    spacings, so_far = [], np.empty((0, 3))
    for level in sorted(by_level):
        so_far = np.vstack([so_far] + by_level[level])
        if len(so_far) > 1:
            spacings.append(np.median(cKDTree(so_far).query(so_far, 2)[0][:, 1]))
    ratios = [b / a for a, b in zip(spacings, spacings[1:])]
    # The last level takes all that is left.
    assert all(0.4 < ratio < 0.62 for ratio in ratios[1:-1]), ratios

    with laspy.CopcReader.open(path) as copc:
        times = whole.gps_time.min(), whole.gps_time.max()
        assert times == (copc.copc_info.gps_min, copc.copc_info.gps_max), times
        assert len(copc.query()) == seen
        middle = np.median(places(whole), axis=0)[:2]
        span = np.ptp(places(whole)[:, :2], axis=0) / 5
        box = laspy.copc.Bounds(mins=middle - span, maxs=middle + span)
        found = len(copc.query(bounds=box))
        # laspy rounds the box to the grid of the scale.
        depth = (span - np.abs(places(whole)[:, :2] - middle)).min(1) / whole.header.scales[0]
        assert (depth > 1).sum() <= found <= (depth > -1).sum(), found

    if reference:
        expected = laspy.read(reference)
        assert (in_order(whole) == in_order(expected)).all()
        assert (whole.header.mins == expected.header.mins).all()
        assert (whole.header.maxs == expected.header.maxs).all()
    return (
        f"{seen} points in {len(nodes)} nodes of {len(by_level)} levels, spacing "
        + " ".join(f"{spacing:.3g}" for spacing in spacings)
    )


if __name__ == "__main__":
    print(check(*sys.argv[1:]))
