"""The plug-in in QGIS's Python, as windows use it: progress, Cancel, layers, the setting.

    in_qgis.py PROGRAM WORK PYTHON_WITH_LASPY
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path

from qgis.core import (
    QgsApplication,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingUtils,
    QgsProject,
    QgsProviderRegistry,
    QgsSettings,
)

PROGRAM, WORK, LASPY = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
SCANS = WORK / "scans"
sys.path.insert(0, os.environ["QGIS_PLUGINPATH"])
SETTING = "Processing/Configuration/LLOYDAR_PROGRAM"


class Feedback(QgsProcessingFeedback):
    """What a dialog shows."""

    def __init__(self) -> None:
        super().__init__()
        self.shares: list[float] = []
        self.texts: list[str] = []
        self.progressChanged.connect(self.shares.append)

    def setProgressText(self, text: str) -> None:  # noqa: N802
        self.texts.append(text)

    def pushInfo(self, text: str) -> None:  # noqa: N802
        self.texts.append(text)

    def reportError(self, text: str, fatalError: bool = False) -> None:  # noqa: N802, N803
        self.texts.append(text)

    def pushWarning(self, text: str) -> None:  # noqa: N802
        self.texts.append(text)


def run(name: str, parameters: dict, feedback: Feedback) -> tuple[dict, bool, QgsProcessingContext]:
    algorithm = QgsApplication.processingRegistry().algorithmById(f"lloydar:{name}")
    context = QgsProcessingContext()
    context.setProject(QgsProject.instance())
    fits, why = algorithm.checkParameterValues(parameters, context)
    assert fits, why
    results, is_done = algorithm.run(parameters, context, feedback)
    return results, is_done, context


def loads_layers() -> None:
    cloud, mesh = str(WORK / "layer.copc.laz"), str(WORK / "layer.ply")
    feedback = Feedback()
    parameters = {"INPUT": [str(SCANS)], "SPACING": "0.3", "OUTPUT": cloud, "MESH": mesh}
    results, is_done, context = run("mesh", parameters, feedback)
    assert is_done, feedback.texts
    assert feedback.shares == sorted(feedback.shares) and feedback.shares[-1] == 100, feedback.shares
    assert any(text.startswith("Solving tiles") for text in feedback.texts), feedback.texts
    loaded = context.layersToLoadOnCompletion()
    layers = {path: QgsProcessingUtils.mapLayerFromString(path, context) for path in loaded}
    assert layers[mesh].isValid() and layers[mesh].meshFaceCount() == results["TRIANGLES"]
    assert layers[mesh].meshVertexCount() == results["POINTS"]
    print(f"mesh layer: {results['TRIANGLES']} faces between {results['POINTS']} vertices")
    if "pdal" in QgsProviderRegistry.instance().providerList():
        assert layers[cloud].isValid() and layers[cloud].pointCount() == results["POINTS"]
        print(f"point cloud layer: {layers[cloud].pointCount()} points, {layers[cloud].crs().authid()}")
    else:
        assert cloud not in loaded and any("without PDAL" in text for text in feedback.texts)
        code = "import laspy, sys; print(len(laspy.read(sys.argv[1]).points))"
        read = int(subprocess.run([LASPY, "-c", code, cloud], check=True, capture_output=True).stdout)
        assert read == results["POINTS"]
        print(f"this QGIS has no PDAL: the cloud is read by laspy instead, {read} points; the plug-in says so")
    _, _, context = run("mesh", {**parameters, "LOAD": False}, Feedback())
    assert not context.layersToLoadOnCompletion()


def cancels_and_continues() -> None:
    """Cancel from another thread, as the button of a dialog does."""
    common = {"INPUT": [str(SCANS)], "SPACING": "0.08", "MEMORY": "256MiB", "LOAD": False}
    whole, parts = WORK / "whole-2.laz", WORK / "parts-2.laz"
    assert run("resample", {**common, "OUTPUT": str(whole)}, Feedback())[1]
    feedback = Feedback()

    def press() -> None:
        while not any(text.startswith("Solving tiles; 1 of") for text in feedback.texts):
            time.sleep(0.05)
        feedback.cancel()

    pressing = threading.Thread(target=press, daemon=True)
    pressing.start()
    start = time.monotonic()
    _, is_done, _ = run("resample", {**common, "OUTPUT": str(parts)}, feedback)
    assert not is_done
    assert not parts.exists() and Path(f"{parts}.job").is_dir()
    assert any("the same call" in text for text in feedback.texts), feedback.texts
    stopped = time.monotonic() - start
    results, is_done, _ = run("resample", {**common, "OUTPUT": str(parts)}, Feedback())
    assert is_done and whole.read_bytes() == parts.read_bytes()
    print(f"cancelled after {stopped:.1f} s, continued to the same bytes: {results['POINTS']} points")


def a_setting_is_used_and_a_wrong_one_is_said() -> None:
    algorithm = QgsApplication.processingRegistry().algorithmById("lloydar:info")
    QgsSettings().setValue(SETTING, str(WORK / "nowhere"))
    can, why = algorithm.canExecute()
    assert not can and "setting" in why, why
    QgsSettings().setValue(SETTING, str(PROGRAM))
    assert algorithm.canExecute()[0]
    os.environ["PATH"] = "/usr/bin:/bin"
    results, is_done, _ = run("info", {"INPUT": [str(SCANS)]}, Feedback())
    assert is_done and results["FILES"] == 2
    print("the setting is used; a wrong one is said before the algorithm runs")


def main() -> None:
    application = QgsApplication([], False)
    application.initQgis()
    from lloydar_processing import classFactory

    plugin = classFactory(None)
    plugin.initProcessing()
    os.environ["PATH"] = f"{PROGRAM.parent}:{os.environ['PATH']}"
    loads_layers()
    cancels_and_continues()
    a_setting_is_used_and_a_wrong_one_is_said()
    plugin.unload()
    assert QgsApplication.processingRegistry().providerById("lloydar") is None
    application.exitQgis()


main()
