"""Ways to take the same number of points of a scan, each as its users run it."""

import json
import subprocess
import sys
from pathlib import Path

import laspy
import numpy as np
from scipy.spatial import cKDTree

# Behind this directory, since both have a module `scans`.
sys.path.append(str(Path(__file__).resolve().parent.parent / "peers"))
from thinning import by_open3d_voxels, by_pymeshlab  # noqa: E402

# Every method gives the number of points that was asked for, to this share.
TOLERANCE = 0.01
TRIALS = 40


def lloydar(scan, count, context):
    """The program with its defaults; nothing is set but the number of points and the classes."""
    output = context.work / "even.laz"
    words = [context.program, "run", *scan.files, "-o", output, "--count", count, "--exact", "--overwrite", "--quiet"]
    if scan.kept:
        words += ["--keep-class", ",".join(map(str, scan.kept))]
    if context.mesh:
        words += ["--mesh", context.mesh]
    subprocess.run(list(map(str, words)), check=True)
    report = json.loads(Path(f"{output}.report.json").read_text())
    context.spacing = report["spacing"]
    return np.asarray(laspy.read(output).xyz) - scan.offset


def poisson_disk(scan, count, context):
    """MeshLab's "Point Cloud Simplification" by a radius, which is searched for."""
    return searched(lambda radius: by_pymeshlab(scan.points, radius), count, 0.75 * context.spacing)


def smoothed(scan, points, reach):
    """Moves each point onto a quadratic patch, fitted to the scan within `reach` by Gaussian weights."""
    tree = cKDTree(scan.points)
    moved = points.copy()
    for index, near in enumerate(tree.query_ball_point(points, reach)):
        if len(near) < 8:
            continue
        around = scan.points[near] - points[index]
        weights = np.exp(-2 * (around**2).sum(axis=1) / reach**2)
        mean = weights @ around / weights.sum()
        axes = np.linalg.eigh((around - mean).T @ ((around - mean) * weights[:, None]))[1]
        u, v, w = (around @ axes[:, ::-1]).T
        terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
        root = np.sqrt(weights)
        height = np.linalg.lstsq(terms * root[:, None], w * root, rcond=None)[0][0]
        moved[index] += np.clip(height, -reach / 2, reach / 2) * axes[:, 0]
    return moved


def voxel_means(scan, count, context):
    """Open3D's `voxel_down_sample` by an edge, which is searched for."""
    return searched(lambda edge: by_open3d_voxels(scan.points, edge), count, context.spacing)


def random_points(scan, count, context):
    """Points of the scan, all with the same probability."""
    random = np.random.default_rng(context.seed)
    return scan.points[random.choice(len(scan.points), count, replace=False)]


def searched(sampled, count, first):
    """What `sampled` gives at the length at which it gives `count` points.

    The number of points falls with the square of the length on a surface, more or less. The search
    interpolates the logarithms between the nearest lengths on both sides, and halves where that stalls.
    """
    low, high, length = None, None, first
    for trial in range(TRIALS):
        points = sampled(length)
        excess = float(np.log(len(points) / count))
        if abs(len(points) / count - 1) <= TOLERANCE:
            return points
        if excess > 0:
            low = np.log(length), excess
        else:
            high = np.log(length), excess
        if low and high:
            share = 0.5 if trial % 4 == 3 else low[1] / (low[1] - high[1])
            length = float(np.exp(low[0] + share * (high[0] - low[0])))
        else:
            length *= float(np.exp(np.clip(excess / 2, -0.7, 0.7)))
    raise RuntimeError(f"no length gives {count} points: {length:.4g} gives {len(points)}")


OURS, PEER, SMOOTHED = "lloydar", "Poisson-disk", "Poisson-disk, smoothed"
METHODS = [OURS, PEER, "voxel means", "random", SMOOTHED]


def all_samples(scan, count, context):
    """The points of every method. The spacing that others begin with is the one lloydar reports."""
    samples = {OURS: lloydar(scan, count, context)}
    samples[PEER] = poisson_disk(scan, count, context)
    samples["voxel means"] = voxel_means(scan, count, context)
    samples["random"] = random_points(scan, count, context)
    samples[SMOOTHED] = smoothed(scan, samples[PEER], 1.2 * context.spacing)
    for name, points in samples.items():
        if abs(len(points) / count - 1) > TOLERANCE:
            raise RuntimeError(f"{name} gives {len(points)} points, not {count}")
    return samples
