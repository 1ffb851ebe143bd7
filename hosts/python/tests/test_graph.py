"""Graphs: their settings, errors and picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import asperity


def test_graph_shows_its_nodes_and_picture(graphs: Path) -> None:
    graph = asperity.Graph(graphs / "texture.ron")
    assert graph.nodes["texture"] == "texture_network"
    assert (graph.tick_hz, graph.audio_hz, graph.seed) == (500, 48000, 2024)
    assert graph._repr_svg_().startswith("<svg") or "<svg" in graph.svg
    assert "texture.ron" in repr(graph)


def test_shipped_graph_is_found_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert "texture" in asperity.Graph("graphs/texture.ron").nodes


def test_error_has_file_line_column_and_caret(graphs: Path, tmp_path: Path) -> None:
    text = (graphs / "live.ron").read_text().replace('"velocity"', '"velocitee"')
    file = tmp_path / "bad.ron"
    file.write_text(text)
    with pytest.raises(asperity.Error) as e:
        asperity.Graph(file)
    said = str(e.value)
    line = next(i for i, line in enumerate(text.splitlines(), 1) if "velocitee" in line)
    assert said.startswith(f"{file}:{line}:")
    assert "^^^" in said and "help:" in said and "velocity" in said
    with pytest.raises(asperity.Error, match=r"<text>:1:\d+: error"):
        asperity.Graph("Graph(version: 1, nodez: {})")


def test_setting_of_the_only_node_that_has_it(graphs: Path) -> None:
    path = graphs / "texture.ron"
    assert asperity.Graph(path, material="oak", tick_hz=250, audio_hz=44100, seed=3).tick_hz == 250
    with pytest.raises(asperity.Error, match="no node of this graph has a parameter `materiel`") as e:
        asperity.Graph(path, materiel="oak")
    assert "`material`" in str(e.value)
    with pytest.raises(asperity.Error, match="several nodes have a parameter `profile`") as e:
        asperity.Graph(path, profile="hapcoil_one")
    assert "inverse.profile" in str(e.value)
    with pytest.raises(asperity.Error, match="cutoff_hz"):
        asperity.Graph(path, set={"motion.cutoff_hz": -1.0})
    with pytest.raises(asperity.Error, match="granite"):
        asperity.Graph(path, material="granite, polished")


def test_values_of_all_kinds_can_be_set(graphs: Path) -> None:
    path = graphs / "texture.ron"
    graph = asperity.Graph(path, set={"strength.gain": np.float64(0.5), "stylus.loop": True})
    quiet = asperity.Graph(path, gain=0.0).render(seconds=0.2)
    assert not quiet.audio.any()
    with pytest.raises(asperity.Error, match="no source of this graph has a duration"):
        graph.render()
    assert graph.render(seconds=0.2).audio.size == 9600


def test_materials_are_listed() -> None:
    found = asperity.materials()
    assert len(found) > 50
    assert any(m.name == "oak" and m.description for m in found)
    with pytest.raises(asperity.Error, match=r"nowhere\.ron"):
        asperity.materials("nowhere.ron")


def test_response_lag_is_measured(graphs: Path) -> None:
    lag = asperity.Graph(graphs / "texture.ron").response_lag()
    _, half, _ = lag["response_lag_ms"]
    assert 1.0 < half < 30.0
    assert lag["declared_ms"] > 0.0
