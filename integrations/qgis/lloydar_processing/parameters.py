"""From descriptions of parameters to parameters of QGIS, and back from their values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qgis.core import (
    QgsMapLayer,
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingParameterBoolean,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterEnum,
    QgsProcessingParameterExtent,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterMultipleLayers,
    QgsProcessingParameterNumber,
    QgsProcessingParameterString,
    QgsProcessingUtils,
)

from .descriptions import Parameter
from .enumerations import ADVANCED, FILE, INTEGER, TYPE_FILE


def qgis_parameter(parameter: Parameter) -> QgsProcessingParameterDefinition:
    """Return the parameter of QGIS."""
    made = _of_kind(parameter)
    made.setHelp(parameter.help)
    if parameter.advanced:
        made.setFlags(made.flags() | ADVANCED)
    return made


def _of_kind(parameter: Parameter) -> QgsProcessingParameterDefinition:
    name, label, default, optional = parameter.name, parameter.label, parameter.default, parameter.optional
    kind = parameter.kind
    if kind == "files":
        return QgsProcessingParameterMultipleLayers(name, label, TYPE_FILE, default, optional)
    if kind == "file":
        return QgsProcessingParameterFile(
            name, label, FILE, defaultValue=default, optional=optional, fileFilter=parameter.filter
        )
    if kind == "text":
        return QgsProcessingParameterString(name, label, default, False, optional)
    if kind == "integer":
        least = {} if parameter.minimum is None else {"minValue": parameter.minimum}
        return QgsProcessingParameterNumber(name, label, INTEGER, default, optional, **least)
    if kind in ("choice", "choices"):
        # With static strings a value is a word, not a number that another order would change.
        return QgsProcessingParameterEnum(
            name, label, list(parameter.choices), kind == "choices", default, optional, usesStaticStrings=True
        )
    if kind == "switch":
        return QgsProcessingParameterBoolean(name, label, default, optional)
    if kind == "extent":
        return QgsProcessingParameterExtent(name, label, default, optional)
    if kind == "output":
        return QgsProcessingParameterFileDestination(
            name, label, parameter.filter, default, optional, createByDefault=not optional
        )
    raise ValueError(f"{name}: no such kind of parameter: {kind}")


def value_of(
    algorithm: QgsProcessingAlgorithm,
    parameter: Parameter,
    parameters: dict[str, Any],
    context: QgsProcessingContext,
) -> Any:
    """Return the value of a parameter as text, number, truth value or list; None if it is not given."""
    name, kind = parameter.name, parameter.kind
    if kind != "output" and parameters.get(name) is None and parameter.default is None:
        return None
    if kind == "files":
        return _files(algorithm, name, parameters, context)
    if kind == "file":
        return algorithm.parameterAsFile(parameters, name, context)
    if kind == "text":
        return algorithm.parameterAsString(parameters, name, context).strip()
    if kind == "integer":
        return algorithm.parameterAsInt(parameters, name, context)
    if kind == "choice":
        return algorithm.parameterAsEnumString(parameters, name, context)
    if kind == "choices":
        return algorithm.parameterAsEnumStrings(parameters, name, context)
    if kind == "switch":
        return algorithm.parameterAsBool(parameters, name, context)
    if kind == "extent":
        # The program has no other CRS than that of the scans, so the numbers are passed on as they are.
        extent = algorithm.parameterAsExtent(parameters, name, context)
        if extent.isNull():
            return None
        return [extent.xMinimum(), extent.yMinimum(), extent.xMaximum(), extent.yMaximum()]
    return algorithm.parameterAsFileOutput(parameters, name, context)


def _files(
    algorithm: QgsProcessingAlgorithm, name: str, parameters: dict[str, Any], context: QgsProcessingContext
) -> list[str]:
    """Return the files of a parameter; a layer, or the name of one, stands for its file."""
    value = parameters[name]
    if not isinstance(value, (list, tuple)):
        value = [value]
    plain = [item.source() if isinstance(item, QgsMapLayer) else item for item in value]
    files = []
    for text in algorithm.parameterAsFileList({name: plain}, name, context):
        layer = None if Path(text).exists() else QgsProcessingUtils.mapLayerFromString(text, context, False)
        files.append(layer.source() if layer is not None else text)
    return [file for file in files if file]
