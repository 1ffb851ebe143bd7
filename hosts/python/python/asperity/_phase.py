"""Phase retrieval without a graph."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _asperity
from ._node import kind_of
from ._values import Value, as_text, progress


def invert(
    magnitudes: ArrayLike,
    *,
    rate: int,
    scale: Literal["dft", "amplitude"],
    phase: str | type = "default",
    seed: int = 1,
    **settings: Value,
) -> NDArray[np.float32]:
    """Turn magnitude frames into a signal.

    Parameters
    ----------
    magnitudes
        ``(frames, bins)``, bin 0 first: of windows of 0.1 s under a periodic Hann window, 2 ms apart. Frame n
        begins at sample ``floor(n * rate / 500)``.
    rate
        Sample rate of the signal in Hz, a multiple of 10.
    scale
        ``"dft"`` for those of an unscaled DFT, as ``numpy.abs(numpy.fft.rfft(w * x))``; ``"amplitude"`` for
        those of a graph, ``2 |sum w x| / sum w``.
    phase
        Phase-retrieval node, an offline method (``griffin_lim``, ``fast_griffin_lim``), ``default``, or a class
        made by `node`.
    seed
        Seed of random numbers.
    **settings
        Parameters of the node, such as ``frames=5``.

    Returns
    -------
    The signal, whose sample 0 is the first of frame 0.
    """
    if scale not in ("dft", "amplitude"):
        raise ValueError(f'scale is "dft" or "amplitude", not {scale!r}')
    frames = np.asarray(magnitudes)
    if frames.ndim != 2:
        raise ValueError(f"magnitudes are (frames, bins), and these have {frames.ndim} dimensions")
    if np.iscomplexobj(frames):
        raise ValueError("magnitudes are real: take numpy.abs of the spectrum")
    name, kinds = _method(phase)
    chosen = ",".join(f"{key}={as_text(value)}" for key, value in settings.items())
    name = f"{name}:{chosen}" if chosen else name
    frames = frames.astype(np.float32)
    signal, faults = _asperity.invert(frames, rate, name, scale, seed, kinds)
    if faults:
        times = "once" if faults == 1 else f"{faults} times"
        raise _asperity.Error(f"`{name}` failed {times}: these ticks would be silent")
    return signal


class Comparison:
    """Phase-retrieval methods side by side. Its text is the table that ``asperity compare`` prints."""

    def __init__(self, report: str, text: str, csv: str, svg: str) -> None:
        self.report: dict[str, Any] = json.loads(report)
        """All figures, as ``asperity compare --json``."""
        self.csv = csv
        """All figures as CSV: a line for each method and vector."""
        self.svg = svg
        """All figures as a picture."""
        self._text = text

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each method, the best first."""
        return list(self.report["methods"])

    def frame(self) -> Any:
        """All figures as a data frame of pandas: a row for each method and vector."""
        import pandas

        return pandas.read_csv(io.StringIO(self.csv))

    def __str__(self) -> str:
        return self._text

    def __repr__(self) -> str:
        return self._text

    def _repr_svg_(self) -> str:
        return self.svg


def compare(
    methods: Sequence[str | type] = (),
    *,
    vectors: str | os.PathLike[str] = "shipped",
    show_progress: bool | None = None,
) -> Comparison:
    """Compare phase-retrieval methods: accuracy, response lag, latency, cost.

    Parameters
    ----------
    methods
        Names of nodes, with settings as in ``"sample_commit:frames=5"``, of offline methods, or classes made
        by `node`. All nodes that there are, if none is named.
    vectors
        ``"shipped"``, or a folder of test vectors.
    show_progress
        False shows no progress. By default, tqdm shows it if it is installed.
    """
    pairs = [_method(method) for method in methods]
    kinds = {kind.name: kind for _, own in pairs for kind in own}
    bar = progress(show_progress, "comparing")
    names = [name for name, _ in pairs]
    found = _asperity.compare(names, os.fspath(vectors), list(kinds.values()), bar)
    return Comparison(*found)


def _method(method: str | type) -> tuple[str, list[_asperity.Kind]]:
    if isinstance(method, str):
        return method, []
    kind = kind_of(method)
    return kind.name, [kind]
