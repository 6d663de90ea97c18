"""The package has what the plug-in repository asks for."""

from __future__ import annotations

import configparser
import subprocess
import zipfile
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "package"


def pack(path: Path) -> zipfile.ZipFile:
    words = [str(PACKAGE), "--email", "a@example.org", "--repository", "https://example.org/lloydar", "-o", str(path)]
    subprocess.run(words, check=True, capture_output=True)
    return zipfile.ZipFile(path)


def test_the_package_has_metadata_licence_icon_and_no_binaries(tmp_path: Path) -> None:
    archive = pack(tmp_path / "a.zip")
    names = archive.namelist()
    assert all(name.startswith("lloydar_processing/") for name in names)
    assert {Path(name).suffix for name in names} == {".py", ".svg", ".txt", ""}
    assert {"lloydar_processing/LICENSE", "lloydar_processing/__init__.py"} <= set(names)
    metadata = configparser.ConfigParser()
    metadata.read_string(archive.read("lloydar_processing/metadata.txt").decode())
    general = metadata["general"]
    for key in ("name", "description", "about", "version", "author", "email", "repository", "tracker"):
        assert general[key] and "@" not in general[key].replace("a@example.org", ""), key
    assert (general["qgisMinimumVersion"], general["qgisMaximumVersion"]) == ("3.22", "4.99")
    assert general["hasProcessingProvider"] == "yes" and f"lloydar_processing/{general['icon']}" in names
    assert "MIT" in archive.read("lloydar_processing/LICENSE").decode()


def test_the_same_sources_give_the_same_bytes(tmp_path: Path) -> None:
    pack(tmp_path / "a.zip")
    pack(tmp_path / "b.zip")
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()


def test_a_package_without_an_address_is_refused() -> None:
    done = subprocess.run([str(PACKAGE)], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "--email" in done.stderr
