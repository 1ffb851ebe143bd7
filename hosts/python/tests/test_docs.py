"""The code of the pages runs as it stands there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import asperity
from conftest import ROOT


def blocks(page: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)


def test_first_lines_render_and_plot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib").use("svg")
    first, readme = blocks("docs/python.md")[0], blocks("README.md")[0]
    assert first == readme
    assert len([line for line in first.splitlines() if line.strip()]) <= 8
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    exec(first, {})
    assert "<svg" in (tmp_path / "felt.svg").read_text()


def test_other_lines_of_the_page_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    magnitudes = np.abs(np.random.default_rng(0).normal(size=(60, 101)))
    names: dict[str, Any] = {"asperity": asperity, "np": np, "S": magnitudes}
    _, steps, inverted, written, _ = blocks("docs/python.md")
    exec(steps, names)
    assert names["samples"].size == 96 and names["force_n"] == pytest.approx(1.0)
    exec(inverted, names)
    # The comparison takes a minute.
    exec(written[: written.index("print(")], names)
    y = asperity.invert(magnitudes, rate=2500, scale="amplitude", phase=names["MyGriffinLim"])
    assert y.size == names["y"].size and np.abs(y).max() > 0
