"""Registration of two drives by GICP, from starts around the known pose."""

import numpy as np
import small_gicp

from samplers import all_samples
from scans import load, save, street

LENGTH, POINTS, COUNT = 40, 600_000, 10_000
STARTS = 100
# Starts: turn about the vertical and about the horizontal axes (degrees), shift across and upwards (m),
# each even between plus and minus this.
TURN, TILT, SHIFT, RISE = 8.0, 1.0, 1.5, 0.2
# A registration fails if points are farther than this (m) from where they belong, as root mean square.
FAILURE = 0.10
NEIGHBORS, CORRESPONDENCE, ITERATIONS = 20, 1.0, 50


def pose(random, turn, tilt, shift, rise):
    """A random pose: a turn, then a shift."""
    angles = np.radians(random.uniform(-1, 1, 3) * [tilt, tilt, turn])
    result = np.eye(4)
    for axis, angle in enumerate(angles):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        about = np.eye(4)
        about[[one, other], [one, other]] = np.cos(angle)
        about[one, other], about[other, one] = -np.sin(angle), np.sin(angle)
        result = about @ result
    result[:3, 3] = random.uniform(-1, 1, 3) * [shift, shift, rise]
    return result


def moved(pose, points):
    return points @ pose[:3, :3].T + pose[:3, 3]


def prepared(points):
    cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud)
    small_gicp.estimate_normals_covariances(cloud, tree, num_neighbors=NEIGHBORS)
    return cloud, tree


def run(seed, context, quick):
    random = np.random.default_rng(seed)
    folder = street(context.program, context.work, seed, LENGTH, POINTS // (4 if quick else 1))
    count = COUNT // (4 if quick else 1)
    target = load([folder / "pass-1.laz"])
    # The second drive is turned and shifted about the middle of the first before it is sampled.
    second = load([folder / "pass-2.laz"], offset=target.offset)
    middle = target.points.mean(axis=0)
    true = pose(random, 10, 2, 5, 1)
    path = context.work / "second.laz"
    away = moved(np.linalg.inv(true), second.points - middle) + middle
    save(path, away + target.offset, like=folder / "pass-2.laz")
    source = load([path], offset=target.offset)
    targets, sources = all_samples(target, count, context), all_samples(source, count, context)

    # The same starts for every method, around the true pose.
    starts = [pose(random, TURN, TILT, SHIFT, RISE) @ true for _ in range(STARTS // (5 if quick else 1))]
    checked = (source.points - middle)[:: len(source.points) // 2000]
    right = moved(true, checked)
    found = {}
    for method in targets:
        (one, tree), (other, _) = prepared(targets[method] - middle), prepared(sources[method] - middle)
        errors = []
        for start in starts:
            result = small_gicp.align(
                one, other, tree, start, "GICP", CORRESPONDENCE, num_threads=2, max_iterations=ITERATIONS
            )
            wrong = moved(result.T_target_source, checked) - right
            errors.append(float(np.sqrt((wrong**2).sum(axis=1).mean())))
        errors = np.array(errors)
        ended = errors[errors <= FAILURE]
        found[method] = {
            "error": 1000 * float(np.median(errors)),
            "error of successes": 1000 * float(ended.mean()) if len(ended) else float("nan"),
            "failures": 100 * float((errors > FAILURE).mean()),
        }
    return {"two drives": found}
