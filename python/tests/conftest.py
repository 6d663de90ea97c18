"""Clouds and scans that several tests look at."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lloydar

#: The command that came with the package.
PROGRAM = Path(sys.executable).with_name("lloydar")


def sphere(count: int) -> np.ndarray:
    """Even points of the unit sphere, by the golden angle."""
    index = np.arange(count)
    z = 1 - (2 * index + 1) / count
    angle = index * np.pi * (3 - np.sqrt(5))
    radius = np.sqrt(1 - z * z)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


def sheet(side: int, seed: int = 0) -> np.ndarray:
    """A wavy sheet of 2 × 2 with `side`² random points."""
    plane = np.random.default_rng(seed).uniform(0, 2, (side * side, 2))
    return np.column_stack([plane, 0.1 * np.sin(3 * plane[:, 0])])


@pytest.fixture(scope="session")
def street(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two passes of a small simulated street."""
    return lloydar.simulate(tmp_path_factory.mktemp("street"), points="200K", length=40)


@pytest.fixture(scope="session")
def command() -> Callable[..., str]:
    """Runs the command `lloydar`; returns what it prints."""

    def run(*words: object) -> str:
        done = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
