"""Figures of accuracy: each one that the trade-off uses. ``docs/explanation/accuracy.md`` explains them."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _asperity

__all__ = ["convergence", "figures", "pitch", "precision"]


def figures(
    rendered: ArrayLike,
    truths: ArrayLike | list[ArrayLike],
    *,
    rate: float,
    truth_rate: float | None = None,
) -> dict[str, float]:
    """Compare a rendered acceleration with the truth.

    Parameters
    ----------
    rendered
        Acceleration in m/s^2: ``(n,)``, or ``(n, axes)``. At least 0.5 s.
    truths
        The same of the truth. A list holds several draws, such as one stroke over several places. Sample 0 of
        all signals is the same moment.
    rate
        Samples a second of `rendered`.
    truth_rate
        Samples a second of `truths`; by default the same.

    Returns
    -------
    ``perceptual``: similarity from 0 to 1; 1 is best.
    ``modulation``, ``spectrum``, ``bands``, ``level``, ``kurtosis``, ``steadiness``: errors in dB; 0 is best.
    ``repetition``: error of the largest autocorrelation, 0 to 1; 0 is best.
    """
    draws: list[Any] = truths if isinstance(truths, list) and np.ndim(truths[0]) > 0 else [truths]
    pairs = _asperity.figures(
        _axes(rendered), [_axes(draw) for draw in draws], float(rate), float(truth_rate or rate)
    )
    return dict(pairs)


def convergence(
    signal: ArrayLike,
    magnitudes: ArrayLike,
    *,
    rate: int,
    scale: Literal["dft", "amplitude"],
) -> dict[str, float]:
    """Compare a signal with the magnitudes that its phase was retrieved from.

    Parameters
    ----------
    signal
        ``(n,)``; sample 0 is the first of frame 0.
    magnitudes, rate, scale
        As in `asperity.invert`. There are more than 100 frames: the first and last 50 do not count.

    Returns
    -------
    ``convergence``: spectral convergence in dB; less is better. ``level``: level error in dB, and
    ``long_term``: root mean square error of the long-term spectrum in dB; 0 is best.
    """
    if scale not in ("dft", "amplitude"):
        raise ValueError(f'scale is "dft" or "amplitude", not {scale!r}')
    unscaled = np.asarray(magnitudes, dtype=np.float32) * np.float32(1 if scale == "dft" else rate / 40)
    found = _asperity.convergence(_wave(signal), unscaled, rate)
    return dict(zip(("convergence", "level", "long_term"), found))


def precision(rendered: ArrayLike, reference: ArrayLike) -> float:
    """Error of a wave against another run of the same setting, sample by sample, in dB; -300 is exact."""
    return _asperity.precision(_wave(rendered), _wave(reference))


def pitch(signal: ArrayLike, *, rate: float, expected_s: float) -> tuple[float, float]:
    """Find the lag at which a wave repeats: over a grating, its pitch over the speed.

    Parameters
    ----------
    signal
        ``(n,)``, at least three times `expected_s` long.
    rate
        Samples a second.
    expected_s
        Expected lag in s; lags from half to one and a half of it are searched.

    Returns
    -------
    The lag in s, and the autocorrelation there, -1 to 1.
    """
    return _asperity.pitch(_wave(signal), float(rate), float(expected_s))


def _wave(signal: ArrayLike) -> NDArray[np.float64]:
    return np.ascontiguousarray(signal, dtype=np.float64)


def _axes(signal: ArrayLike) -> NDArray[np.float64]:
    wave = _wave(signal)
    return wave[:, None] if wave.ndim == 1 else wave
