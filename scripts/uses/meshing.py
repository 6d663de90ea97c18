"""Meshes of the points by three programs, and how far they are from the truth.

Every mesher gets the same settings for all methods, in spacings of the output.
"""

import subprocess

import numpy as np
from scipy.spatial import cKDTree

# samplers adds scripts/peers to the path, where the figures of meshes are.
from samplers import OURS, all_samples
from scans import (
    load,
    one_in_each_voxel,
    scanner_positions,
    street,
    torus_distance,
    torus_points,
    torus_scan,
    truth_distances,
)
from thinning import load_libusb

load_libusb()
import open3d  # noqa: E402
from meshes import figures  # noqa: E402

# Classes of surfaces on the street: cars and boxes, pavement, walls, road.
SURFACES = [1, 2, 6, 11]
STREET_LENGTH, STREET_POINTS, STREET_COUNT = 20, 400_000, 20_000
TORUS_COUNT = 5_000
# Points on a mesh whose distances to the truth are measured.
SAMPLES = 50_000
# Where the truth is farther from the mesh than this, in spacings, the mesh has a hole.
HOLE = 0.5
OWN_MESH = "its own (`--mesh`)"


def ball_pivoting(points, normals, spacing, _context):
    cloud = oriented(points, normals)
    radii = open3d.utility.DoubleVector([spacing, 2 * spacing])
    mesh = open3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def advancing_front(points, _normals, spacing, context):
    """CGAL's reconstruction with its defaults, without triangles that have an edge of more than three
    spacings: it closes every opening, and users bound the edges where the surface is open."""
    raw, found = context.work / "points", context.work / "triangles"
    points.astype("<f8").tofile(raw)
    subprocess.run([context.front, raw, found], check=True, stdout=subprocess.DEVNULL)
    triangles = np.fromfile(found, dtype="<u4").reshape(-1, 3).astype(np.int64)
    edges = points[triangles] - points[np.roll(triangles, 1, axis=1)]
    return points, triangles[np.linalg.norm(edges, axis=2).max(axis=1) <= 3 * spacing]


def screened_poisson(points, normals, spacing, _context):
    """Cells of the octree are at most half a spacing wide. Triangles farther than two spacings from
    the points are cut off, as users do where the surface is open."""
    extent = 1.1 * np.ptp(points, axis=0).max()
    depth = int(np.ceil(np.log2(2 * extent / spacing)))
    mesh, _ = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        oriented(points, normals), depth=depth, n_threads=2
    )
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    is_near = cKDTree(points).query(vertices)[0] <= 2 * spacing
    return vertices, triangles[is_near[triangles].all(axis=1)]


MESHERS = {
    "ball pivoting": ball_pivoting,
    "advancing front": advancing_front,
    "screened Poisson": screened_poisson,
}


def oriented(points, normals):
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.normals = open3d.utility.Vector3dVector(normals)
    return cloud


def estimated_normals(points, scanned, scanners):
    """Open3D's normals of the points with its default of 30 neighbours, turned towards the scanner of
    the nearest point of the scan."""
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(30))
    normals = np.asarray(cloud.normals).copy()
    towards = scanners[scanned.query(points)[1]] - points
    normals[(normals * towards).sum(axis=1) < 0] *= -1
    return normals


def points_on(vertices, triangles, random):
    """Points on a mesh, evenly at random."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = random.choice(len(triangles), SAMPLES, p=areas / areas.sum())
    u, v = random.uniform(0, 1, (2, SAMPLES))
    u, v = np.where(u + v > 1, [1 - u, 1 - v], [u, v])
    return a[chosen] + u[:, None] * (b - a)[chosen] + v[:, None] * (c - a)[chosen]


def distances_to(vertices, triangles, points):
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), triangles.astype(np.uint32))
    return scene.compute_distance(points.astype(np.float32)).numpy()


def measured(mesh, truth, distance, spacing, random):
    """Figures of a mesh; lengths in mm, open edges in % of all edges, holes in % of the true surface."""
    vertices, triangles = mesh
    to_truth = distance(points_on(vertices, triangles, random))
    from_truth = distances_to(vertices, triangles, truth)
    to_mesh = float(from_truth.mean())
    corners = np.sort(triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    edges = len(np.unique(corners, axis=0))
    open_edges, _, unused, median, least = figures(vertices, triangles)
    return {
        "error": 500 * (to_truth + to_mesh),
        "mesh to truth": 1000 * to_truth,
        "truth to mesh": 1000 * to_mesh,
        "angle, median": median,
        "angle, 1 %": least,
        "open edges": 100 * open_edges / edges,
        "holes": 100 * float((from_truth > HOLE * spacing).mean()),
        "unused": unused,
    }


def street_scene(seed, context, scale):
    """The street's surfaces; the truth is a scan of the same street without noise, one point in each
    voxel of 5 cm."""
    count = STREET_POINTS // scale
    folder = street(context.program, context.work, seed, STREET_LENGTH, count)
    scan = load(folder.glob("*.laz"), SURFACES)
    exact = street(context.program, context.work, seed, STREET_LENGTH, count, noise=0)
    truth = load(exact.glob("*.laz"), SURFACES, scan.offset).points
    path = context.work / "on-mesh.laz"

    def distance(points):
        return truth_distances(context.program, folder, points + scan.offset, path)

    scanners = scanner_positions(scan.gps_time) - scan.offset
    return scan, scanners, one_in_each_voxel(truth, 0.05), distance, STREET_COUNT // scale


def torus_scene(seed, context, scale):
    path, origins = torus_scan(context.work, seed, 200_000 // scale)
    scan = load([path])
    truth = torus_points(SAMPLES, np.random.default_rng(seed + 1000)) - scan.offset

    def distance(points):
        return float(np.abs(torus_distance(points + scan.offset)).mean())

    return scan, origins - scan.offset, truth, distance, TORUS_COUNT // scale


SCENES = {"torus": torus_scene, "street": street_scene}


def run(seed, context, quick):
    """Figures by scene and mesher, method and name."""
    found = {}
    for name, scene in SCENES.items():
        context.mesh = context.work / "own.ply"
        scan, scanners, truth, distance, count = scene(seed, context, 4 if quick else 1)
        samples = all_samples(scan, count, context)
        spacing = context.spacing
        scanned = cKDTree(scan.points)
        for method, points in samples.items():
            normals = estimated_normals(points, scanned, scanners)
            for mesher, make in MESHERS.items():
                if mesher == "advancing front" and not context.front:
                    continue
                mesh = make(points, normals, spacing, context)
                random = np.random.default_rng(seed)
                row = measured(mesh, truth, distance, spacing, random)
                if mesher == "screened Poisson":
                    # Its corners are not the points.
                    del row["unused"]
                found.setdefault(f"{name}, {mesher}", {})[method] = row
        own = open3d.io.read_triangle_mesh(str(context.mesh))
        mesh = np.asarray(own.vertices) - scan.offset, np.asarray(own.triangles)
        row = measured(mesh, truth, distance, spacing, np.random.default_rng(seed))
        found[f"{name}, {OWN_MESH}"] = {OURS: row}
        found[f"{name}, points"] = {
            method: {"error": 1000 * distance(points), "spacing": 1000 * spacing, "points": len(points)}
            for method, points in samples.items()
        }
    context.mesh = None
    return found
