"""Even points from laser scans: a Processing provider of QGIS around the program ``lloydar``."""

from __future__ import annotations

from typing import Any


def classFactory(iface: Any) -> Any:  # noqa: N802 (a name of QGIS)
    """Return the plug-in; QGIS calls this. `iface` is None where there is no window, as in ``qgis_process``."""
    from .plugin import LloydarPlugin

    return LloydarPlugin()
