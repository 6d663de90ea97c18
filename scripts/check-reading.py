"""Reads a cloud that lloydar wrote, and the scans it was made from, with laspy,
and compares values: counts, bounds, CRS, and every attribute of every point with
an input point near it."""

import sys

import laspy
import numpy as np

out = laspy.read(sys.argv[1])
scans = [laspy.read(path) for path in sys.argv[2:]]
header = out.header

assert header.version == "1.4" and header.point_format.id in (6, 7, 8), header
assert header.system_identifier == "MODIFICATION", header.system_identifier
assert header.generating_software.startswith("lloydar "), header.generating_software
assert len(out.points) == header.point_count > 0

xyz = np.vstack([out.x, out.y, out.z]).T
assert np.allclose(xyz.min(0), header.mins, atol=1e-9) and np.allclose(xyz.max(0), header.maxs, atol=1e-9)
low = np.min([s.header.mins for s in scans], axis=0)
high = np.max([s.header.maxs for s in scans], axis=0)
assert (xyz.min(0) >= low - 1.0).all() and (xyz.max(0) <= high + 1.0).all()

wkt = [v for v in header.vlrs if v.record_id == 2112]
scan_wkt = [v for v in scans[0].header.vlrs if v.record_id == 2112]
assert bool(wkt) == bool(scan_wkt)
if wkt:
    assert wkt[0].string == scan_wkt[0].string
assert (np.asarray(out.return_number) == 1).all() and (np.asarray(out.number_of_returns) == 1).all()
assert header.number_of_points_by_return[0] == header.point_count

# Every output point carries all attributes of one input point: look for that
# point by what does not change, and be sure that it is near.
names = ["gps_time", "intensity", "classification", "point_source_id", "scan_angle"]
names += [n for n in ("red", "green", "blue") if n in out.point_format.dimension_names]
key = lambda las: np.rec.fromarrays([np.asarray(las[n]) for n in names])
inputs = np.concatenate([key(s) for s in scans])
places = np.concatenate([np.vstack([s.x, s.y, s.z]).T for s in scans])
order = np.argsort(inputs)
found = np.searchsorted(inputs[order], key(out))
assert (found < len(inputs)).all() and (inputs[order][found] == key(out)).all(), "attributes of no input point"
distance = np.linalg.norm(places[order][found] - xyz, axis=1)
assert np.quantile(distance, 0.999) < 2.0, distance.max()
print(f"{sys.argv[1].split('/')[-1]}: {len(out.points)} points read by laspy, all attributes found in the input")
