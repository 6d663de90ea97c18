"""Results of commands: the figures of the program's JSON, by name, with the main ones as attributes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ._pages import figure, table

__all__ = ["Measured", "Plan", "Record", "Report"]


class Record(Mapping[str, Any]):
    """Figures by name, as the command prints them in JSON.

    A figure that does not exist, such as the deviation of nothing, is NaN.
    """

    #: Names of the figures that are shown.
    _shown: tuple[str, ...] = ()

    def __init__(self, figures: Mapping[str, Any]) -> None:
        self._figures = {name: _without_null(name, value) for name, value in figures.items()}

    def __getitem__(self, name: str) -> Any:
        return self._figures[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._figures)

    def __len__(self) -> int:
        return len(self._figures)

    def _rows(self) -> list[tuple[str, Any]]:
        return [(name, self[name]) for name in self._shown]

    def __repr__(self) -> str:
        rows = ", ".join(f"{name} {figure(value)}" for name, value in self._rows())
        return f"<lloydar.{type(self).__name__}: {rows}>"

    def _repr_html_(self) -> str:
        return table(self._rows())


def _without_null(name: str, value: Any) -> Any:
    if name == "uniformity":
        return {name: math.nan if value is None else value for name, value in value.items()}
    return value


class Report(Record):
    """The report of a job: the figures of ``OUTPUT.report.json``."""

    _shown = ("points", "spacing")

    @property
    def output(self) -> Path:
        """The cloud that was written."""
        return Path(self["output"])

    @property
    def page(self) -> Path:
        """The report as a page, beside the output."""
        return Path(f"{self['output']}.report.html")

    @property
    def points(self) -> int:
        """Number of points of the output."""
        return int(self["points"])

    @property
    def spacing(self) -> float:
        """Spacing of the output, in units of the CRS."""
        return float(self["spacing"])

    @property
    def uniformity(self) -> dict[str, float]:
        """How evenly the points are spread."""
        return dict(self["uniformity"])

    @property
    def notes(self) -> list[str]:
        """Facts about inputs and points that are worth a line."""
        return list(self["notes"])

    @property
    def is_complete(self) -> bool:
        """Whether no point and no input had to be left out."""
        inputs = self["inputs"]
        return all(not entry["rejected"] and not entry.get("left_out") for entry in inputs)

    def _rows(self) -> list[tuple[str, Any]]:
        figures = self.uniformity
        return [
            ("output", self.output.name),
            *super()._rows(),
            ("delta", figures["delta"]),
            ("energy ratio", figures["energy_ratio"]),
        ]


class Plan(Record):
    """What a job would take."""

    _shown = ("points", "points_out", "spacing", "memory", "temporary", "seconds")

    @property
    def points(self) -> int:
        """Number of points of the inputs."""
        return int(self["points"])

    @property
    def points_out(self) -> int:
        """Approximate number of points of the output."""
        return int(self["points_out"])

    @property
    def spacing(self) -> float:
        """Spacing of the output, in units of the CRS."""
        return float(self["spacing"])

    @property
    def tiles(self) -> int:
        """Number of tiles."""
        return len(self["plan"]["tiles"])

    @property
    def memory(self) -> int:
        """Peak memory in bytes."""
        return int(self["memory"])

    @property
    def temporary(self) -> int:
        """Bytes of temporary files."""
        return int(self["temporary"])

    @property
    def seconds(self) -> float:
        """Approximate time of the whole job."""
        return float(self["seconds"])


class Measured(Record):
    """How even a cloud is, and how near to what it is compared with."""

    _shown = ("points", "spacing")

    @property
    def points(self) -> int:
        """Number of points; coincident points count each."""
        return int(self["points"])

    @property
    def spacing(self) -> float:
        """Estimated spacing of a hexagonal lattice with as many points on the surface."""
        return float(self["spacing"])

    @property
    def uniformity(self) -> dict[str, float]:
        """How evenly the points are spread."""
        return dict(self["uniformity"])

    @property
    def accuracy(self) -> dict[str, float] | None:
        """Distances from the cloud to the nearest points of `against`: mean, p99, max and others."""
        return self["accuracy"]  # type: ignore[no-any-return]

    @property
    def coverage(self) -> dict[str, float] | None:
        """Distances from the points of `against` to the nearest points of the cloud."""
        return self["coverage"]  # type: ignore[no-any-return]

    @property
    def truth(self) -> dict[str, float] | None:
        """Distances from the cloud to the surfaces of a simulated street."""
        return self["truth"]  # type: ignore[no-any-return]

    def _rows(self) -> list[tuple[str, Any]]:
        names = ("delta", "energy_ratio", "packing", "cell_area_cv")
        return [*super()._rows(), *((name, self.uniformity[name]) for name in names)]
