"""Figures, fits, and the trade-off."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import asperity
from asperity import accuracy
from conftest import Run

RATE = 5000


def noise(seed: int, seconds: float = 4.0) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.random.default_rng(seed).normal(size=int(seconds * RATE))


def test_figures_of_the_same_signal_are_best() -> None:
    found = accuracy.figures(noise(1), noise(1), rate=RATE)
    assert set(found) == {
        "perceptual", "modulation", "spectrum", "bands", "level", "repetition", "kurtosis", "steadiness"
    }  # fmt: skip
    assert found.pop("perceptual") == pytest.approx(1.0)
    assert all(error == pytest.approx(0.0, abs=1e-9) for error in found.values())


def test_level_of_twice_the_amplitude_is_6_db_off() -> None:
    found = accuracy.figures(2 * noise(1), [noise(2), noise(3)], rate=RATE)
    assert found["level"] == pytest.approx(6.02, abs=0.3)
    three = np.column_stack([noise(1), 0 * noise(1), 0 * noise(1)])
    assert accuracy.figures(noise(1), three, rate=RATE)["level"] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(asperity.Error, match=r"less than 0\.5 s"):
        accuracy.figures(noise(1, 0.2), noise(1), rate=RATE)


def test_precision_and_pitch() -> None:
    wave = np.sin(2 * np.pi * 40 * np.arange(RATE) / RATE)
    assert accuracy.precision(1.1 * wave, wave) == pytest.approx(-20.0)
    lag_s, likeness = accuracy.pitch(wave, rate=RATE, expected_s=0.03)
    assert lag_s == pytest.approx(0.025, abs=2e-4)
    assert likeness == pytest.approx(1.0, abs=0.01)


def test_convergence_of_the_right_signal_is_best() -> None:
    rate, window = 2500, np.hanning(251)[:-1]
    signal = np.random.default_rng(4).normal(size=2 * rate)
    frames = np.lib.stride_tricks.sliding_window_view(signal, 250)[::5]
    magnitudes = np.abs(np.fft.rfft(frames * window, axis=1))[:, :101]
    right = accuracy.convergence(signal, magnitudes, rate=rate, scale="dft")
    assert right["convergence"] < -60 and abs(right["level"]) < 0.01
    half = accuracy.convergence(0.5 * signal, magnitudes / 62.5, rate=rate, scale="amplitude")
    assert half["level"] == pytest.approx(-6.02, abs=0.01)
    with pytest.raises(asperity.Error, match="not more than 100 frames"):
        accuracy.convergence(signal, magnitudes[:50], rate=rate, scale="dft")


def test_texture_is_fitted_and_plays(tmp_path: Path) -> None:
    n = np.zeros(20_000)
    random, y = np.random.default_rng(5).normal(size=n.size), np.zeros(n.size)
    for i in range(2, n.size):
        y[i] = 1.2 * y[i - 1] - 0.7 * y[i - 2] + random[i]
    found = asperity.fit_ar(n + 1.0, n + 80.0, y, rate=2000, order=4)
    assert (found.models, found.order) == (1, 4) and found.seconds > 5
    found.save(tmp_path / "rough.ron")
    assert (tmp_path / "rough.ron").read_text() == found.text
    with pytest.raises(ValueError, match=r"\.ron"):
        found.save("rough.txt")
    with pytest.raises(asperity.Error, match="an order of 65"):
        asperity.fit_ar(n + 1.0, n + 80.0, y, rate=2000, order=65)


def test_shipped_tradeoff_and_choice_are_those_of_the_program(program: Run) -> None:
    pytest.importorskip("pandas")
    frame = asperity.tradeoff()
    assert len(frame) > 20 and {"perceptual", "lag_50_ms", "p50_us"} <= set(frame.columns)
    expected = json.loads(program("choose", "--budget-us", "100", "--max-lag-ms", "40", "--json"))
    assert asperity.choose(budget_us=100, max_lag_ms=40) == expected
    assert asperity.choose(budget_us=1e-3) is None
    with pytest.raises(asperity.Error, match="no figure `beauty`"):
        asperity.choose(by=["beauty"])


def test_log_of_a_study_is_read(tmp_path: Path) -> None:
    begin = {
        "event": "begin", "study": "rough or not", "participant": "p1", "number": 1, "version": "0.1.0",
        "files": [["experiment.ron", "00"]], "at": "2026-01-01T00:00:00Z",
    }  # fmt: skip
    log = tmp_path / "p1.jsonl"
    log.write_text("\n".join(json.dumps(e) for e in (begin, {"event": "shown", "trial": 0, "attempt": 0})) + "\n{torn")
    events = asperity.study_log(log)
    assert [event["event"] for event in events] == ["begin", "shown"]
    assert events[0]["participant"] == "p1"
    log.write_text("no event\n")
    with pytest.raises(asperity.Error, match="line 1 is no event"):
        asperity.study_log(log)
