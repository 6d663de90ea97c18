"""The provider: its name, its setting, its algorithms."""

from __future__ import annotations

from pathlib import Path

from qgis.core import QgsProcessingProvider, QgsSettings
from qgis.PyQt.QtGui import QIcon

from .algorithm import LloydarAlgorithm
from .descriptions import ALGORITHMS, PROVIDER
from .program import find_program

#: The setting with the path of the program, as Processing's options name it. Empty: it is searched for.
SETTING = "LLOYDAR_PROGRAM"


def program_path() -> Path:
    """Return the path of the program, by the setting or by search. Raise `ProgramError` if there is none."""
    return find_program(str(QgsSettings().value(f"Processing/Configuration/{SETTING}", "") or ""))


class LloydarProvider(QgsProcessingProvider):
    """The algorithms ``lloydar:…``."""

    def id(self) -> str:
        """Return the part of the identifiers before the colon."""
        return PROVIDER

    def name(self) -> str:
        """Return the name that the toolbox shows."""
        return "lloydar"

    def longName(self) -> str:  # noqa: N802
        """Return the name with what the provider does."""
        return "lloydar: even points from laser scans"

    def icon(self) -> QIcon:
        """Return the icon of the toolbox."""
        return QIcon(str(Path(__file__).with_name("icon.svg")))

    def load(self) -> bool:
        """Add the setting to Processing's options, and the algorithms."""
        try:
            from processing.core.ProcessingConfig import ProcessingConfig, Setting
        except ImportError:
            pass  # Without Processing's own plug-in there is no page for settings.
        else:
            ProcessingConfig.settingIcons[self.name()] = self.icon()
            label = "Path of the program lloydar (empty: searched for)"
            ProcessingConfig.addSetting(Setting(self.name(), SETTING, label, "", valuetype=Setting.FILE))
            ProcessingConfig.readSettings()
        self.refreshAlgorithms()
        return True

    def unload(self) -> None:
        """Remove the setting."""
        try:
            from processing.core.ProcessingConfig import ProcessingConfig
        except ImportError:
            return
        ProcessingConfig.removeSetting(SETTING)

    def loadAlgorithms(self) -> None:  # noqa: N802
        """Add the algorithms."""
        for description in ALGORITHMS:
            self.addAlgorithm(LloydarAlgorithm(description, program_path))
