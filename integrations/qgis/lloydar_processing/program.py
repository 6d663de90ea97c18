"""The program ``lloydar`` on this machine: where it is, and which version it has. No QGIS is imported here."""

from __future__ import annotations

import os
import re
import shutil
import site
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Mapping
from pathlib import Path

#: Name of the program's file.
FILE_NAME = "lloydar.exe" if os.name == "nt" else "lloydar"

#: The oldest version that has all options of the plug-in.
OLDEST = (0, 1)
#: The newest minor version that the plug-in was tested with. A newer program is used with a warning.
NEWEST = (0, 1)

HOW_TO_GET_IT = (
    "To install it, run `cargo install --path .` or `pip install ./python` in a clone of lloydar. "
    "If it is installed elsewhere, give its path under Settings, Options, Processing, Providers, lloydar."
)


class ProgramError(Exception):
    """The program cannot be used. The message says why, and what to do."""


def usual_directories(home: Path | None = None) -> list[Path]:
    """Return the directories where cargo, pip and package managers put programs, even if PATH lacks them.

    Desktops often start QGIS with a shorter PATH than that of a shell.
    """
    home = Path.home() if home is None else home
    directories = [home / ".cargo" / "bin", home / ".local" / "bin"]
    if os.name == "nt":
        directories += [Path(sysconfig.get_path("scripts")), Path(site.getuserbase()) / "Scripts"]
    else:
        directories += [Path(sysconfig.get_path("scripts")), Path(site.getuserbase()) / "bin"]
        directories += [Path("/usr/local/bin"), Path("/opt/homebrew/bin"), Path(sys.prefix) / "bin"]
    return list(dict.fromkeys(directories))


def find_program(
    setting: str = "",
    environment: Mapping[str, str] | None = None,
    directories: Iterable[Path] | None = None,
) -> Path:
    """Return the path of the program: that of the setting, else the first in PATH, else in `directories`.

    Raise `ProgramError` if the setting names no program, or if there is none anywhere.
    """
    environment = os.environ if environment is None else environment
    setting = setting.strip()
    if setting:
        path = Path(setting).expanduser()
        path = path / FILE_NAME if path.is_dir() else path
        if not _is_program(path):
            raise ProgramError(
                f"{path}: there is no program, though the setting of the plug-in says so. Correct the path under "
                "Settings, Options, Processing, Providers, lloydar; if it is empty, the program is searched for."
            )
        return path
    found = shutil.which("lloydar", path=environment.get("PATH", ""))
    if found:
        return Path(found)
    looked_at = list(usual_directories() if directories is None else directories)
    for directory in looked_at:
        if _is_program(directory / FILE_NAME):
            return directory / FILE_NAME
    places = ", ".join(str(directory) for directory in looked_at)
    raise ProgramError(f"The program lloydar was not found, neither in PATH nor in {places}. {HOW_TO_GET_IT}")


def _is_program(path: Path) -> bool:
    return path.is_file() and os.access(path, os.X_OK)


def read_version(text: str) -> tuple[int, ...] | None:
    """Return the numbers of what ``lloydar --version`` prints, or None if another program printed it.

    >>> read_version("lloydar 0.1.0")
    (0, 1, 0)
    """
    match = re.match(r"lloydar (\d+)\.(\d+)\.(\d+)", text.strip())
    return tuple(int(number) for number in match.groups()) if match else None


def check_version(text: str, path: Path) -> str | None:
    """Return a warning if the version is newer than those tested, else None; `text` is what ``--version`` prints.

    Raise `ProgramError` if the version is too old, or the program another one.
    """
    version = read_version(text)
    if version is None:
        said = text.strip().splitlines()[0][:80] if text.strip() else "nothing"
        raise ProgramError(f"{path} is not lloydar: asked for its version it prints {said!r}. {HOW_TO_GET_IT}")
    is_version = ".".join(map(str, version))
    if version[:2] < OLDEST:
        oldest = ".".join(map(str, OLDEST))
        raise ProgramError(f"{path} has version {is_version}; the plug-in needs {oldest} or later. {HOW_TO_GET_IT}")
    if version[:2] > NEWEST:
        newest = ".".join(map(str, NEWEST))
        return f"lloydar {is_version} is newer than the versions that this plug-in was tested with (up to {newest})."
    return None


def ask_version(path: Path) -> str:
    """Return what ``PATH --version`` prints. Raise `ProgramError` if it does not run."""
    try:
        done = subprocess.run(
            [str(path), "--version"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=20,
            check=False,
            **no_window(),
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ProgramError(f"{path} does not run: {error}. {HOW_TO_GET_IT}") from error
    return done.stdout.decode("utf-8", "replace")


def no_window() -> dict[str, int]:
    """Return the arguments of `subprocess` that keep Windows from opening a console window."""
    return {"creationflags": subprocess.CREATE_NO_WINDOW} if os.name == "nt" else {}  # type: ignore[attr-defined]
