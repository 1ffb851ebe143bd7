"""Graphs, renders, and their arrays."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _asperity
from ._asperity import Engine
from ._node import kinds_of
from ._values import Value, as_text, progress

Stroke = Union[str, "os.PathLike[str]", ArrayLike]
"""A CSV file, an array, or a data frame with the columns of such a file."""


class Signal(np.ndarray[Any, np.dtype[Any]]):
    """An array with its rate and unit."""

    rate: float
    """Rows a second."""
    unit: str
    """Unit of the values."""
    times: NDArray[np.float64]
    """Time of each row in s."""
    bin_hz: float
    """Distance of two bins of frames in Hz; else 0."""

    def __array_finalize__(self, of: Any) -> None:
        self.rate = getattr(of, "rate", 0.0)
        self.unit = getattr(of, "unit", "")
        self.times = getattr(of, "times", np.empty(0))
        self.bin_hz = getattr(of, "bin_hz", 0.0)


class Felt(Mapping[str, Signal]):
    """A render that has ended. ``felt["texture"]`` is a probe by the name that `Graph.render` got."""

    def __init__(self, native: _asperity.Felt) -> None:
        self._native = native
        self._signals: dict[str, Signal] = {}
        self._report: dict[str, Any] | None = None
        self.audio: NDArray[np.float32] = native.take_audio()
        """Samples of the output, ``(n,)``, or ``(n, channels)``: those of ``asperity render --out``."""
        self.rate: int = native.rate
        """Samples a second."""
        self.faults: int = native.faults
        """Failures of nodes."""

    @property
    def report(self) -> dict[str, Any]:
        """Times, levels and faults of the run, as ``asperity render --report`` writes them.

        The first access measures the response lag, which takes up to some seconds.
        """
        if self._report is None:
            self._report = json.loads(self._native.report())
        return self._report

    def __getitem__(self, name: str) -> Signal:
        if name not in self._signals:
            values, rate, unit, times, bin_hz = self._native.probe(name)
            signal = values.view(Signal)
            signal.rate, signal.unit, signal.bin_hz = rate, unit, bin_hz
            signal.times = times if times.size else np.arange(len(values)) / rate
            self._signals[name] = signal
        return self._signals[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._native.probes)

    def __len__(self) -> int:
        return len(self._native.probes)

    def plot(self) -> Any:
        """Draw the output and all probes over time, by matplotlib.

        Returns
        -------
        The figure.
        """
        import matplotlib.pyplot as plt

        count = int(self.audio.size > 0) + len(self)
        figure, axes = plt.subplots(
            max(count, 1), squeeze=False, sharex=True, layout="constrained", figsize=(9, 1 + 2 * count)
        )
        left = iter(axes[:, 0])
        if self.audio.size:
            axis = next(left)
            axis.plot(np.arange(len(self.audio)) / self.rate, self.audio, linewidth=0.5)
            axis.set_ylabel("output")
        for (name, signal), axis in zip(self.items(), left):
            if signal.bin_hz and len(signal):
                level = 20 * np.log10(np.maximum(np.abs(np.asarray(signal)).T, 1e-6))
                edges = np.arange(level.shape[0]) * signal.bin_hz
                axis.pcolormesh(signal.times, edges, level, shading="nearest", rasterized=True)
                axis.set_ylabel(f"{name}\n[Hz]")
            else:
                axis.plot(signal.times, np.asarray(signal), linewidth=0.8)
                axis.set_ylabel(f"{name}\n[{signal.unit}]")
        axes[-1, 0].set_xlabel("time [s]")
        return figure

    def __repr__(self) -> str:
        seconds = len(self.audio) / self.rate if self.rate else 0.0
        return f"<Felt: {seconds:.2f} s at {self.rate} Hz, probes {list(self)}>"


class Graph:
    """A graph or a scene: what the hand feels, and how it is computed.

    Parameters
    ----------
    graph
        Path of a graph file or scene file, or its text. A path that begins with ``graphs/`` and does not exist
        names a file that ships with the package.
    set
        Settings by node and parameter: ``{"motion.cutoff_hz": 30.0, "seed": 7}``.
    kinds
        Classes made by `node` that the graph may use.
    **settings
        Settings of parameters that only one node has, such as ``material="oak"``; also ``tick_hz``,
        ``audio_hz`` and ``seed``.

    Raises
    ------
    Error
        The graph has an error. The text has file, line, column and a caret.

    Examples
    --------
    >>> graph = Graph("graphs/texture.ron", material="oak")
    >>> felt = graph.render(probes=["floor.force"])
    """

    def __init__(
        self,
        graph: str | os.PathLike[str],
        *,
        set: Mapping[str, Value] | None = None,
        kinds: Sequence[type] = (),
        **settings: Value,
    ) -> None:
        text = os.fspath(graph)
        is_text = isinstance(graph, str) and ("Graph(" in text or "Scene(" in text)
        fields = ("tick_hz", "audio_hz", "seed")
        own: dict[str, Value] = {key: settings.pop(key) for key in fields if key in settings}
        own.update(set or {})
        assignments = [f"{key}={as_text(value)}" for key, value in own.items()]
        keywords = [(key, as_text(value)) for key, value in settings.items()]
        self._native = _asperity.Graph(text, is_text, assignments, keywords, kinds_of(kinds))
        self._name = "text" if is_text else text

    @property
    def tick_hz(self) -> int:
        """Ticks a second."""
        return self._native.tick_hz

    @property
    def audio_hz(self) -> int:
        """Audio rate in Hz."""
        return self._native.audio_hz

    @property
    def seed(self) -> int:
        """Seed of random numbers."""
        return self._native.seed

    @property
    def nodes(self) -> dict[str, str]:
        """Kind of each node by its id, in the order in which they run."""
        return dict(self._native.nodes)

    @property
    def svg(self) -> str:
        """The graph as a picture."""
        return self._native.svg

    def _repr_svg_(self) -> str:
        return self.svg

    def __repr__(self) -> str:
        return f"<Graph {self._name}: {len(self.nodes)} nodes, {self.tick_hz} Hz ticks>"

    def render(
        self,
        stroke: Stroke | None = None,
        *,
        probes: Sequence[str] = (),
        seconds: float | None = None,
        seed: int | None = None,
        depth_mm: float = 2.0,
        loop: bool = False,
        columns: Mapping[str, str] | None = None,
        sleep: bool = True,
        show_progress: bool | None = None,
    ) -> Felt:
        """Run the graph over a stroke, as fast as possible.

        Files that nodes of the graph name are not written. The same graph, stroke and seed give the same
        bytes as ``asperity render``.

        Parameters
        ----------
        stroke
            Motion of the stylus in the place of the graph's own: a CSV file; an array ``(n, 4)`` of time in s
            and x, y, z in mm, z up, negative inside the surface; ``(n, 3)`` without z; or a data frame with
            the columns of such a file: ``t_s``, ``x_mm``, ``y_mm``, ``z_mm``, ``force_n``, ``speed_mm_s``.
        probes
            Outputs to record, such as ``"floor.force"``, or ``"texture"`` for a node's first.
        seconds
            Duration; by default that of the stroke.
        seed
            Seed of random numbers; by default the graph's.
        depth_mm
            Depth of an ``(n, 3)`` stroke in the surface: at 2 mm, the floor of the shipped graphs answers 1 N.
        loop
            Whether the stroke begins again at its end; give `seconds` then.
        columns
            Other names of columns, with units: ``{"force_n": "Fz:N"}``.
        sleep
            False runs every node in every tick, even behind a closed gate.
        show_progress
            False shows no progress. By default, tqdm shows it if it is installed.
        """
        file, table = _stroke(stroke, depth_mm)
        mapped = [f"{name}={column}" for name, column in (columns or {}).items()]
        bar = progress(show_progress, "rendering")
        return Felt(
            self._native.render(file, table, mapped, loop, list(probes), seconds, seed, sleep, bar)
        )

    def engine(self, *, probes: Sequence[str] = ()) -> Engine:
        """Make an engine that runs step by step, for the loop of a simulator.

        The caller moves the stylus in the place of the graph's own stroke or hand.

        Parameters
        ----------
        probes
            Outputs to read after each tick, as in `render`.

        Examples
        --------
        >>> engine = Graph("graphs/texture.ron").engine(probes=["floor.force"])
        >>> samples = engine.tick(position=(1.0, 0.0, -2.0))
        >>> force_n = engine["floor.force"][0]
        """
        return self._native.engine(list(probes))

    def response_lag(self) -> dict[str, Any]:
        """Measure how late the output follows a step of speed.

        Returns
        -------
        ``response_lag_ms`` holds the times until 10, 50 and 90 % of the way, or None; then ``not_measured``
        says why. ``declared_ms`` is the sum of the declared latencies on the slowest path.
        """
        found: dict[str, Any] = json.loads(self._native.lag())
        return found


def render(
    graph: str | os.PathLike[str],
    stroke: Stroke | None = None,
    *,
    set: Mapping[str, Value] | None = None,
    kinds: Sequence[type] = (),
    probes: Sequence[str] = (),
    seconds: float | None = None,
    seed: int | None = None,
    **settings: Value,
) -> Felt:
    """Render a graph at once: `Graph`, then `Graph.render`."""
    it = Graph(graph, set=set, kinds=kinds, **settings)
    return it.render(stroke, probes=probes, seconds=seconds, seed=seed)


def _stroke(
    stroke: Stroke | None, depth_mm: float
) -> tuple[str | None, tuple[list[str], NDArray[np.float64]] | None]:
    if stroke is None:
        return None, None
    if isinstance(stroke, (str, os.PathLike)):
        return os.fspath(stroke), None
    if hasattr(stroke, "columns") and hasattr(stroke, "to_numpy"):
        rows = np.asarray(stroke.to_numpy(dtype=float), dtype=np.float64)
        return None, ([str(name) for name in stroke.columns], rows)
    rows = np.asarray(stroke, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] not in (3, 4):
        what = "a stroke is an array (n, 4) of t_s, x_mm, y_mm, z_mm, or (n, 3) without z_mm"
        raise ValueError(f"{what}; this one is {rows.shape}")
    if rows.shape[1] == 3:
        rows = np.column_stack([rows, np.full(len(rows), -float(depth_mm))])
    return None, (["t_s", "x_mm", "y_mm", "z_mm"], rows)
