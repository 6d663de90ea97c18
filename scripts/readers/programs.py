"""What CloudCompare, MeshLab, Blender, PyMeshLab and Open3D find in our files, a line for each program and file.

    programs.py FOLDER      with even.ply, mesh.ply, mesh.obj, mesh.glb, even.laz, even.copc.laz

Fails if a program that reads a file finds another number of points or faces than the file has, or other colours or
normals where it reads them.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

WORK = Path(sys.argv[1]).resolve()
PLY_TYPES = {"double": "<f8", "float": "<f4", "int": "<i4", "ushort": "<u2", "short": "<i2", "uchar": "u1"}


@dataclass
class Found:
    """What a program found: `None` where it cannot be known by its command line."""

    points: int
    faces: int = 0
    #: Mean colour, 0 to 255.
    color: np.ndarray | None = None
    has_normals: bool | None = None
    fields: str = ""
    #: The points as the program has them.
    places: np.ndarray | None = None


def vertices(path: Path) -> tuple[np.ndarray, int]:
    """Read the vertices of a binary PLY file, and the number of faces."""
    content = path.read_bytes()
    end = content.index(b"end_header\n") + len(b"end_header\n")
    counts, kinds, element = {}, [], ""
    for line in content[:end].decode().splitlines():
        words = line.split()
        if words[0] == "element":
            element = words[1]
            counts[element] = int(words[2])
        elif words[0] == "property" and element == "vertex":
            kinds.append((words[2], PLY_TYPES[words[1]]))
    return np.frombuffer(content, kinds, counts["vertex"], end), counts.get("face", 0)


def coordinates(array: np.ndarray) -> np.ndarray:
    return np.column_stack([array[axis] for axis in "xyz"]).astype(float)


def mean_color(array: np.ndarray) -> np.ndarray:
    return np.array([array[name].mean() for name in ("red", "green", "blue")])


def output_of(*words: str, environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(
        words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**os.environ, **(environment or {})}, check=False
    )
    return done.stdout.decode("utf-8", "replace").strip() or f"ended with code {done.returncode}"


def cloudcompare(path: Path) -> Found | str:
    """Open the file, and save what was found as text or as PLY."""
    out = WORK / "found"
    for old in WORK.glob("found*"):
        old.unlink()
    common = ["CloudCompare", "-SILENT", "-AUTO_SAVE", "OFF"]
    load = ["-O", "-GLOBAL_SHIFT", "AUTO", str(path)]
    if path.stem == "mesh":
        words = [*common, "-M_EXPORT_FMT", "PLY", *load, "-SAVE_MESHES", "FILE", str(out)]
        said = output_of(*words)
        saved = next(WORK.glob("found*"), None)
        if saved is None:
            return said.strip().splitlines()[-2].strip()
        array, faces = vertices(saved)
        names = array.dtype.names
        return Found(len(array), faces, mean_color(array) if "red" in names else None, "nx" in names)
    words = [*common, "-C_EXPORT_FMT", "ASC", "-PREC", "6", "-ADD_HEADER", *load, "-SAVE_CLOUDS", "FILE", str(out)]
    said = output_of(*words)
    saved = next(WORK.glob("found*"), None)
    if saved is None:
        return said.strip().splitlines()[-2].strip()
    with open(saved) as file:
        names = file.readline().lstrip("/").split()
    array = np.loadtxt(saved, skiprows=1)
    columns = dict(zip(names, array.T))
    color = np.array([columns[name].mean() for name in "RGB"]) if "R" in columns else None
    fields = [name for name in names if name not in "X Y Z R G B Nx Ny Nz".split()]
    return Found(len(array), 0, color, "Nx" in columns, ", ".join(fields), array[:, :3])


def meshlab(path: Path) -> Found | str:
    """Open the file under a virtual screen, and save what was found as PLY."""
    out = WORK / "found.ply"
    out.unlink(missing_ok=True)
    words = ["xvfb-run", "-a", "meshlabserver", "-i", str(path), "-o", str(out), "-m", "vc", "vn"]
    said = output_of(*words, environment={"QT_QPA_PLATFORM": "xcb"})
    if not out.exists():
        return said.strip().splitlines()[-1]
    array, faces = vertices(out)
    normals = np.column_stack([array[name] for name in ("nx", "ny", "nz")])
    return Found(len(array), faces, mean_color(array), bool(np.abs(normals).max() > 0.5), "", coordinates(array))


BLENDER = """
import functools, json, sys
import numpy
numpy.bool = bool  # An add-on of Debian's package needs a name that its numpy has dropped.
import bpy
path = sys.argv[-1]
bpy.ops.wm.read_factory_settings(use_empty=True)
read = {
    "ply": lambda: bpy.ops.wm.ply_import if bpy.app.version >= (3, 6) else bpy.ops.import_mesh.ply,
    "obj": lambda: functools.partial(bpy.ops.wm.obj_import, forward_axis="Y", up_axis="Z"),
    "glb": lambda: bpy.ops.import_scene.gltf,
}
read[path.rsplit(".")[-1]]()(filepath=path)
(mesh,) = [thing for thing in bpy.data.objects if thing.type == "MESH"]
data = mesh.data
color = None
if data.color_attributes:
    attribute = data.color_attributes[0]
    linear = numpy.array([value.color[:3] for value in attribute.data])
    if attribute.domain == "CORNER":
        # Of each vertex once.
        corners = numpy.array([loop.vertex_index for loop in data.loops])
        linear = linear[numpy.unique(corners, return_index=True)[1]]
    srgb = numpy.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    color = (255 * srgb.mean(axis=0)).tolist()
