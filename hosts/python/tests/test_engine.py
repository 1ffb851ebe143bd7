"""Step by step: the same samples as a render."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import asperity


@pytest.mark.parametrize("name", ["texture.ron", "live.ron"])
def test_ticks_give_the_samples_of_a_render(
    name: str, graphs: Path, stroke: NDArray[np.float64]
) -> None:
    graph = asperity.Graph(graphs / name)
    felt = graph.render(stroke, probes=["stylus.position", "floor.force", "texture"])
    engine = graph.engine(probes=["floor.force", "texture"])
    assert (engine.rate, engine.tick_hz, engine.ticks) == (48000, 500, 0)
    parts, forces, frames = [], [], 0
    # Positions as the render had them, but for a probe's 32 bits.
    positions = felt["stylus.position"]
    for position in positions:
        parts.append(engine.tick(position=position))
        forces.append(engine["floor.force"][0])
        frames += len(engine["texture"])
    assert engine.ticks == len(positions)
    assert np.allclose(np.concatenate(parts), felt.audio, atol=1e-3 * np.abs(felt.audio).max())
    assert np.allclose(forces, felt["floor.force"], atol=1e-5)
    assert frames == len(felt["texture"]) > 100
    assert engine.unit("floor.force") == "N"
    assert engine.faults == 0
    engine.reset()
    again = np.concatenate([engine.tick(position=tuple(map(float, p))) for p in positions])
    assert again.tobytes() == np.concatenate(parts).tobytes()


def test_wrong_positions_are_refused(graphs: Path) -> None:
    engine = asperity.Graph(graphs / "texture.ron").engine()
    with pytest.raises(ValueError, match="x, y and z"):
        engine.tick(position=(1.0, 2.0))
    with pytest.raises(ValueError, match="finite"):
        engine.tick(position=(1.0, 2.0, float("nan")))
    with pytest.raises(KeyError):
        engine["floor.force"]
    tone = """Graph(version: 1, nodes: {"tone": (kind: "sine", params: (unit: "A")),
        "limiter": (kind: "limiter", params: (profile: "hapcoil_one")), "out": (kind: "audio_out")},
        wires: [("tone", "limiter"), ("limiter", "out")])"""
    still = asperity.Graph(tone).engine()
    assert still.tick().shape == (96,)
    with pytest.raises(ValueError, match="no stylus"):
        still.tick(position=(0.0, 0.0, 0.0))
