"""Reads a cloud that lloydar wrote, and the scans it was made from, with independent
readers, and compares values.

    reading.py OUT SCAN...

laspy reads the scans and, through both of its decoders (lazrs, and LASzip, the reference),
the cloud; copclib reads the cloud with a third. Counts, bounds and CRS are compared, and every
attribute of every point with that of an input point near it.
"""

import sys

import copclib
import laspy
import numpy as np
from scipy.spatial import cKDTree

NEVER_CARRIED = {
    # Positions are new, and a resampled point is the only return of its place.
    "X", "Y", "Z", "return_number", "number_of_returns",
    # They would point into waveform packets that are not there.
    "wavepacket_index", "wavepacket_offset", "wavepacket_size", "return_point_wave_location",
    "x_t", "y_t", "z_t",
    # Told by another name in the formats from 6 on.
    "scan_angle_rank", "scan_angle", "raw_classification",
}


def read(path, backend=None):
    options = {} if backend is None else {"laz_backend": backend}
    return laspy.read(path, **options)


def places(las):
    return np.vstack([las.x, las.y, las.z]).T


def scan_angle(las):
    """In units of 0.006°, as the formats from 6 on have it."""
    if "scan_angle" in las.point_format.dimension_names:
        return np.asarray(las.scan_angle, dtype=float)
    return np.round(np.asarray(las.scan_angle_rank, dtype=float) / 0.006)


def wkt(las):
    for record in list(las.header.vlrs) + list(las.header.evlrs or []):
        if record.user_id.rstrip("\0") == "LASF_Projection" and record.record_id == 2112:
            text = getattr(record, "string", None) or record.record_data.decode()
            return text.rstrip("\0")
    return None


def attributes(las, names):
    columns = []
    for name in names:
        if name == "scan_angle":
            columns.append(scan_angle(las))
        elif name == "classification" and las.point_format.id < 6:
            # Class 12 meant overlap, which has a flag in the formats from 6 on.
            classes = np.asarray(las.classification)
            columns.append(np.where(classes == 12, 1, classes))
        elif name == "overlap" and las.point_format.id < 6:
            columns.append((np.asarray(las.classification) == 12).astype(np.uint8))
        elif name in las.point_format.dimension_names:
            columns.append(np.asarray(las[name]))
        else:
            columns.append(None)
    return columns


def mix(codes, column):
    """A number for each point that stands for `codes` and for the bits of `column`."""
    column = column.astype(np.float64) if column.dtype.kind == "f" else column
    for part in column.reshape(len(column), -1).T:
        part = np.ascontiguousarray(part)
        bits = part.view(np.uint64) if part.dtype.kind == "f" else part.astype(np.uint64)
        codes = (codes ^ bits) * np.uint64(0x9E3779B97F4A7C15)
        codes ^= codes >> np.uint64(29)
    return codes


