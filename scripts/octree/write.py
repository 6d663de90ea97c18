"""Writes scans as an octree (COPC), as programs for tiling do: points in random order, each in the first node from the root
where its voxel is free."""

import copclib
import laspy
import numpy

VOXELS = 128  # along the edge of a node
LEAF = 20_000  # points below which a node is not divided


def write(paths, output):
    """Writes the points of the files at `paths`; returns their number."""
    parts, header = [], None
    for path in paths:
        scan = laspy.read(path)
        header = header or scan.header
        parts.append(numpy.stack([scan.x, scan.y, scan.z], axis=1))
    points = numpy.concatenate(parts)
    numpy.random.default_rng(7).shuffle(points)
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.5 * float((high - low).max()) * 1.0001 + header.scales[0]
    centre = 0.5 * (low + high)

    config = copclib.CopcConfigWriter(6, [float(s) for s in header.scales], [float(o) for o in header.offsets])
    config.las_header.min = copclib.Vector3(*map(float, low))
    config.las_header.max = copclib.Vector3(*map(float, high))
    config.copc_info.center_x, config.copc_info.center_y, config.copc_info.center_z = map(float, centre)
    config.copc_info.halfsize = half
    config.copc_info.spacing = 2 * half / VOXELS
    writer = copclib.FileWriter(str(output), config)
    waiting = {(0, 0, 0): numpy.arange(len(points))}
    level = 0
    while waiting:
        edge = 2 * half / 2**level
        below = {}
        for (i, j, k), members in waiting.items():
            kept = members
            if len(members) > LEAF and level < 20:
                corner = centre - half + edge * numpy.array([i, j, k])
                voxel = numpy.clip(((points[members] - corner) / edge * VOXELS).astype(int), 0, VOXELS - 1)
                _, first = numpy.unique(voxel @ [1, VOXELS, VOXELS * VOXELS], return_index=True)
                mask = numpy.zeros(len(members), bool)
                mask[first] = True
                kept, rest = members[mask], members[~mask]
                octant = numpy.clip(((points[rest] - corner) / edge * 2).astype(int), 0, 1)
                for number in range(8):
                    ahead = [number & 1, number >> 1 & 1, number >> 2]
                    inside = rest[(octant == ahead).all(axis=1)]
                    if len(inside):
                        below[2 * i + ahead[0], 2 * j + ahead[1], 2 * k + ahead[2]] = inside
            node = copclib.Points(config.las_header)
            x, y, z = points[kept].T
            for place in zip(x.tolist(), y.tolist(), z.tolist()):
                point = node.CreatePoint()
                point.x, point.y, point.z = place
                node.AddPoint(point)
            writer.AddNode(copclib.VoxelKey(level, i, j, k), node)
        waiting, level = below, level + 1
    writer.Close()
    return len(points)
