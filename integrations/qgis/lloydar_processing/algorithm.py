"""An algorithm of the provider: parameters in, a process of the program, figures and layers out."""

from __future__ import annotations

import html
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingFeedback,
    QgsProcessingOutputHtml,
    QgsProcessingOutputNumber,
    QgsProcessingUtils,
    QgsProviderRegistry,
)
from qgis.PyQt.QtGui import QIcon

from .command_lines import (
    ValueProblem,
    command_line,
    conflict,
    figures_of_job,
    figures_of_measure,
    header_sentences,
    job_directory,
    read_headers,
    report_path,
    shown,
)
from .descriptions import Algorithm, help_page
from .enumerations import HINT_MESH, HINT_POINT_CLOUD
from .log import Log
from .parameters import qgis_parameter, value_of
from .process import DONE, INCOMPLETE, Outcome, follow
from .program import ProgramError, ask_version, check_version


class LloydarAlgorithm(QgsProcessingAlgorithm):
    """The algorithm that a description describes."""

    def __init__(self, description: Algorithm, find: Callable[[], Path]) -> None:
        super().__init__()
        self._description = description
        self._find = find

    def createInstance(self) -> LloydarAlgorithm:  # noqa: N802
        """Return a new algorithm of this kind."""
        return LloydarAlgorithm(self._description, self._find)

    def name(self) -> str:
        """Return the part of the identifier behind the colon."""
        return self._description.identifier

    def displayName(self) -> str:  # noqa: N802
        """Return the name that the toolbox shows."""
        return self._description.title

    def shortHelpString(self) -> str:  # noqa: N802
        """Return the help beside the dialog."""
        return help_page(self._description)

    def shortDescription(self) -> str:  # noqa: N802
        """Return one sentence for tooltips."""
        return self._description.help.partition(". ")[0].rstrip(".") + "."

    def tags(self) -> list[str]:
        """Return the words by which the toolbox finds the algorithm."""
        return list(self._description.tags)

    def icon(self) -> QIcon:
        """Return the icon of the provider."""
        return QIcon(str(Path(__file__).with_name("icon.svg")))

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:  # noqa: N802
        """Add the parameters and the figures."""
        for parameter in self._description.parameters:
            self.addParameter(qgis_parameter(parameter))
        for name, meaning in self._description.figures.items():
            self.addOutput(QgsProcessingOutputNumber(name, meaning))
        if self._description.command in ("run", "render"):
            self.addOutput(QgsProcessingOutputHtml("REPORT", "Report"))

    def canExecute(self) -> tuple[bool, str]:  # noqa: N802
        """Return whether the program is there, and if not, how to get it."""
        try:
            self._find()
        except ProgramError as error:
            return False, str(error)
        return True, ""

    def checkParameterValues(  # noqa: N802
        self, parameters: dict[str, Any], context: QgsProcessingContext
    ) -> tuple[bool, str]:
        """Return whether the values go together, and if not, why."""
        problem = conflict(self._description, parameters)
        if problem:
            return False, problem
        return super().checkParameterValues(parameters, context)

    def processAlgorithm(  # noqa: N802
        self, parameters: dict[str, Any], context: QgsProcessingContext, feedback: QgsProcessingFeedback
    ) -> dict[str, Any]:
        """Run the program; return the files and figures."""
        described = self._description.parameters
        values = {parameter.name: value_of(self, parameter, parameters, context) for parameter in described}
        try:
            program = self._find()
            warning = check_version(ask_version(program), program)
            words = [str(program), *command_line(self._description, values)]
        except (ProgramError, ValueProblem) as error:
            raise QgsProcessingException(str(error)) from error
        if warning:
            feedback.pushWarning(warning)
        feedback.pushCommandInfo(shown(words))
        outcome, said = _run(words, feedback)
        if outcome.cancelled:
            # An exception, so that scripts and models do not take this for a success.
            raise QgsProcessingException(self._stopped(values))
        # Headers that could be read are listed beside errors about the others.
        has_headers = self._description.command == "info" and outcome.output.strip()
        if outcome.code not in (DONE, INCOMPLETE) and not has_headers:
            nothing = f"The program ended with code {outcome.code} and said nothing."
            raise QgsProcessingException("\n".join(said) or nothing)
        for line in said:
            feedback.pushWarning(line)
        if outcome.code == INCOMPLETE:
            feedback.pushWarning("The output is complete but for what had to be left out; the report says what.")
        return self._results(values, outcome.output, context, feedback)

    def _stopped(self, values: dict[str, Any]) -> str:
        """Return what a user who cancelled has to know."""
        directory = job_directory(values["OUTPUT"]) if self._description.command == "run" else None
        if directory is None or not directory.is_dir():
            return "Stopped."
        return (
            f"Stopped. What is done is kept in {directory}: the same call, with {values['OUTPUT']} as the output, "
            "continues it. Delete the directory to give the job up."
        )

    def _results(
        self, values: dict[str, Any], output: str, context: QgsProcessingContext, feedback: QgsProcessingFeedback
    ) -> dict[str, Any]:
        command = self._description.command
        results: dict[str, Any] = {
            parameter.name: values[parameter.name]
            for parameter in self._description.parameters
            if parameter.kind == "output" and values[parameter.name]
        }
        if command == "run":
            feedback.pushInfo(output)
            with open(report_path(values["OUTPUT"]), encoding="utf-8") as file:
                results.update(figures_of_job(json.load(file)))
            results["REPORT"] = f"{values['OUTPUT']}.report.html"
            if values["LOAD"]:
                _load(values, context, feedback)
        elif command == "measure":
            figures = figures_of_measure(output)
            results.update({name: figure for name, figure in figures.items() if figure is not None})
            for name, meaning in self._description.figures.items():
                if results.get(name) is not None:
                    figure = f"{results[name]:,}" if name == "POINTS" else f"{results[name]:.6g}"
                    feedback.pushInfo(f"{meaning}: {figure}")
            _write(values["OUTPUT"], output)
        elif command == "info":
            headers = read_headers(output)
            for header in headers:
                for line in header_sentences(header):
                    feedback.pushInfo(line)
                for note in header.get("notes") or []:
                    feedback.pushWarning(f"  {note}")
            results["FILES"] = len(headers)
            results["POINTS"] = sum(header.get("points") or 0 for header in headers)
            _write(values["OUTPUT"], json.dumps(headers, indent=2) + "\n")
        else:
            results["REPORT"] = _page_of_picture(values["OUTPUT"])
        return results


