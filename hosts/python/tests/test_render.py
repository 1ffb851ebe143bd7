"""Renders: the same bytes as the program, probes, reports, Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import asperity
from conftest import Run, write_csv

SINE = """Graph(version: 1, nodes: {
    "tone": (kind: "sine", params: (frequency_hz: 100.0, unit: "A")), "out": (kind: "audio_out"),
    "limiter": (kind: "limiter", params: (profile: "hapcoil_one")),
}, wires: [("tone", "limiter"), ("limiter", "out")])"""


@pytest.mark.parametrize("name", ["texture.ron", "heravi2024.ron", "live.ron", "scenes/twelve.ron"])
def test_render_gives_the_bytes_of_the_program(
    name: str, program: Run, graphs: Path, stroke: NDArray[np.float64], tmp_path: Path
) -> None:
    csv, out = write_csv(tmp_path / "stroke.csv", stroke), tmp_path / "out.npy"
    program("render", graphs / name, "--input", csv, "--set", "seed=7", "--out", out, "--quiet")
    expected = np.load(out)
    graph = asperity.Graph(graphs / name)
    for given in (stroke, csv):
        felt = graph.render(given, seed=7)
        assert felt.audio.dtype == np.float32
        assert felt.audio.shape == expected.shape
        assert felt.audio.tobytes() == expected.tobytes()
    assert np.abs(expected).max() > 0
    assert graph.render(stroke, seed=8).audio.tobytes() != expected.tobytes()


def test_settings_probes_and_report_are_those_of_the_program(
    program: Run,
    graphs: Path,
    stroke: NDArray[np.float64],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The program writes the files of probes into its working directory alone.
    monkeypatch.chdir(tmp_path)
    csv = write_csv(tmp_path / "stroke.csv", stroke)
    files = {name: Path(f"{name}.npy") for name in ("floor.force", "texture", "stylus.position")}
    probes = [part for name, file in files.items() for part in ("--probe", f"{name}={file}")]
    settings = ["--set", "texture.material=oak", "--set", "motion.cutoff_hz=30"]
    report = tmp_path / "report.json"
    program(
        "render", graphs / "texture.ron", "--input", csv, *settings, *probes, "--report", report, "--quiet"
    )
    graph = asperity.Graph(graphs / "texture.ron", material="oak", set={"motion.cutoff_hz": 30.0})
    felt = graph.render(stroke, probes=list(files))
    assert list(felt) == list(files)
    for name, file in files.items():
        assert felt[name].tobytes() == np.load(file).tobytes(), name
    assert (felt["floor.force"].unit, felt["floor.force"].rate) == ("N", 500.0)
    assert (felt["texture"].ndim, felt["texture"].bin_hz) == (2, 10.0)
    assert len(felt["texture"].times) == len(felt["texture"])
    expected = json.loads(report.read_text())
    found = felt.report
    assert found.keys() == expected.keys()
    for same in ("seed", "ticks", "seconds", "faults", "output", "dropped", "tick_hz", "interrupted"):
        assert found[same] == expected[same], same
    assert [n["calls"] for n in found["nodes"] if "probe" not in n["id"]] == [
        n["calls"] for n in expected["nodes"] if "probe" not in n["id"]
    ]
    assert found["latency"].keys() == expected["latency"].keys()


def test_stroke_without_height_lies_in_the_surface(graphs: Path, stroke: NDArray[np.float64]) -> None:
    felt = asperity.Graph(graphs / "texture.ron").render(stroke[:, :3], probes=["floor.force"])
    assert np.allclose(felt["floor.force"], 1.0)


def test_data_frame_is_read_by_its_columns(graphs: Path, stroke: NDArray[np.float64]) -> None:
    pandas = pytest.importorskip("pandas")
    graph = asperity.Graph(graphs / "texture.ron")
    frame = pandas.DataFrame({"Fz": 1.0, "t_s": stroke[:, 0], "x_mm": stroke[:, 1], "y_mm": stroke[:, 2]})
    felt = graph.render(frame, columns={"force_n": "Fz:N"}, probes=["stylus.position", "stylus.force"])
    assert np.allclose(felt["stylus.force"], 1.0)
    assert np.allclose(felt["stylus.position"][:, 2], -2.0)


def test_bad_stroke_is_an_error_with_its_row(graphs: Path, stroke: NDArray[np.float64]) -> None:
    stroke[7, 0] = stroke[6, 0]
    graph = asperity.Graph(graphs / "texture.ron")
    with pytest.raises(asperity.Error, match=r"<stroke>:9:1: error: the clock stands still") as e:
        graph.render(stroke)
    assert "^" in str(e.value)
    with pytest.raises(ValueError, match=r"\(n, 4\)"):
        graph.render(stroke[:, :2])


def test_channels_and_duration(tmp_path: Path) -> None:
    felt = asperity.render(SINE, seconds=0.25)
    assert felt.audio.shape == (12000,)
    assert len(felt) == 0
    two = SINE.replace('"out": (', '"other": (kind: "audio_out"), "out": (').replace(
        "wires: [", 'wires: [("limiter", "other"), '
    )
    assert asperity.render(two, seconds=0.25).audio.shape == (12000, 2)


def test_graph_that_needs_a_device_is_refused(graphs: Path) -> None:
    with pytest.raises(asperity.Error, match="needs a live device"):
        asperity.Graph(graphs / "live.ron").render()


def test_plot_draws_output_and_probes(graphs: Path, tmp_path: Path) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("svg")
    felt = asperity.Graph(graphs / "texture.ron").render(seconds=0.3, probes=["floor.force", "texture"])
    figure = felt.plot()
    assert len(figure.axes) == 3
    figure.savefig(tmp_path / "felt.svg")


def test_other_threads_run_while_a_graph_renders(graphs: Path) -> None:
    graph, counted, stop = asperity.Graph(graphs / "texture.ron"), [0], threading.Event()

    def count() -> None:
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0)

    thread = threading.Thread(target=count)
    thread.start()
    before = counted[0]
    graph.render(seconds=20.0, sleep=False)
    during = counted[0] - before
    stop.set()
    thread.join()
    # With the GIL held, the thread would run once at most.
    assert during > 10


@pytest.mark.skipif(os.name == "nt", reason="signals of Unix")
def test_ctrl_c_ends_a_long_render(graphs: Path) -> None:
    code = (
        "import asperity, sys\n"
        f"graph = asperity.Graph({str(graphs / 'texture.ron')!r})\n"
        "print('begins', flush=True)\n"
        "try:\n    graph.render(seconds=1e6)\n"
        "except KeyboardInterrupt:\n    print('interrupted')\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as it:
        assert it.stdout is not None
        assert it.stdout.readline() == "begins\n"
        time.sleep(0.3)
        it.send_signal(signal.SIGINT)
        out, _ = it.communicate(timeout=60)
    assert out == "interrupted\n"