names = [a.name for a in data.attributes if not a.name.startswith(".") and a.name != "material_index"]
places = [(mesh.matrix_world @ vertex.co)[:] for vertex in data.vertices]
print("FOUND " + json.dumps([len(data.vertices), len(data.polygons), color, names, places]))
"""


def blender(path: Path) -> Found | str:
    """Import the file in the background."""
    if path.suffix not in (".ply", ".obj", ".glb"):
        return "no importer for this format"
    code = WORK / "blender.py"
    code.write_text(BLENDER)
    said = output_of("blender", "-b", "--factory-startup", "-P", str(code), "--", str(path))
    line = next((line for line in said.splitlines() if line.startswith("FOUND ")), None)
    if line is None:
        return said.strip().splitlines()[-1]
    points, faces, color, names, places = json.loads(line[6:])
    color = None if color is None else np.array(color)
    return Found(points, faces, color, None, ", ".join(names), np.array(places))


def pymeshlab(path: Path) -> Found | str:
    import pymeshlab as module

    meshes = module.MeshSet()
    try:
        meshes.load_new_mesh(str(path))
    except module.PyMeshLabException as error:
        return str(error).strip().splitlines()[0]
    mesh = meshes.current_mesh()
    color = 255 * mesh.vertex_color_matrix()[:, :3].mean(axis=0) if mesh.has_vertex_color() else None
    normals = bool(np.abs(mesh.vertex_normal_matrix()).max() > 0.5)
    return Found(mesh.vertex_number(), mesh.face_number(), color, normals, "", mesh.vertex_matrix())


def open3d(path: Path) -> Found | str:
    import open3d as module

    if path.suffix == ".laz":
        return "no reader for this format"
    if path.stem == "mesh":
        mesh = module.io.read_triangle_mesh(str(path))
        points, colors, normals = mesh.vertices, mesh.vertex_colors, mesh.has_vertex_normals()
        faces = len(mesh.triangles)
    else:
        cloud = module.io.read_point_cloud(str(path))
        points, colors, normals, faces = cloud.points, cloud.colors, cloud.has_normals(), 0
    color = 255 * np.asarray(colors).mean(axis=0) if len(colors) else None
    return Found(len(points), faces, color, normals, "", np.asarray(points))


PROGRAMS = {
    "CloudCompare": (cloudcompare, "CloudCompare"),
    "MeshLab": (meshlab, "meshlabserver"),
    "Blender": (blender, "blender"),
    "PyMeshLab": (pymeshlab, ""),
    "Open3D": (open3d, ""),
}


def is_there(name: str, command: str) -> bool:
    if command:
        return shutil.which(command) is not None and (name != "MeshLab" or shutil.which("xvfb-run") is not None)
    try:
        __import__(name.lower())
    except ImportError:
        return False
    return True


def main() -> None:
    cloud, _ = vertices(WORK / "even.ply")
    mesh, triangles = vertices(WORK / "mesh.ply")
    print(f"even.ply: {len(cloud)} points, mean colour {mean_color(cloud).round(1)}; mesh: {triangles} triangles")
    for name, (opens, command) in PROGRAMS.items():
        if not is_there(name, command):
            print(f"SKIPPED: {name} is not installed")
            continue
        for file in ("even.ply", "even.laz", "even.copc.laz", "mesh.ply", "mesh.obj", "mesh.glb"):
            found = opens(WORK / file)
            if isinstance(found, str):
                print(f"{name:13} {file:14} not read: {found[:120]}")
                continue
            said = f"{found.points} points, {found.faces} faces"
            said += "" if found.color is None else f", colour {found.color.round(1)}"
            said += "" if found.has_normals is None else f", normals: {found.has_normals}"
            said += f", {found.fields}" if found.fields else ""
            if found.places is not None and file.endswith(".ply"):
                gap = np.abs(coordinates(cloud if file == "even.ply" else mesh) - found.places).max()
                said += f", up to {gap:.3f} from their places"
            print(f"{name:13} {file:14} {said}")
            # Some leave vertices out that no triangle uses.
            assert found.points == len(cloud) or (file in ("mesh.obj", "mesh.glb") and found.points < len(mesh))
            assert found.faces == (triangles if file.startswith("mesh") else 0)
            if found.color is not None and file != "mesh.glb":
                # Where vertices are left out, the mean is another one by a little.
                assert np.abs(found.color - mean_color(cloud)).max() < 4, "colours are right"
            if file in ("even.ply", "mesh.ply"):
                # Blender's older importer knows colours at the corners of faces only.
                assert found.color is not None or (name, file) == ("Blender", "even.ply"), "colours are found"
                assert found.has_normals is not False, "normals are found"


main()
