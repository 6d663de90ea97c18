"""Meshes of the same points by lloydar, Open3D's ball pivoting and CGAL's advancing front.

    python3 scripts/peers/meshes.py PROGRAM SCAN SPACING [FRONT]

SCAN is a file or directory that PROGRAM (lloydar) reads, FRONT the compiled front.cpp. Prints a row for each
method: seconds, triangles, open edges, edges with more than two triangles, points without a triangle,
smallest angles, and if SCAN is a simulated street the mean distance from the centres of the triangles to its true
surfaces. The seconds of lloydar are those of its stage "mesh", which reads the points and writes the
files; those of the others are for the triangles alone. The advancing front bridges gaps of any width: further rows are
for its triangles whose longest edge has so many spacings, and for those up to two spacings as a mesh of their own.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import open3d


def figures(points, triangles):
    """Edges with one triangle and with more than two, unused points, smallest angles."""
    pairs = np.sort(triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(pairs, axis=0, return_counts=True)
    corners = points[triangles]
    cosines = []
    for k in range(3):
        one = corners[:, (k + 1) % 3] - corners[:, k]
        other = corners[:, (k + 2) % 3] - corners[:, k]
        lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
        cosines.append((one * other).sum(axis=1) / np.maximum(lengths, 1e-300))
    angles = np.degrees(np.arccos(np.clip(np.max(cosines, axis=0), -1, 1)))
    unused = len(points) - len(np.unique(triangles))
    return [
        int((counts == 1).sum()),
        int((counts > 2).sum()),
        unused,
        *(round(float(np.percentile(angles, p)), 1) for p in (50, 1)),
    ]


def to_truth(program, scan, points, triangles):
    """The mean distance from the centres of the triangles to the true surfaces of a simulated street, in mm."""
    if not Path(scan, "street.json").exists() or len(triangles) < 2:
        return "–"
    with tempfile.TemporaryDirectory() as directory:
        centers = Path(directory, "centers.ply")
        coordinates = "".join(f"property double {axis}\n" for axis in "xyz")
        head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(triangles)}\n{coordinates}end_header\n"
        centers.write_bytes(head.encode() + points[triangles].mean(axis=1).astype("<f8").tobytes())
        words = [program, "measure", centers, "--truth", scan, "--json"]
        measured = subprocess.run(words, check=True, capture_output=True, text=True)
    return f"{1000 * json.loads(measured.stdout)['truth']['mean']:.2f}"


def front_rows(rows, taken, points, triangles, spacing):
    """Adds the rows of the advancing front: whole, without its long triangles, and these by their longest edges."""
    ends = points[triangles[:, [0, 1, 2]]] - points[triangles[:, [1, 2, 0]]]
    longest = np.linalg.norm(ends, axis=2).max(axis=1) / spacing
    rows.append(("CGAL, advancing front", taken, points, triangles))
    rows.append(("– edges up to 2 spacings", taken, points, triangles[longest <= 2]))
    for least, most in ((2, 3), (3, 4), (4, np.inf)):
        some = triangles[(longest > least) & (longest <= most)]
        rows.append((f"– longest edge {least} to {most} spacings", taken, points, some))


def main():
    program, scan, spacing = sys.argv[1], sys.argv[2], float(sys.argv[3])
    front = sys.argv[4] if len(sys.argv) > 4 else None
    rows = []
    with tempfile.TemporaryDirectory() as directory:
        cloud, mesh = Path(directory, "even.laz"), Path(directory, "even.ply")
        words = [program, "run", scan, "-o", cloud, "--spacing", str(spacing), "--mesh", mesh, "-q"]
        subprocess.run(words, check=True)
        report = json.loads(Path(f"{cloud}.report.json").read_text())
        seconds = {stage["stage"]: stage["seconds"] for stage in report["stages"]}
        ours = open3d.io.read_triangle_mesh(str(mesh))
        points, normals = np.asarray(ours.vertices), np.asarray(ours.vertex_normals)
        origin = points.mean(axis=0).round()
        points = points - origin
        job = sum(seconds.values())
        print(f"{len(points)} points; the whole job {job:.1f} s, of it the mesh {seconds['mesh']:.2f} s")
        # The others get the points that describe a surface: ball pivoting needs their normals.
        has_normal = np.linalg.norm(normals, axis=1) > 0.5
        rows.append(("lloydar", seconds["mesh"], points, np.asarray(ours.triangles)))
        points, normals = points[has_normal], normals[has_normal]

        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
        cloud.normals = open3d.utility.Vector3dVector(normals)
        radii = open3d.utility.DoubleVector([0.7 * spacing, spacing, 1.5 * spacing])
        begun = time.perf_counter()
        pivoted = open3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, radii)
        taken = time.perf_counter() - begun
        rows.append(("Open3D, ball pivoting", taken, points, np.asarray(pivoted.triangles)))

        if front:
            raw, found = Path(directory, "points"), Path(directory, "triangles")
            points.astype("<f8").tofile(raw)
            done = subprocess.run([front, raw, found], check=True, capture_output=True, text=True)
            triangles = np.fromfile(found, dtype="<u4").reshape(-1, 3).astype(np.int64)
            front_rows(rows, float(done.stdout), points, triangles, spacing)
    print("| triangles from | s | triangles | open edges | more than two | unused | median ° | 1 % ° | centres, mm |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, taken, points, triangles in rows:
        truth = to_truth(program, scan, points + origin, triangles)
        values = [f"{taken:.2f}", len(triangles), *figures(points, triangles), truth]
        print(f"| {name} | " + " | ".join(map(str, values)) + " |")


if __name__ == "__main__":
    main()
