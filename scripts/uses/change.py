"""Change of 2 cm between two drives by M3C2, whose true value at each core point is known."""

import numpy as np
import py4dgeo
from scipy.spatial import cKDTree

from samplers import all_samples
from scans import along_and_across, load, one_in_each_voxel, save, street

LENGTH, POINTS, COUNT = 40, 800_000, 20_000
# Sections of the street (m along it) whose ground is raised between the drives, and by how much (m).
RAISED, CHANGE = [(5, 10), (15, 20), (25, 30)], 0.02
GROUND_CLASSES = [2, 11]
# Radii of the cylinder and of the normals in spacings of the output, and the cylinder's depth (m).
CYLINDER, NORMAL, DEPTH = 2.5, 4.0, 0.3
CORE_SPACING = 0.3
# A registration error (m) that M3C2 is given in a second judgement, and what its level of detection grows by for each metre of it.
REGISTRATION, LEVEL_FOR_REGISTRATION = 0.001, 1.96


def raised_sections(world):
    along, _ = along_and_across(world)
    return np.any([(low <= along) & (along < high) for low, high in RAISED], axis=0)


def run(seed, context, quick):
    scale = 4 if quick else 1
    folder = street(context.program, context.work, seed, LENGTH, POINTS // scale)
    first = load([folder / "pass-1.laz"])
    second = load([folder / "pass-2.laz"], offset=first.offset)
    world = second.points + first.offset
    world[:, 2] += CHANGE * (raised_sections(world) & np.isin(second.classes, GROUND_CLASSES))
    path = context.work / "changed.laz"
    save(path, world, like=folder / "pass-2.laz")
    second = load([path], offset=first.offset)
    before = all_samples(first, COUNT // scale, context)
    spacing = context.spacing
    after = all_samples(second, COUNT // scale, context)

    # Core points lie on the true ground, where both drives saw it, farther from the ends of the
    # sections than the cylinder is wide.
    exact = street(context.program, context.work, seed, LENGTH, POINTS // scale, noise=0)
    ground = load([exact / "pass-1.laz"], GROUND_CLASSES, first.offset).points
    cores = one_in_each_voxel(ground, CORE_SPACING)
    along, across = along_and_across(cores + first.offset)
    ends = np.array(RAISED).ravel()
    radius = CYLINDER * spacing
    is_inside = np.abs(along[:, None] - ends).min(axis=1) > radius
    is_inside &= (along > 1) & (along < LENGTH - 1)
    is_inside &= cKDTree(second.points).query(cores)[0] < spacing
    cores, across = np.ascontiguousarray(cores[is_inside]), across[is_inside]
    # Kerbs stand 4 m from the middle of the road, facades 7.5 m.
    is_flat = np.minimum(np.abs(np.abs(across) - 4.0), np.abs(np.abs(across) - 7.5)) > radius
    is_raised = raised_sections(cores + first.offset)
    true = CHANGE * is_raised

    measured = {}
    for method in before:
        epochs = [py4dgeo.Epoch(np.ascontiguousarray(points)) for points in (before[method], after[method])]
        m3c2 = py4dgeo.M3C2(
            epochs=epochs,
            corepoints=cores,
            cyl_radius=radius,
            normal_radii=[NORMAL * spacing],
            max_distance=DEPTH,
        )
        distances, uncertainty = m3c2.run()
        measured[method] = distances, uncertainty["lodetection"]

    # Errors are compared at the core points at which every method has a distance.
    known = {method: np.isfinite(distances) & np.isfinite(level) for method, (distances, level) in measured.items()}
    is_common = np.all(list(known.values()), axis=0)
    found = {}
    for method, (distances, level) in measured.items():
        wrong = distances - true
        is_found = known[method] & (np.abs(distances) > level)
        is_sure = known[method] & (np.abs(distances) > level + LEVEL_FOR_REGISTRATION * REGISTRATION)
        found[method] = {
            "error": 1000 * float(np.sqrt((wrong[is_common] ** 2).mean())),
            "median": 1000 * float(np.median(np.abs(wrong[is_common]))),
            "flat": 1000 * float(np.sqrt((wrong[is_common & is_flat] ** 2).mean())),
            "bias": 1000 * float(wrong[is_common].mean()),
            "level": 1000 * float(level[is_common].mean()),
            "flat level": 1000 * float(level[is_common & is_flat].mean()),
            "within": 100 * float((np.abs(wrong) <= level)[is_common].mean()),
            "detected": 100 * float(is_found[is_raised].mean()),
            "false": 100 * float(is_found[~is_raised].mean()),
            "detected, registered": 100 * float(is_sure[is_raised].mean()),
            "false, registered": 100 * float(is_sure[~is_raised].mean()),
            "without": 100 * float((~known[method]).mean()),
        }
    return {"street": found}
