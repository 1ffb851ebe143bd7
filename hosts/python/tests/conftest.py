"""Shared by the tests: the program, the shipped graphs, a stroke."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

ROOT = Path(__file__).parents[3]

Run = Callable[..., str]


@pytest.fixture
def program() -> Run:
    """Run the program, and answer its standard output."""
    path = os.environ.get("ASPERITY_PROGRAM")
    if not path:
        pytest.skip("ASPERITY_PROGRAM does not name the program `asperity`")

    def run(*args: object) -> str:
        done = subprocess.run([path, *map(str, args)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


@pytest.fixture
def graphs() -> Path:
    """The folder of shipped graphs."""
    return ROOT / "graphs"


@pytest.fixture
def stroke() -> NDArray[np.float64]:
    """A stroke of 1.2 s to and fro, pressed in by up to 3 mm, and lifted at its end."""
    t = np.arange(0.0, 1.2, 0.004)
    z = np.where(t < 1.0, -2.0 - np.sin(7 * t), 3.0)
    return np.column_stack([t, 30 * np.sin(5 * t), 10 * np.cos(3 * t), z])


def write_csv(path: Path, rows: NDArray[np.float64]) -> Path:
    """A stroke as the program reads it, with all digits."""
    lines = ["t_s,x_mm,y_mm,z_mm"] + [",".join(map(repr, row)) for row in rows.tolist()]
    path.write_text("\n".join(lines) + "\n")
    return path
