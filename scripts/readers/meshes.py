"""Reads files of meshes with trimesh, Open3D and PyMeshLab, and checks what they find.

    meshes.py DIR

Files of one name and different endings are one mesh: their numbers of vertices and triangles and their
world coordinates have to agree, those of GLB by way of its origin. Spheres have to be closed, with the
volume of a sphere. The tiles of a tileset have to be inside of their boxes, which have to be nested, with
errors that do not grow towards the leaves. What is not installed is skipped, and named.
"""

import importlib
import json
import pathlib
import struct
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "peers"))
from thinning import load_libusb  # noqa: E402

DIRECTORY = pathlib.Path(sys.argv[1]).resolve()
ENDINGS = (".ply", ".obj", ".glb")
# Of a glTF mesh, y up, to z up: what viewers of 3D Tiles do.
Z_UP = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)
# Single precision, of coordinates within a kilometre of the origin.
TOLERANCE = 1e-4


def readers():
    """The function of each reader: from a path to vertices, triangles and colours, or None if empty."""
    load_libusb()
    found = {}
    for name, read in (("trimesh", with_trimesh), ("open3d", with_open3d), ("pymeshlab", with_pymeshlab)):
        try:
            module = importlib.import_module(name)
        except ImportError as error:
            print(f"SKIPPED: {name} cannot be used: {error}")
            continue
        found[name] = lambda path, module=module, read=read: read(module, path)
    return found


def with_trimesh(trimesh, path):
    loaded = trimesh.load(path, process=False)
    mesh = loaded if hasattr(loaded, "vertices") else loaded.to_geometry() if loaded.geometry else None
    if mesh is None or len(mesh.vertices) == 0:
        return None
    faces = getattr(mesh, "faces", np.empty((0, 3), int))
    if path.stem == "sphere":
        assert mesh.is_watertight and mesh.is_winding_consistent, path
        sphere = 4 / 3 * np.pi * 10**3
        assert 0.95 * sphere < mesh.volume < sphere, (path, mesh.volume)
    return np.asarray(mesh.vertices), np.asarray(faces)


def with_open3d(open3d, path):
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    mesh = open3d.io.read_triangle_mesh(str(path))
    if len(mesh.vertices) == 0:
        return None
    if path.stem == "sphere":
        assert mesh.has_vertex_normals() and mesh.has_vertex_colors(), path
        outwards = np.asarray(mesh.vertices) - np.asarray(mesh.vertices).mean(axis=0)
        along = np.sum(np.asarray(mesh.vertex_normals) * outwards, axis=1)
        # One normal is unknown.
        assert (along > 9).sum() >= len(along) - 1, path
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles)


def with_pymeshlab(pymeshlab, path):
    meshes = pymeshlab.MeshSet()
    try:
        meshes.load_new_mesh(str(path))
        mesh = meshes.current_mesh()
    except pymeshlab.PyMeshLabException as error:
        # An empty OBJ or GLB is an error to it.
        if "No vertex found" in str(error) or "no current Mesh" in str(error):
            return None
        raise
    if mesh.vertex_number() == 0:
        return None
    if path.stem == "sphere":
        colors = mesh.vertex_color_matrix()[:, :3]
        assert mesh.has_vertex_color() and (np.abs(colors[0, :2] - 0.5) < 0.3).all(), path
    vertices = mesh.vertex_matrix()
    if path.suffix == ".glb":
        # It does not apply the matrix of the node.
        vertices = vertices if not needs_matrix(vertices, path) else transformed(vertices, matrix_of(path))
    return vertices, mesh.face_matrix()


def document_of(path):
    """The JSON of a GLB file."""
    content = path.read_bytes()
    (length,) = struct.unpack("<I", content[12:16])
    return json.loads(content[20 : 20 + length])


def matrix_of(path):
    return np.array(document_of(path)["nodes"][0]["matrix"]).reshape(4, 4).T


def needs_matrix(vertices, path):
    bounds = document_of(path)["accessors"][0]
    return np.abs(vertices.min(axis=0) - bounds["min"]).max() < TOLERANCE


def transformed(vertices, matrix):
    return vertices @ matrix[:3, :3].T + matrix[:3, 3]


def in_world(vertices, path):
    """World coordinates of what a reader has found in a file."""
    if path.suffix != ".glb":
        return vertices
    return transformed(vertices, Z_UP) + document_of(path)["nodes"][0]["extras"]["origin"]


