"""Sends every point format, LAS and LAZ, with and without extra bytes, through lloydar and back.

    formats.py PROGRAM WORK

laspy writes a wavy sheet in each; every attribute is compared in LAZ, LAS, COPC and PLY.
"""

import pathlib
import subprocess
import sys

import laspy
import numpy as np

import reading

PROGRAM, WORK = sys.argv[1], pathlib.Path(sys.argv[2])
POINTS = 12_000
EXTRAS = [
    ("u8", "uint8", None, None),
    ("i8", "int8", None, None),
    ("u16", "uint16", None, None),
    ("i16", "int16", 0.01, 5.0),
    ("u32", "uint32", None, None),
    ("i32", "int32", 0.001, -100.0),
    ("u64", "uint64", None, None),
    ("i64", "int64", None, None),
    ("f32", "float32", None, None),
    ("f64", "float64", None, None),
    ("three", "3float32", None, None),
]
WKT = (
    'COMPD_CS["UTM 33N + height",PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84",'
    'DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],'
    'PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",15],'
    'PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],'
    'PARAMETER["false_northing",0],UNIT["metre",1],AUTHORITY["EPSG","32633"]],'
    'VERT_CS["EGM2008 height",VERT_DATUM["EGM2008 geoid",2005],UNIT["metre",1]]]'
)


def scan(point_format, has_extras, is_standard_time):
    random = np.random.default_rng(point_format)
    version = "1.4" if point_format > 5 else "1.3" if point_format > 3 else "1.2"
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales, header.offsets = [0.001, 0.002, 0.001], [431_000, 5_400_000, 0]
    if is_standard_time:
        header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    if point_format > 5:
        header.global_encoding.wkt = True
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(WKT))
    header.vlrs.append(laspy.VLR("LASF_Spec", 3, "Text area", b"a wavy sheet"))
    if has_extras:
        for name, kind, scale, offset in EXTRAS:
            size = 3 if kind[0] == "3" else 1
            header.add_extra_dim(
                laspy.ExtraBytesParams(
                    name=name,
                    type=kind,
                    description=f"a {kind}",
                    scales=None if scale is None else np.full(size, scale),
                    offsets=None if offset is None else np.full(size, offset),
                )
            )
    las = laspy.LasData(header)
    x, y = random.uniform(0, 20, (2, POINTS))
    las.x, las.y = 431_000 + x, 5_400_000 + y
    las.z = np.sin(x / 3) + np.cos(y / 4) + random.normal(0, 0.004, POINTS)
    for name in las.point_format.standard_dimension_names:
        if name in ("X", "Y", "Z", "x_t", "y_t", "z_t") or "wave" in name:
            continue
        column = las[name]
        if np.asarray(column).dtype.kind == "f":
            las[name] = np.sort(random.uniform(1e5, 3e5, POINTS))
        elif name == "scan_angle_rank":
            las[name] = random.integers(-90, 91, POINTS)
        elif name == "scan_angle":
            las[name] = random.integers(-15_000, 15_001, POINTS)
        elif name == "classification":
            las[name] = random.integers(0, 32 if point_format < 6 else 256, POINTS)
        else:
            bits = las.point_format.dimension_by_name(name).num_bits
            las[name] = random.integers(0, 2**bits, POINTS)
    for dimension in las.point_format.extra_dimensions:
        raw = las.points.array[dimension.name]
        if raw.dtype.kind == "f":
            raw[:] = random.normal(0, 1e3, raw.shape)
        else:
            limits = np.iinfo(raw.dtype)
            raw[:] = random.integers(limits.min, limits.max, raw.shape, dtype=raw.dtype)
    return las


def run(inputs, out, *options):
    command = [PROGRAM, "run", *map(str, inputs), "-o", str(out), "--overwrite", "--quiet"]
    done = subprocess.run(command + list(options), capture_output=True, text=True)
    assert done.returncode == 0, (command, done.stderr)


for point_format in range(11):
    for ending in ("las", "laz"):
        for has_extras in (False, True):
            name = f"{point_format}-{has_extras:d}"
            path = WORK / f"in-{name}.{ending}"
            scan(point_format, has_extras, point_format % 2 == 1).write(path)
            said = []
            for out_ending in ("laz", "las", "copc.laz"):
                out = WORK / f"out-{name}.{out_ending}"
                run([path], out, "--spacing", "0.4")
                said.append(reading.check(str(out), [str(path)]))
            assert len(set(said)) == 1, said
            # To PLY and back: the same points, the same attributes.
            ply, back = WORK / f"out-{name}.ply", WORK / f"back-{name}.laz"
            run([path], ply, "--spacing", "0.4")
            run([ply], back, "--spacing", "0.01", "--iterations", "0", "--fill", "0")
            before, after = laspy.read(WORK / f"out-{name}.laz"), laspy.read(back)
            assert after.header.point_format.id == before.header.point_format.id
            assert reading.wkt(after) == reading.wkt(before)
            assert len(after.points) == len(before.points), (len(after.points), len(before.points))
            order = [np.lexsort([las.x, las.y]) for las in (before, after)]
            for dimension in before.point_format.dimension_names:
                if dimension in ("X", "Y", "Z", "three", "u64", "i64"):
                    continue
                columns = [np.asarray(las[dimension])[o] for las, o in zip((before, after), order)]
                assert (columns[0] == columns[1]).all(), dimension
            print(f"format {point_format}, {ending}: {said[0]}; and by PLY")
