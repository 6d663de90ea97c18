"""The plug-in: it adds the provider to Processing, with or without a window."""

from __future__ import annotations

from qgis.core import QgsApplication

from .provider import LloydarProvider


class LloydarPlugin:
    """Registers the provider while the plug-in is loaded."""

    def __init__(self) -> None:
        self.provider: LloydarProvider | None = None

    def initProcessing(self) -> None:  # noqa: N802
        """Add the provider; ``qgis_process`` calls only this."""
        self.provider = LloydarProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:  # noqa: N802
        """Add the provider to a QGIS with windows."""
        self.initProcessing()

    def unload(self) -> None:
        """Remove the provider."""
        if self.provider is not None:
            QgsApplication.processingRegistry().removeProvider(self.provider)
            self.provider = None
