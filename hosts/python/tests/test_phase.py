"""Phase retrieval without a graph."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import asperity
from conftest import Run

RATE, LENGTH, HOP = 2500, 250, 5


def dft(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Magnitudes of an unscaled DFT, as `invert` wants them."""
    window = np.hanning(LENGTH + 1)[:-1]
    frames = np.lib.stride_tricks.sliding_window_view(signal, LENGTH)[::HOP]
    return np.abs(np.fft.rfft(frames * window, axis=1))[:, :101]


@pytest.fixture
def tone() -> NDArray[np.float64]:
    """Half a second of 150 Hz, 0.8 m/s^2."""
    return 0.8 * np.sin(2 * np.pi * 150 * np.arange(RATE // 2) / RATE)


def test_invert_gives_the_bytes_of_the_program(
    tone: NDArray[np.float64], program: Run, tmp_path: Path
) -> None:
    magnitudes, out = dft(tone).astype(np.float32), tmp_path / "y.npy"
    np.save(tmp_path / "S.npy", magnitudes)
    rest = ("--rate", RATE, "--scale", "dft", "--out", out, "--phase", "spsi")
    program("invert", "--magnitudes", tmp_path / "S.npy", *rest)
    found = asperity.invert(magnitudes, rate=RATE, scale="dft", phase="spsi")
    assert found.tobytes() == np.load(out).tobytes()


def test_numpy_and_the_program_read_archives_of_each_other(
    tone: NDArray[np.float64], program: Run, graphs: Path, tmp_path: Path
) -> None:
    magnitudes, mine, probed, out = dft(tone), tmp_path / "S.npz", tmp_path / "m.npz", tmp_path / "y.npy"
    stated = {"rate": RATE, "hop": HOP, "window": "hann", "window_length": LENGTH, "scale": "dft"}
    np.savez_compressed(mine, magnitudes=magnitudes, **stated)  # type: ignore[arg-type]
    program("invert", "--magnitudes", mine, "--out", out, "--phase", "spsi")
    found = asperity.invert(magnitudes, rate=RATE, scale="dft", phase="spsi")
    assert found.tobytes() == np.load(out).tobytes()

    program("render", graphs / "texture.ron", "--seconds", 1, "--probe", f"texture={probed}")
    program("invert", "--magnitudes", probed, "--out", out, "--phase", "spsi")
    m = np.load(probed)
    assert {name: m[name].item() for name in stated} == stated | {"scale": "amplitude", "hop": 5}
    assert m["magnitudes"].shape[1] == 101 and str(m["unit"]) == "m/s^2"
    found = asperity.invert(m["magnitudes"], rate=int(m["rate"]), scale="amplitude", phase="spsi")
    assert found.tobytes() == np.load(out).tobytes()


def test_spectra_and_controls_have_their_own_archives(program: Run, graphs: Path, tmp_path: Path) -> None:
    files = {port: tmp_path / f"{port}.npz" for port in ("phase", "motion.speed")}
    probes = [part for port, file in files.items() for part in ("--probe", f"{port}={file}")]
    program("render", graphs / "heravi2024.ron", "--seconds", 0.5, *probes)
    spectrum, speed = np.load(files["phase"]), np.load(files["motion.speed"])
    assert spectrum["spectrum"].dtype == np.complex64 and spectrum["spectrum"].ndim == 2
    assert str(spectrum["scale"]) == "amplitude" and int(spectrum["window_length"]) == spectrum["rate"] // 10
    assert speed["values"].shape == (250,) and int(speed["rate"]) == 500 and "scale" not in speed


def test_both_scales_give_the_level_of_the_signal(tone: NDArray[np.float64]) -> None:
    magnitudes = dft(tone)
    for scale, factor in (("dft", 1.0), ("amplitude", 4.0 / LENGTH)):
        y = asperity.invert(factor * magnitudes, rate=RATE, scale=scale, phase="sample_commit", frames=5)  # type: ignore[arg-type]
        level = np.sqrt(2 * np.mean(y[LENGTH:-LENGTH].astype(float) ** 2))
        assert level == pytest.approx(0.8, rel=0.05), scale


def test_invert_says_what_is_wrong(tone: NDArray[np.float64]) -> None:
    magnitudes = dft(tone)
    with pytest.raises(TypeError, match="scale"):
        asperity.invert(magnitudes, rate=RATE)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match='"dft" or "amplitude"'):
        asperity.invert(magnitudes, rate=RATE, scale="db")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="frames, bins"):
        asperity.invert(magnitudes[0], rate=RATE, scale="dft")
    with pytest.raises(asperity.Error, match="multiple of 10"):
        asperity.invert(magnitudes, rate=2501, scale="dft")
    with pytest.raises(asperity.Error, match="spsi"):
        asperity.invert(magnitudes, rate=RATE, scale="dft", phase="spsy")
    with pytest.raises(asperity.Error, match="framez"):
        asperity.invert(magnitudes, rate=RATE, scale="dft", phase="sample_commit", framez=5)
    with pytest.warns(asperity.AsperityWarning, match="1 magnitudes are negative"):
        magnitudes[3, 3] = -1.0
        asperity.invert(magnitudes, rate=RATE, scale="dft", phase="spsi")


def test_compare_ranks_named_methods(program: Run, tmp_path: Path) -> None:
    found = asperity.compare(["spsi", "random_phase", "sample_commit:frames=3"], show_progress=False)
    labels = [row["label"] for row in found.rows]
    assert sorted(labels) == ["random_phase", "sample_commit:frames=3", "spsi"]
    assert "Spectral convergence" in str(found) and "<svg" in found._repr_svg_()
    expected = json.loads(program("compare", "--json", "--quiet"))
    theirs = {row["label"]: row["scores"] for row in expected["methods"]}
    ours = {row["label"]: row["scores"] for row in found.rows}
    assert ours["spsi"] == theirs["spsi"]
    pytest.importorskip("pandas")
    assert set(found.frame()["method"]) >= set(labels)


def test_compare_refuses_unknown_methods() -> None:
    with pytest.raises(asperity.Error, match="not a phase-retrieval node"):
        asperity.compare(["spsy"])
    with pytest.raises(asperity.Error, match="named twice"):
        asperity.compare(["spsi", "spsi"])
    with pytest.raises(asperity.Error, match="nowhere"):
        asperity.compare(["spsi"], vectors="nowhere")