def check(out_path, scan_paths):
    out = read(out_path)
    header = out.header
    scans = [read(path) for path in scan_paths]

    assert str(header.version) == "1.4" and header.point_format.id in (6, 7, 8), header
    assert header.generating_software.startswith("lloydar "), header.generating_software
    assert header.system_identifier == "MODIFICATION", header.system_identifier
    xyz = places(out)
    assert len(xyz) == header.point_count > 0, header.point_count
    assert header.number_of_points_by_return[0] == header.point_count
    assert (np.asarray(out.return_number) == 1).all()
    assert (np.asarray(out.number_of_returns) == 1).all()
    tolerance = 1e-9 * np.abs(xyz).max()
    assert np.allclose(xyz.min(0), header.mins, atol=tolerance), (xyz.min(0), header.mins)
    assert np.allclose(xyz.max(0), header.maxs, atol=tolerance), (xyz.max(0), header.maxs)

    # The other readers see the same.
    if out_path.endswith(".laz"):
        reference = read(out_path, laspy.LazBackend.Laszip)
        assert (places(reference) == xyz).all()
        for name in out.point_format.dimension_names:
            assert (np.asarray(reference[name]) == np.asarray(out[name])).all(), name
        third = copclib.LazReader(out_path)
        assert third.laz_config.las_header.point_count == len(xyz)
        points = third.GetPoints()
        seen = np.array([[p.x, p.y, p.z] for p in points])
        assert np.allclose(seen, xyz, atol=tolerance)
        assert ([p.intensity for p in points] == np.asarray(out.intensity)).all()

    scan_places = np.concatenate([places(scan) for scan in scans])
    reach = np.linalg.norm(scan_places.max(0) - scan_places.min(0)) * 0.2 + 10.0
    assert (xyz >= scan_places.min(0) - reach).all() and (xyz <= scan_places.max(0) + reach).all()
    text = next((text for text in map(wkt, scans) if text), None)
    if text:
        assert wkt(out) == text, (wkt(out), text)
    geotiff = any(v.record_id == 34735 for s in scans for v in s.header.vlrs)
    crs = "WKT" if text else "from GeoTIFF keys" if geotiff and wkt(out) else "none"

    # All attributes of one input point: mixed into one number, to be compared at once.
    names = [n for n in out.point_format.dimension_names if n not in NEVER_CARRIED]
    names.append("scan_angle")
    ours, theirs = attributes(out, names), [attributes(scan, names) for scan in scans]
    codes_in = np.zeros(len(scan_places), dtype=np.uint64)
    codes_out = np.zeros(len(xyz), dtype=np.uint64)
    carried = 0
    for k, name in enumerate(names):
        missing = any(columns[k] is None for columns in theirs)
        if missing and len(scans) > 1:
            continue
        if missing:
            # The formats from 6 on have it, the scan has not.
            assert name in ("gps_time", "scanner_channel"), name
            assert (np.asarray(ours[k]) == 0).all(), name
            continue
        codes_in = mix(codes_in, np.concatenate([columns[k] for columns in theirs]))
        codes_out = mix(codes_out, ours[k])
        carried += 1
    # The attributes are those of an input point, the nearest of those that thinning keeps: others may
    # be nearer by a voxel at the most.
    apart = cKDTree(xyz).query(xyz, 2)[0][:, 1] if len(xyz) > 1 else np.zeros(1)
    voxel = tolerance + 0.5 * np.median(apart[np.isfinite(apart)])
    known = np.isin(codes_out, codes_in)
    assert known.all(), f"{(~known).sum()} points have the attributes of no input point"
    tree = cKDTree(scan_places)
    missing, near = np.arange(len(xyz)), min(4, len(scan_places))
    while len(missing):
        away, found = tree.query(xyz[missing], near)
        away, found = away.reshape(-1, near), found.reshape(-1, near)
        nearest = away <= away[:, :1] + voxel
        same = nearest & (codes_in[found] == codes_out[missing, None])
        # Of many points at one place some may not have been asked for.
        undecided = nearest.all(1) & ~same.any(1) & (near < len(scan_places))
        wrong = ~same.any(1) & ~undecided
        assert not wrong.any(), f"{wrong.sum()} points have the attributes of another place"
        missing, near = missing[undecided], min(8 * near, len(scan_places))
    kept = described(out, scans)
    return (
        f"{len(xyz)} points of format {header.point_format.id}, {carried} attributes of the "
        f"nearest point, {kept} extra bytes as described, CRS {crs}"
    )


def described(out, scans):
    """Extra bytes keep their descriptions, GPS times their kind."""
    ours = {d.name: d for d in out.point_format.extra_dimensions}
    for scan in scans:
        texts = [
            [bytes(v.record_data) for v in las.header.vlrs if (v.user_id, v.record_id) == ("LASF_Spec", 3)]
            for las in (out, scan)
        ]
        assert texts[1][:1] in ([], texts[0]), texts
        for theirs in scan.point_format.extra_dimensions:
            mine = ours[theirs.name]
            same = (mine.kind, mine.num_bits, mine.description, str(mine.scales), str(mine.offsets))
            assert same == (
                theirs.kind,
                theirs.num_bits,
                theirs.description,
                str(theirs.scales),
                str(theirs.offsets),
            ), (mine, theirs)
        if "gps_time" in scan.point_format.dimension_names:
            kinds = out.header.global_encoding, scan.header.global_encoding
            assert kinds[0].gps_time_type == kinds[1].gps_time_type, kinds
    return len(ours)


if __name__ == "__main__":
    print(check(sys.argv[1], sys.argv[2:]))
