"""Prints how even the levels of a COPC file and the beginnings of a progressive LAZ file are.

    levels.py NAME EVEN.copc.laz EVEN.laz

Nearest distances are those of scipy's tree, points those of copclib and laspy. NAME `street`
stands for the simulated street, whose figures must be within the limits.
"""

import sys

import copclib
import laspy
import numpy as np
from scipy.spatial import cKDTree

MOST_CV, LEAST_DISTANCE = 0.16, 0.7
SHARES = (0.01, 0.03, 0.1, 0.3)


def octree(path):
    """The points of each level of a COPC file, the spacing of the root, and the number of nodes without points."""
    reader = copclib.FileReader(path)
    levels, empty = {}, 0
    for node in reader.GetAllNodes():
        if node.point_count == 0:
            empty += 1
            continue
        points = reader.GetPoints(node)
        levels.setdefault(node.key.d, []).append(np.c_[points.x, points.y, points.z])
    levels = [np.vstack(levels.get(d, [np.empty((0, 3))])) for d in range(max(levels) + 1)]
    with laspy.CopcReader.open(path) as copc:
        # laspy finds the same points down to each level.
        for depth in range(len(levels)):
            found = len(copc.query(level=range(depth + 1)))
            assert found == sum(map(len, levels[: depth + 1])), (depth, found)
    return levels, reader.copc_config.copc_info.spacing, empty


def row(name, points, spacing, surface):
    """Prints the figures of `points`; whether they are within the limits."""
    distances = cKDTree(points).query(points, 2)[0][:, 1]
    mean = distances.mean()
    on_surface = distances[surface]
    cv = distances.std() / mean
    least = distances.min() / (spacing or mean)
    print(
        f"| {name} | {len(points)} | {spacing or mean:.4f} | {cv:.3f} | {least:.2f} | {distances.min() / mean:.2f} "
        f"| {on_surface.std() / on_surface.mean():.3f} | {100 * len(on_surface) / len(points):.0f} % |"
    )
    return cv <= MOST_CV and least >= LEAST_DISTANCE


def surfaces(points):
    """Whether six others lie within 1.5 times the median nearest distance of each point."""
    distances = cKDTree(points).query(points, 7)[0]
    return distances[:, 6] < 1.5 * np.median(distances[:, 1])


def main(name, copc, progressive):
    levels, root_spacing, empty = octree(copc)
    everything = np.vstack(levels)
    surface = surfaces(everything)
    print(f"| {name}, {empty} nodes without points | points | spacing | CV | least / spacing | least / mean | CV on surfaces | share |")
    print("| --- " * 8 + "|")
    good, count = True, 0
    for depth, level in enumerate(levels):
        count += len(level)
        good &= row(f"levels 0 to {depth}", everything[:count], root_spacing / 2**depth, surface[:count])
    ordered = np.asarray(laspy.read(progressive).xyz)
    surface = surfaces(ordered)
    assert len(ordered) == len(everything), (len(ordered), len(everything))
    for share in SHARES:
        count = int(share * len(ordered))
        good &= row(f"first {100 * share:.0f} %", ordered[:count], None, surface[:count])
    print()
    if name == "street" and not good:
        sys.exit("a level or a beginning of the street is less even than it must be")


if __name__ == "__main__":
    main(*sys.argv[1:])
