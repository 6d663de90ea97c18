"""Figures of clouds whose spacing varies, for scripts/test-density."""

import json
import sys

import laspy
import numpy as np
from scipy.spatial import cKDTree

SQRT_3_OVER_2 = 0.75**0.5
# The quarters of the plane: corner, class, points. Finer quarters are scanned more densely.
QUARTERS = [((0, 0), 2, 60_000), ((10, 0), 3, 200_000), ((0, 10), 4, 500_000), ((10, 10), 5, 1_600_000)]


def simulate(path):
    """Writes a plane of 20 m by 20 m with a class for each quarter."""
    random = np.random.default_rng(1)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = [0.0001] * 3, [0.0] * 3
    cloud = laspy.LasData(header)
    points = [
        np.c_[random.uniform(corner, np.add(corner, 10), (count, 2)), random.normal(0, 0.002, count)]
        for corner, _, count in QUARTERS
    ]
    cloud.x, cloud.y, cloud.z = np.vstack(points).T
    cloud.classification = np.repeat([c for _, c, _ in QUARTERS], [n for _, _, n in QUARTERS])
    cloud.write(path)


def measure(name, path, limits):
    """Prints the figures of a cloud; the limits of a plane or of a street have to be kept."""
    cloud = laspy.read(path)
    points = np.c_[cloud.x, cloud.y, cloud.z]
    wanted, area = (np.asarray(cloud[key], float) for key in ("Spacing", "CellArea"))
    with open(path + ".report.json") as file:
        report = json.load(file)
    figures = report["on_surfaces"]
    plane = points[:, :2]
    low, high = plane.min(0) + 0.5, plane.max(0) - 0.5
    is_plane = limits == "plane"
    inside = np.all((plane >= low) & (plane <= high), axis=1) if is_plane else np.ones(len(points), bool)
    bounded = np.isfinite(area)
    relative = area / SQRT_3_OVER_2 / wanted**2
    edge = np.sqrt(relative)
    # Cells next to each other: of points that are hardly farther apart than both want.
    distance, other = cKDTree(points).query(points, k=7)
    # The spacing around a point: of its cell and the cells next to it, the mean of the areas.
    around = (distance <= 1.5 * wanted[:, None]) & bounded[other]
    sums = np.sum(relative[other], axis=1, where=around)
    local = np.sqrt(sums / np.maximum(around.sum(1), 1))
    near = distance[:, 1:] <= 1.2 * np.minimum(wanted[:, None], wanted[other[:, 1:]])
    ratio = np.sqrt(area[other[:, 1:]] / area[:, None])
    near &= bounded[:, None] & bounded[other[:, 1:]] & inside[:, None] & inside[other[:, 1:]]
    print(
        f"{name}: {len(points)} points; on surfaces energy {figures['energy_ratio']:.4f}, CV "
        f"{figures['cell_area_cv']:.4f}, δ {figures['delta']:.4f}; lengths of neighbours 99.9 % "
        f"{np.quantile(ratio[near], 0.999):.3f}, at most {ratio[near].max():.3f} : 1"
    )
    failed = []
    counts = np.unique(np.round(wanted, 4), return_counts=True)
    for spacing in [s for s, n in zip(*counts, strict=True) if n > 0.003 * len(points)]:
        cells = (abs(wanted - spacing) < 1e-4) & bounded & inside
        here = edge[cells]
        deviation, of_local = (np.quantile(abs(of[cells] - 1), 0.95) for of in (edge, local))
        low, middle, high = np.quantile(here, [0.025, 0.5, 0.975])
        print(
            f"    {spacing:g}: {len(here)} cells, edge over wanted {low:.3f} {middle:.3f} {high:.3f} "
            f"(2.5, 50, 97.5 %), 95 % within {deviation:.3f}, with the cells next to them within {of_local:.3f}"
        )
        if (deviation > 0.03) if is_plane else (of_local > 0.08):
            failed.append(f"spacing {spacing:g}")
    uneven = figures["energy_ratio"] > 1.02 or figures["cell_area_cv"] > 0.06 or ratio[near].max() > 1.35
    if is_plane and uneven:
        failed.append("evenness")
    if limits and failed:
        sys.exit(f"beyond the limits: {', '.join(failed)}")


def compare(path, other):
    """Checks that two clouds have the same points."""
    both = [laspy.read(p) for p in (path, other)]
    stored = [np.c_[c.X, c.Y, c.Z] for c in both]
    stored = [s[np.lexsort(s.T)] for s in stored]
    if not np.array_equal(*stored):
        sys.exit(f"{len(stored[0])} and {len(stored[1])} points differ")
    with open(other + ".report.json") as file:
        tiles = len(json.load(file)["tiles"])
    print(f"    {len(stored[0])} points, the same in {tiles} tiles")


def count(path, wanted):
    """Checks the number of points."""
    found = laspy.open(path).header.point_count
    print(f"    {found} points for {wanted}")
    if abs(found / wanted - 1) > 0.01:
        sys.exit("a count is missed")


match sys.argv[1:]:
    case ["simulate", path]:
        simulate(path)
    case ["measure", "--limits", limits, name, path]:
        measure(name, path, limits)
    case ["measure", name, path]:
        measure(name, path, None)
    case ["compare", path, other]:
        compare(path, other)
    case ["count", path, wanted]:
        count(path, int(wanted))
