"""Programs that others thin points with, as functions of the points and a length."""

import ctypes
import importlib.util
from pathlib import Path


def load_libusb():
    """Open3D is linked with libusb; where the system has none, that of a package stands in."""
    found = importlib.util.find_spec("libusb_package")
    for folder in found.submodule_search_locations if found else []:
        for library in Path(folder).glob("libusb*.so*"):
            ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)


def by_open3d_voxels(points, size):
    """Means of the points in cubes with edges of `size`."""
    load_libusb()
    import numpy as np
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    return np.asarray(cloud.voxel_down_sample(size).points)


def by_pymeshlab(points, radius):
    """MeshLab's "Point Cloud Simplification": Poisson-disk points of the scan, `radius` apart."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(points))
    meshes.generate_simplified_point_cloud(radius=pymeshlab.PureValue(radius))
    return meshes.current_mesh().vertex_matrix()
