"""Results as a notebook shows them: a table, and for points in memory a picture from above."""

from __future__ import annotations

import html
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ._resampled import Resampled

#: Points in the picture, at most.
_SHOWN = 2000
#: The longer side of the picture in pixels.
_PIXELS = 280.0


def figure(value: Any) -> str:
    """A number with four digits, a count with separators, anything else as text."""
    if isinstance(value, float):
        return f"{value:.4g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def table(rows: Iterable[tuple[str, Any]]) -> str:
    """A table of names and values."""
    cells = (
        f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{html.escape(figure(value))}</td></tr>"
        for name, value in rows
    )
    return f"<table>{''.join(cells)}</table>"


def cloud_page(cloud: Resampled, points_in: int) -> str:
    """The figures of a cloud beside a picture of its densest part from above."""
    figures = cloud.uniformity
    rows = [
        ("points", len(cloud)),
        ("of the input's", points_in),
        ("spacing", cloud.spacing),
        ("delta", figures["delta"]),
        ("energy ratio", figures["energy_ratio"]),
        ("packing", figures["packing"]),
        ("cell-area CV", figures["cell_area_cv"]),
        ("six neighbours", figures["six_neighbors"]),
        ("cells within a quarter of the mean", figures["even_cells"]),
    ]
    return f"<div style='display:flex;gap:2em'>{table(rows)}{_picture(cloud)}</div>"


def _picture(cloud: Resampled) -> str:
    """The points of a square around the middle one, as circles half a spacing wide."""
    if len(cloud) == 0:
        return ""
    plane = cloud.points[:, :2]
    from_middle = np.abs(plane - np.median(plane, axis=0)).max(axis=1)
    nearest = np.argsort(from_middle, kind="stable")[:_SHOWN]
    shown = plane[nearest]
    corner = shown.min(axis=0)
    extent = max(float(np.ptp(shown, axis=0).max()), cloud.spacing)
    pixels = _PIXELS / extent
    radius = max(0.25 * cloud.spacing * pixels, 0.5)
    circles = "".join(
        f"<circle cx='{x:.1f}' cy='{_PIXELS - y:.1f}' r='{radius:.1f}'/>"
        for x, y in (shown - corner) * pixels
    )
    side = _PIXELS + 2 * radius
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{side:.0f}' height='{side:.0f}' fill='#2a6f97' "
        f"viewBox='{-radius:.1f} {-radius:.1f} {side:.1f} {side:.1f}'>{circles}</svg>"
    )
