"""Processor times of the package beside the program's: `engine.tick`, `render`, a phase node in NumPy.

ASPERITY_PROGRAM names the program, built in the same mode.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

import asperity

GRAPH = Path(__file__).parents[3] / "graphs" / "texture.ron"
SECONDS = 20.0
ROUNDS = 3


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


def best(call: Callable[[], object]) -> float:
    """Least processor time of some rounds in s, with that of other processes that the call waits for."""
    taken = []
    for _ in range(ROUNDS):
        before = os.times()
        call()
        after = os.times()
        taken.append(sum(after[:4]) - sum(before[:4]))
    return min(taken)


def engine_tick() -> None:
    text = 'Graph(version: 1, nodes: {"s": (kind: "stroke"), "p": (kind: "probe")}, wires: [("s", "p")])'
    small, position = asperity.Graph(text), np.array([1.0, 2.0, -2.0])
    engine, ticks = small.engine(), 100_000

    def steps() -> None:
        for _ in range(ticks):
            engine.tick(position)

    us = 1e6 / ticks
    ours, whole = best(steps) * us, best(lambda: small.render(seconds=ticks / 500)) * us
    print(f"a tick of two nodes: {ours:.2f} us by engine.tick, {whole:.2f} us in a render")


def render() -> None:
    graph = asperity.Graph(GRAPH)
    ours = best(lambda: graph.render(seconds=SECONDS))
    program = os.environ["ASPERITY_PROGRAM"]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.npy"
        args = [program, "render", str(GRAPH), "--seconds", str(SECONDS), "--out", str(out), "--quiet"]
        theirs = best(lambda: subprocess.run(args, check=True))
    speed = theirs / ours
    print(f"render of {SECONDS:.0f} s: {ours:.2f} s, the program {theirs:.2f} s: {speed:.2f} times its speed")


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
