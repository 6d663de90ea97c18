"""The program is found where it usually is, or the message says how to get it."""

from __future__ import annotations

from pathlib import Path

import pytest
from lloydar_processing import program
from lloydar_processing.program import ProgramError, ask_version, check_version, find_program, read_version


def made(folder: Path, prints: str = "lloydar 0.1.0", code: int = 0) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / program.FILE_NAME
    path.write_text(f"#!/bin/sh\necho '{prints}'\nexit {code}\n")
    path.chmod(0o755)
    return path


def test_the_setting_is_first_then_path_then_the_usual_directories(tmp_path: Path) -> None:
    set_by_hand, in_path, usual = (made(tmp_path / name) for name in ("set", "path", "usual"))
    environment = {"PATH": str(tmp_path / "path")}
    directories = [tmp_path / "usual"]
    assert find_program(str(set_by_hand), environment, directories) == set_by_hand
    assert find_program(f" {tmp_path / 'set'} ", environment, directories) == set_by_hand, "a directory will do"
    assert find_program("", environment, directories) == in_path
    assert find_program("", {"PATH": ""}, directories) == usual
    assert find_program("", {}, directories) == usual


def test_a_wrong_setting_is_an_error_and_not_a_search(tmp_path: Path) -> None:
    usual = made(tmp_path / "usual")
    with pytest.raises(ProgramError, match="setting"):
        find_program(str(tmp_path / "gone"), {"PATH": str(usual.parent)}, [])
    usual.chmod(0o644)
    with pytest.raises(ProgramError, match="setting"):
        find_program(str(usual), {}, [])


def test_a_message_says_where_it_was_searched_for_and_how_to_get_it(tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match="cargo install") as caught:
        find_program("", {"PATH": str(tmp_path)}, [tmp_path / "usual"])
    assert str(tmp_path / "usual") in str(caught.value)


def test_usual_directories_are_those_of_cargo_and_pip(tmp_path: Path) -> None:
    directories = program.usual_directories(tmp_path)
    assert directories[:2] == [tmp_path / ".cargo" / "bin", tmp_path / ".local" / "bin"]
    assert len(directories) == len(set(directories))


def test_versions_are_compared(tmp_path: Path) -> None:
    path = tmp_path / "lloydar"
    assert read_version("lloydar 0.1.12\n") == (0, 1, 12)
    assert check_version("lloydar 0.1.7\n", path) is None
    assert "newer" in (check_version("lloydar 1.0.0", path) or "")
    with pytest.raises(ProgramError, match=r"0\.0\.9.*needs 0\.1"):
        check_version("lloydar 0.0.9", path)
    for other in ("", "Lloyd 3\nmore", "lloydar from a branch"):
        with pytest.raises(ProgramError, match="is not lloydar"):
            check_version(other, path)


def test_the_version_is_asked_of_the_program(tmp_path: Path) -> None:
    assert ask_version(made(tmp_path)).strip() == "lloydar 0.1.0"
    (tmp_path / "text").write_text("no program")
    with pytest.raises(ProgramError, match="does not run"):
        ask_version(tmp_path / "text")
