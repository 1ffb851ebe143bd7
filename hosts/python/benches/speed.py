"""Times of the package beside the program's: `engine.tick`, `render`, a phase node in NumPy.

ASPERITY_PROGRAM names the program. Both must be built in release mode.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

import asperity

GRAPH = Path(__file__).parents[3] / "graphs" / "texture.ron"
SECONDS = 60.0
ROUNDS = 5


@asperity.node(inputs={"magnitude": "frames"}, outputs={"spectrum": "spectrum"})
class Turning:
    """Turns the phase of each bin at its own frequency."""

    def prepare(self, setup: asperity.Setup) -> None:
        port = setup.inputs["magnitude"]
        self.step = np.exp(2j * np.pi * np.arange(port.size) * port.rate / port.frame_rate / port.length)
        self.phase = np.ones(port.size, complex)

    def process(self, tick: asperity.Tick) -> None:
        if tick.frame is not None:
            self.phase *= self.step
            tick.outputs["spectrum"][:] = tick.inputs["magnitude"] * self.phase


def best(call: Any) -> float:
    """Shortest time of some rounds in s."""
    times = []
    for _ in range(ROUNDS):
        before = time.perf_counter()
        call()
        times.append(time.perf_counter() - before)
    return min(times)


def engine_tick() -> None:
    graph = asperity.Graph(GRAPH)
    felt = graph.render(seconds=4.0, probes=["stylus.position"], sleep=True)
    positions = np.ascontiguousarray(felt["stylus.position"], dtype=np.float64)
    own_us = felt.report["tick_us"]["p50"]
    engine, times = graph.engine(), np.empty(len(positions))
    for i, position in enumerate(positions):
        before = time.perf_counter_ns()
        engine.tick(position)
        times[i] = time.perf_counter_ns() - before
    clock = np.median([-time.perf_counter_ns() + time.perf_counter_ns() for _ in range(10000)])
    whole_us = (np.median(times) - clock) / 1e3
    print(f"engine.tick: median {whole_us:.2f} us; the engine's own tick {own_us:.2f} us")
    silent = asperity.Graph(
        'Graph(version: 1, nodes: {"s": (kind: "stroke"), "p": (kind: "probe")}, wires: [("s", "p")])'
    )
    still, times = silent.engine(), np.empty(20000)
    for i in range(len(times)):
        before = time.perf_counter_ns()
        still.tick(positions[i % len(positions)])
        times[i] = time.perf_counter_ns() - before
    print(f"engine.tick of a graph of two nodes: median {(np.median(times) - clock) / 1e3:.2f} us")


def render() -> None:
    graph = asperity.Graph(GRAPH)
    ours = best(lambda: graph.render(seconds=SECONDS))
    program = os.environ["ASPERITY_PROGRAM"]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.npy"
        args = [program, "render", str(GRAPH), "--seconds", str(SECONDS), "--out", str(out), "--quiet"]
        theirs = best(lambda: subprocess.run(args, check=True))
    print(f"render of {SECONDS:.0f} s: {ours:.3f} s, the program {theirs:.3f} s: {theirs / ours:.2f} times its speed")


def phase_node() -> None:
    text = GRAPH.with_name("heravi2024.ron").read_text().replace('kind: "spsi"', 'kind: "turning"')
    for folder in ("models", "trajectories"):
        text = text.replace(f'"{folder}/', f'"{GRAPH.parent}/{folder}/')
    graph = asperity.Graph(text, kinds=[Turning])
    took = best(lambda: graph.render(seconds=10.0, sleep=False))
    print(f"a phase node in NumPy at 2 ms hops: {10.0 / took:.0f} times real time")


if __name__ == "__main__":
    engine_tick()
    render()
    phase_node()
