"""The plug-in's modules that import no QGIS are imported from their folder."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
