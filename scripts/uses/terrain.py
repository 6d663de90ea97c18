"""Terrain and the volume of a heap from ground points: a TIN against the true heights."""

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from samplers import all_samples
from scans import (
    GROUND,
    HEAP_CENTER,
    HEAP_RADIUS,
    TERRAIN_EDGE,
    load,
    terrain_base,
    terrain_height,
    terrain_scan,
)

COUNT = 6_000
# Heights are compared on a grid of this step, this far from the edge of the terrain (m).
STEP, MARGIN = 0.1, 1.0


def run(seed, context, quick):
    path = terrain_scan(context.work, seed, per_square_metre=30 if quick else 120)
    scan = load([path], [GROUND])
    samples = all_samples(scan, COUNT // (4 if quick else 1), context)
    ticks = np.arange(MARGIN, TERRAIN_EDGE - MARGIN, STEP) + STEP / 2
    x, y = np.meshgrid(ticks, ticks)
    true, base = terrain_height(x, y), terrain_base(x, y)
    is_heap = np.hypot(x - HEAP_CENTER[0], y - HEAP_CENTER[1]) < HEAP_RADIUS + 0.5
    volume = (true - base)[is_heap].sum() * STEP**2
    found = {}
    for method, points in samples.items():
        world = points + scan.offset
        heights = LinearNDInterpolator(world[:, :2], world[:, 2])(x, y)
        wrong = heights - true
        is_known = np.isfinite(wrong)
        error = ((heights - base)[is_heap].sum() * STEP**2 / volume - 1) if is_known[is_heap].all() else np.nan
        found[method] = {
            "error": 1000 * float(np.sqrt(np.nanmean(wrong**2))),
            "bias": 1000 * float(np.nanmean(wrong)),
            "volume": 100 * abs(error),
            "signed volume": 100 * error,
            "heap": 1000 * float(np.sqrt(np.nanmean(wrong[is_heap] ** 2))),
            "unknown": 100 * float((~is_known).mean()),
        }
    return {"heap": found}
