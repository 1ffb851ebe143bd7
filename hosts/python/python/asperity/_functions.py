"""Functions that need no graph."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _asperity


@dataclass(frozen=True)
class Material:
    """A material of a library."""

    name: str
    """Name, for the parameter ``material``."""
    family: str | None
    """Materials that feel alike."""
    description: str
    """How it feels."""
    images: list[str]
    """Paths of its pictures."""


def materials(
    library: str | os.PathLike[str] = "graphs/models/surfaces/materials.ron",
) -> list[Material]:
    """List the materials of a library.

    Parameters
    ----------
    library
        Library file. The default ships with the package.

    Returns
    -------
    Its materials, in the library's order.
    """
    found = _asperity.materials(os.fspath(library))
    return [
        Material(name, family, description, [os.fspath(image) for image in images])
        for name, family, description, images in found
    ]


@dataclass(frozen=True)
class ArTexture:
    """A texture of autoregressive models, fitted to a recording."""

    text: str
    """The file that the node ``autoregressive`` reads, as RON."""
    seconds: float
    """Seconds of the recording that were used."""
    models: int
    """Number of models."""
    order: int
    """Order of the models."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the file; its name ends in ``.ron``."""
        if not os.fspath(path).endswith(".ron"):
            raise ValueError("a texture's name ends in .ron")
        Path(path).write_text(self.text, encoding="utf-8")


def fit_ar(
    force: ArrayLike,
    speed: ArrayLike,
    acceleration: ArrayLike,
    *,
    rate: float,
    description: str = "A fitted texture.",
    order: int | None = None,
    max_order: int = 24,
    model_hz: int = 1000,
    high_pass_hz: float = 10.0,
) -> ArTexture:
    """Fit a texture of autoregressive models to a recording.

    Parameters
    ----------
    force
        Normal force in N, ``(n,)``.
    speed
        Speed along the surface in mm/s, ``(n,)``.
    acceleration
        Acceleration in m/s^2: ``(n,)``, or ``(n, axes)``.
    rate
        Samples a second, 1000 to 10000.
    description
        A sentence on how it feels.
    order
        Order of the models; by default the best up to `max_order`.
    max_order
        Highest order to try, at most 64.
    model_hz
        Rate of the models in Hz, 500 to 10000.
    high_pass_hz
        Cutoff of the high-pass that removes slow motion, at most a tenth of `model_hz`; 0 for none.
    """
    axes = np.asarray(acceleration, dtype=np.float64)
    found = _asperity.fit_ar(
        np.asarray(force, dtype=np.float64),
        np.asarray(speed, dtype=np.float64),
        axes[:, None] if axes.ndim == 1 else axes,
        float(rate),
        description,
        order,
        max_order,
        model_hz,
        float(high_pass_hz),
    )
    return ArTexture(*found)


def study_log(path: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """Read what a study logged of a participant.

    Parameters
    ----------
    path
        The participant's log in the folder of ``asperity study run``.

    Returns
    -------
    Its events in their order. The key ``event`` names the kind of each: ``begin``, ``answered`` and more.
    """
    events: list[dict[str, Any]] = json.loads(_asperity.study_log(os.fspath(path)))
    return events


def tradeoff(results: str | os.PathLike[str] | None = None) -> Any:
    """Read the results of a trade-off as a data frame of pandas: a row for each setting.

    Parameters
    ----------
    results
        Folder of ``asperity tradeoff``, or its ``results.json``; by default the shipped results.

    Returns
    -------
    Columns ``name``, ``graph``, ``tick_hz``, ``baseline``, ``faults``, ``latency_ms``, ``lag_10_ms``,
    ``lag_50_ms``, ``lag_90_ms``, a column for each figure of accuracy, and ``p50_us`` and more for times.
    """
    import pandas

    rows = json.loads(_asperity.tradeoff(None if results is None else os.fspath(results)))
    return pandas.DataFrame([_flat(row) for row in rows])


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {key: row[key] for key in ("name", "graph", "tick_hz", "baseline", "faults", "latency_ms")}
    lags = row["lag_ms"] or [None] * 3
    flat |= dict(zip(("lag_10_ms", "lag_50_ms", "lag_90_ms"), lags))
    flat.update(row["figures"])
    flat.update(row["time"] or {})
    return flat


def choose(
    results: str | os.PathLike[str] | None = None,
    *,
    budget_us: float | None = None,
    max_lag_ms: float | None = None,
    tick_hz: int | None = None,
    by: Sequence[str] = (),
    strict: bool = False,
) -> dict[str, Any] | None:
    """Choose the best setting within a budget of time and lag, as ``asperity choose``.

    Parameters
    ----------
    results
        As in `tradeoff`.
    budget_us
        Longest tick in microseconds.
    max_lag_ms
        Longest response lag in milliseconds.
    tick_hz
        Required tick rate in Hz.
    by
        Figures to rank by, most important first; by default all but convergence and precision.
    strict
        Whether the machine's stalls count in the 99.9th percentile.

    Returns
    -------
    The setting with its figures, times and the fragment of its graph; None if no setting is within the budget.
    """
    path = None if results is None else os.fspath(results)
    found = _asperity.choose(path, budget_us, max_lag_ms, tick_hz, list(by), strict)
    return None if found is None else dict(json.loads(found))
