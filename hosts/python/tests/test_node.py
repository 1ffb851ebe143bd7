"""Nodes that are Python classes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import asperity


@asperity.node(inputs={"magnitude": "frames"}, outputs={"spectrum": "spectrum"}, params={"seed_of": 5})
class Scattered:
    """Draws a phase for each bin of each frame."""

    seed_of: int

    def prepare(self, setup: asperity.Setup) -> None:
        port = setup.inputs["magnitude"]
        assert (port.shape, port.size, port.frame_rate) == ("frames", setup.outputs["spectrum"].size, 500.0)
        self.random = np.random.default_rng(self.seed_of)

    def process(self, tick: asperity.Tick) -> None:
        if tick.frame is not None:
            magnitude = tick.inputs["magnitude"]
            turned = np.exp(2j * np.pi * self.random.random(magnitude.size))
            tick.outputs["spectrum"][:] = magnitude * turned


@asperity.node(inputs={"in": "audio"}, outputs={"out": "audio"}, params={"gain": 1.0}, name="own_gain")
class OwnGain:
    gain: float

    def process(self, tick: asperity.Tick) -> None:
        tick.outputs["out"][:] = np.float32(self.gain) * tick.inputs["in"]


@asperity.node(inputs={"magnitude": "frames"}, outputs={"signal": "audio"})
class Broken:
    def process(self, tick: asperity.Tick) -> None:
        raise ArithmeticError("the phase fell off")


@asperity.node(outputs={"speed": ("control", 1, "mm/s"), "out": "audio"})
class Source:
    def process(self, tick: asperity.Tick) -> None:
        tick.outputs["speed"][0] = 3.0 * tick.index
        tick.outputs["out"][:] = tick.index


CHAIN = """Graph(version: 1, nodes: {{
    "tone": (kind: "sine", params: (frequency_hz: 60.0, seconds: 0.3)),
    "gain": (kind: "{kind}", params: (gain: 0.25)), "seen": (kind: "probe"),
}}, wires: [("tone", "gain"), ("gain", "seen")])"""


def test_python_gain_gives_the_samples_of_the_built_in_one() -> None:
    found = asperity.render(CHAIN.format(kind="own_gain"), kinds=[OwnGain], probes=["seen"])
    expected = asperity.render(CHAIN.format(kind="gain"), probes=["seen"])
    assert found["seen"].tobytes() == expected["seen"].tobytes()
    assert found["seen"].size == 14400 and found.faults == 0
    with pytest.raises(asperity.Error, match="own_gain"):
        asperity.Graph(CHAIN.format(kind="own_gain"))


def test_source_writes_controls_and_samples() -> None:
    graph = """Graph(version: 1, nodes: {"own": (kind: "source"), "seen": (kind: "probe")},
        wires: [("own.out", "seen")])"""
    felt = asperity.render(graph, kinds=[Source], seconds=0.01, probes=["own.speed", "own.out"])
    assert felt["own.speed"].tolist() == [0.0, 3.0, 6.0, 9.0, 12.0]
    assert felt["own.speed"].unit == "mm/s"
    assert felt["own.out"].tolist() == np.repeat(np.arange(5.0), 96).tolist()


def test_python_phase_in_place_of_the_shipped_one(graphs: Path, stroke: NDArray[np.float64]) -> None:
    text = (graphs / "heravi2024.ron").read_text()
    assert 'kind: "spsi"' in text
    mine = text.replace('kind: "spsi"', 'kind: "scattered_again"').replace(
        '"models/', f'"{graphs}/models/'
    )
    mine = mine.replace('"trajectories/', f'"{graphs}/trajectories/')
    kind: type = asperity.node(
        inputs={"magnitude": "frames"}, outputs={"spectrum": "spectrum"}, name="scattered_again"
    )(type("Again", (Scattered,), {"seed_of": 1}))
    felt = asperity.Graph(mine, kinds=[kind]).render(stroke)
    assert felt.faults == 0 and np.abs(felt.audio).max() > 0
    again = asperity.Graph(mine, kinds=[kind]).render(stroke)
    assert again.audio.tobytes() == felt.audio.tobytes()


def test_python_method_stands_in_the_table() -> None:
    found = asperity.compare([Scattered, "spsi"], show_progress=False)
    rows = {row["label"]: row for row in found.rows}
    assert rows.keys() == {"scattered", "spsi"}
    # Random phases agree with no signal: far worse than a method that looks at the magnitudes.
    worse = rows["scattered"]["scores"]["sine_off_2500"]["convergence_db"]
    assert worse > rows["spsi"]["scores"]["sine_off_2500"]["convergence_db"] + 3.0
    assert rows["scattered"]["notes"] == []


def test_exception_is_a_fault_and_is_told() -> None:
    with pytest.warns(asperity.AsperityWarning, match="the phase fell off") as told:
        found = asperity.compare([Broken], show_progress=False)
    assert "test_node.py" in str(told[0].message)
    assert found.rows[0]["notes"]
    graph = """Graph(version: 1, nodes: {"own": (kind: "failing"), "seen": (kind: "probe")},
        wires: [("own", "seen")])"""

    @asperity.node(outputs={"out": "audio"})
    class Failing:
        def process(self, tick: asperity.Tick) -> None:
            if tick.index == 3:
                raise KeyError("tick 3")
            tick.outputs["out"][:] = 1.0

    with pytest.warns(asperity.AsperityWarning, match="`failing` raised an exception once"):
        felt = asperity.render(graph, kinds=[Failing], seconds=0.1, probes=["seen"])
    assert felt.faults == 1
    assert felt.report["nodes"][0]["faults"] == 1


def test_bad_declarations_are_refused() -> None:
    with pytest.raises(ValueError, match="there is no port `sound`"):
        asperity.node(outputs={"out": "sound"})(type("A", (), {}))
    with pytest.raises(ValueError, match="needs an input of frames"):
        asperity.node(outputs={"out": "spectrum"})(type("A", (), {}))
    taken = asperity.node(inputs={"magnitude": "frames"}, outputs={"out": "audio"}, name="spsi")
    with pytest.raises(asperity.Error, match="there is a kind `spsi` already"):
        asperity.compare([taken(type("A", (), {}))])
    with pytest.raises(TypeError, match="no kind of node"):
        asperity.compare([int])

    @asperity.node(outputs={"out": "audio"})
    class Unprepared:
        def prepare(self, setup: asperity.Setup) -> None:
            raise OSError("no file of weights")

        def process(self, tick: asperity.Tick) -> None: ...

    graph = """Graph(version: 1, nodes: {"own": (kind: "unprepared"), "seen": (kind: "probe")},
        wires: [("own", "seen")])"""
    with pytest.raises(asperity.Error, match="no file of weights") as e:
        asperity.Graph(graph, kinds=[Unprepared])
    assert str(e.value).startswith("<text>:1:")