def _run(words: list[str], feedback: QgsProcessingFeedback) -> tuple[Outcome, list[str]]:
    """Run the program; return how it ended and the lines that are neither progress nor notes."""
    log = Log()
    others: list[str] = []

    def on_line(text: str) -> None:
        line = log.read(text)
        if line is None:
            return
        if line.kind == "progress":
            feedback.setProgress(log.percent)
            feedback.setProgressText(line.text)
        elif line.kind == "note":
            feedback.pushInfo(line.text)
        else:
            others.append(line.text)

    try:
        outcome = follow(words, on_line, feedback.isCanceled)
    except OSError as error:
        raise QgsProcessingException(f"{words[0]} cannot be started: {error}") from error
    if outcome.code in (DONE, INCOMPLETE):
        log.finish()
        feedback.setProgress(log.percent)
    return outcome, others


def _load(values: dict[str, Any], context: QgsProcessingContext, feedback: QgsProcessingFeedback) -> None:
    """Have the results added to the project when the algorithm is done."""
    cloud, mesh = values["OUTPUT"], values.get("MESH")
    if not cloud.lower().endswith((".laz", ".las")):
        feedback.pushInfo(f"QGIS shows no point clouds of this format: {cloud} is written, and not loaded.")
    elif "pdal" not in QgsProviderRegistry.instance().providerList():
        feedback.pushWarning(
            f"This QGIS is built without PDAL and shows no LAS, LAZ or COPC: {cloud} is written, and not loaded."
        )
    else:
        _add_layer(cloud, "OUTPUT", HINT_POINT_CLOUD, context)
    if mesh and mesh.lower().endswith(".ply"):
        _add_layer(mesh, "MESH", HINT_MESH, context)
    elif mesh:
        feedback.pushInfo(f"QGIS shows PLY as a mesh layer, no other format: {mesh} is written, and not loaded.")


def _add_layer(path: str, output: str, hint: Any, context: QgsProcessingContext) -> None:
    details = QgsProcessingContext.LayerDetails(Path(path).name.split(".")[0], context.project(), output, hint)
    context.addLayerToLoadOnCompletion(path, details)


def _write(path: str | None, text: str) -> None:
    if path:
        Path(path).write_text(text, encoding="utf-8")


def _page_of_picture(picture: str) -> str:
    """Write a page that shows the picture, for the viewer of results; return its path."""
    page = QgsProcessingUtils.generateTempFilename("picture.html")
    address = html.escape(Path(picture).absolute().as_uri(), quote=True)
    Path(page).write_text(f'<!doctype html><img src="{address}" style="max-width: 100%">\n', encoding="utf-8")
    return page
