"""Decodes scans with laspy, on all cores.

    decoding.py once SCAN…          decodes, does nothing else, and prints the seconds it took
    decoding.py ply OUT SCAN…       writes the points as uncompressed PLY
    decoding.py xyz OUT SCAN…       writes the points as three doubles each
"""

import sys
import time

import laspy
import numpy

from cloudcompare import write_ply

CHUNK = 1_000_000
BACKEND = laspy.LazBackend.LazrsParallel


def once(paths):
    """Seconds without the start of Python and its imports."""
    start = time.monotonic()
    for path in paths:
        with laspy.open(path, laz_backend=BACKEND) as scan:
            for _ in scan.chunk_iterator(CHUNK):
                pass
    return time.monotonic() - start


def read(paths):
    return numpy.vstack([laspy.read(path, laz_backend=BACKEND).xyz for path in paths])


if __name__ == "__main__":
    if sys.argv[1] == "once":
        print(once(sys.argv[2:]))
    elif sys.argv[1] == "ply":
        write_ply(read(sys.argv[3:]), sys.argv[2])
    else:
        read(sys.argv[3:]).astype("float64").tofile(sys.argv[2])