def check_mesh(paths, found_readers):
    """Checks the files of one mesh against each other; what is found first is the standard."""
    standard = {}
    for path in paths:
        for name, read in found_readers.items():
            found = read(path)
            if found is None:
                # Open3D reads no OBJ, and nobody a GLB, without triangles.
                assert path.stem not in ("sphere", "hills"), f"{name} finds nothing in {path}"
                continue
            vertices, triangles = in_world(found[0], path), found[1]
            assert np.isfinite(vertices).all(), (name, path)
            if "vertices" not in standard:
                standard = {"vertices": vertices, "triangles": triangles}
            assert triangles.shape == standard["triangles"].shape, (name, path, triangles.shape)
            alike = [vertices, standard["vertices"]]
            if len(vertices) != len(standard["vertices"]):
                # Some leave out points that are no corner of a triangle.
                alike = [vertices[np.unique(triangles)], alike[1][np.unique(standard["triangles"])]]
            assert alike[0].shape == alike[1].shape, (name, path, vertices.shape)
            # Readers change the order of vertices. Open3D reads OBJ in single precision.
            tolerance = 0.5 if (name, path.suffix) == ("open3d", ".obj") else TOLERANCE
            difference = np.sort(alike[0], axis=0) - np.sort(alike[1], axis=0)
            assert np.abs(difference).max() < tolerance, (name, path)
            if len(triangles) > 0 and tolerance == TOLERANCE:
                areas = area_vectors(vertices, triangles) - area_vectors(**standard)
                assert np.abs(areas).max() < 0.1, (name, path, areas)


def area_vectors(vertices, triangles):
    """The sum of the areas of triangles as vectors along their normals, and that of their lengths."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    areas = 0.5 * np.cross(b - a, c - a)
    return np.append(areas.sum(axis=0), np.linalg.norm(areas, axis=1).sum())


def corners_of(box):
    centre, axes = np.array(box[:3]), np.array(box[3:]).reshape(3, 3)
    return centre - axes.diagonal(), centre + axes.diagonal()


def check_tile(tile, outer, error, transform, folder, read):
    """Checks a tile, its content and those below; returns the number of contents."""
    low, high = corners_of(tile["boundingVolume"]["box"])
    assert (low >= outer[0] - 1e-9).all() and (high <= outer[1] + 1e-9).all(), "a box is not inside of the one above"
    assert tile["geometricError"] <= error, "an error grows towards the leaves"
    contents = 0
    if "content" in tile:
        path = folder / tile["content"]["uri"]
        vertices = transformed(read(path)[0], Z_UP)
        assert (vertices >= low - 1e-6).all() and (vertices <= high + 1e-6).all(), f"{path} is not inside of its box"
        world = transformed(vertices, transform)
        origin = document_of(path)["nodes"][0]["extras"]["origin"]
        assert np.abs(world - vertices - origin).max() < 1e-6, f"{path} is not where its origin says"
        contents = 1
    for child in tile.get("children", []):
        contents += check_tile(child, (low, high), tile["geometricError"], transform, folder, read)
    return contents


def check_tileset(path, read):
    tileset = json.loads(path.read_text())
    assert tileset["asset"]["version"] == "1.1"
    root = tileset["root"]
    transform = np.array(root["transform"]).reshape(4, 4).T
    everywhere = np.full(3, -np.inf), np.full(3, np.inf)
    contents = check_tile(root, everywhere, tileset["geometricError"], transform, path.parent, read)
    files = len(list(path.parent.glob("*.glb")))
    assert contents == files, f"{path} has {contents} contents, its directory {files}"
    print(f"{path.parent.name}/{path.name}: {contents} tiles, inside of their boxes")


def main():
    found_readers = readers()
    tilesets = sorted(DIRECTORY.rglob("tileset.json"))
    in_tilesets = {tileset.parent for tileset in tilesets}
    meshes = {}
    for ending in ENDINGS:
        for path in DIRECTORY.rglob("*" + ending):
            if path.parent not in in_tilesets:
                meshes.setdefault(path.with_suffix(""), []).append(path)
    for name, paths in sorted(meshes.items()):
        check_mesh(paths, found_readers)
        print(f"{name.name}: {', '.join(path.suffix for path in paths)} are one mesh to {', '.join(found_readers)}")
    for tileset in tilesets:
        if "trimesh" in found_readers:
            check_tileset(tileset, found_readers["trimesh"])
    assert meshes or tilesets, f"there are no meshes in {DIRECTORY}"


main()
