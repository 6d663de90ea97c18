"""Values of enumerations that QGIS 3.36 moved into the class `Qgis`; the old names are gone in Qt 6 builds to come."""

from __future__ import annotations

from typing import Any

from qgis import core


def _value(new: str, old: str) -> Any:
    """Return what the dotted name `new` means, or, in a QGIS that lacks it, what `old` means."""
    for dotted in (new, old):
        found: Any = core
        for name in dotted.split("."):
            found = getattr(found, name, None)
        if found is not None:
            return found
    raise AttributeError(f"QGIS has neither {new} nor {old}")


TYPE_FILE = _value("Qgis.ProcessingSourceType.File", "QgsProcessing.TypeFile")
ADVANCED = _value("Qgis.ProcessingParameterFlag.Advanced", "QgsProcessingParameterDefinition.FlagAdvanced")
INTEGER = _value("Qgis.ProcessingNumberParameterType.Integer", "QgsProcessingParameterNumber.Integer")
FILE = _value("Qgis.ProcessingFileParameterBehavior.File", "QgsProcessingParameterFile.File")
HINT_POINT_CLOUD = _value("QgsProcessingUtils.LayerHint.PointCloud", "QgsProcessingUtils.LayerHint.UnknownType")
HINT_MESH = _value("QgsProcessingUtils.LayerHint.Mesh", "QgsProcessingUtils.LayerHint.UnknownType")
