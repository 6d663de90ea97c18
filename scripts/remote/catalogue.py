"""Reads the catalogue of tiles with pystac.

    catalogue.py PROGRAM WORK     WORK/street: the scans

Each item is validated against the schema of STAC 1.0 that pystac has, and its fields against those of the tile as the
program reads it. The schemas of extensions lie on a web server, and are not asked for.
"""

import json
import subprocess
import sys
from pathlib import Path

import pystac


def main(program, work):
    tiles = Path(work) / "tiles"
    for crs in ([], ["--crs", "EPSG:25832"]):
        subprocess.run(
            [program, "run", f"{work}/street", "-o", str(tiles), "--spacing", "0.5", "--iterations", "1",
             "--output-tiles", "50", "--quiet", "--overwrite", *crs],
            check=True,
        )
        catalogue = tiles / "tiles.vpc"
        items = pystac.ItemCollection.from_file(str(catalogue))
        counted = 0
        for item in items:
            # The core schema, without the extensions.
            content = item.to_dict(include_self_link=False)
            content["stac_extensions"] = []
            pystac.Item.from_dict(content).validate()
            tile = tiles / item.assets["data"].href
            header = json.loads(subprocess.check_output([program, "info", "--json", str(tile)]))
            assert item.properties["pc:count"] == header["points"], item.id
            box = item.properties["proj:bbox"]
            assert all(abs(a - b) < 1e-6 for a, b in zip(box, header["min"] + header["max"])), (item.id, box, header)
            west, south, _, east, north, _ = item.bbox
            assert -180 <= west <= east <= 180 and -90 <= south <= north <= 90 or not item.properties["proj:wkt2"]
            counted += header["points"]
        assert items.items and counted > 0
        print(f"pystac {pystac.__version__}: {len(items)} items, {counted} points, {' '.join(crs) or 'the CRS of the street'}")


if __name__ == "__main__":
    main(*sys.argv[1:])
