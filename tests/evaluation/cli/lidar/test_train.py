"""`lidar export`: copies, and networks with integers made without PyTorch."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import typer

from benchmarks.training_frames import fresh_streets
from evaluation.cli.entry import app
from evaluation.errors import ArgumentError
from evaluation.studies.detectors.quality import QualityOptions, measured_quality
from evaluation.studies.training import NETWORK
from smartmot.errors import ConfigError
from smartmot.lidar.learned import LearnedConfig, shipped_network, shipped_path


def export(network: object, out: Path, *words: object) -> None:
    """The command, whose errors are raised."""
    given = ("lidar", "export", network, "--out", out, *words, "--quiet")
    typer.main.get_command(app)([str(word) for word in given], standalone_mode=False)


def test_a_trained_network_is_copied_without_pytorch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("torch", "onnx", "onnxruntime"):
        monkeypatch.setitem(sys.modules, name, None)
    out = tmp_path / "copy.onnx"
    with pytest.raises(ArgumentError, match=r"network.onnx: no network; finish the training first"):
        export(tmp_path, out)
    (tmp_path / NETWORK).write_bytes(b"weights")
    export(tmp_path, out)
    assert out.read_bytes() == b"weights"


def test_the_shipped_network_gets_integers_without_pytorch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few frames: that F1 differs by less than 0.02 is measured by benchmarks.lidar_int8 on many."""
    pytest.importorskip("onnx")
    monkeypatch.setitem(sys.modules, "torch", None)
    folder = tmp_path / "Größe und Maß"
    folder.mkdir()
    out = folder / "klein 8.onnx"
    export("pillars", out, "--int8", "--calibrate", 6)
    assert out.stat().st_size < 0.4 * shipped_path("pillars").stat().st_size
    small = LearnedConfig(out)
    assert small.network.decoder == shipped_network().network.decoder
    frames = list(fresh_streets(12, 999))
    counted = [
        measured_quality(frames, config, QualityOptions(10))[0] for config in (shipped_network(), small)
    ]
    labels = sum(each.labels for each in counted[0].values())
    right = [sum(each.counts(0.3).true_positives for each in boxes.values()) for boxes in counted]
    false = [sum(each.counts(0.3).false_positives for each in boxes.values()) for boxes in counted]
    f1 = 2.0 * np.array(right) / (np.array(right) + false + labels)
    assert labels > 60
    assert f1[0] > 0.5
    assert abs(f1[1] - f1[0]) < 0.1
    with pytest.raises(ArgumentError, match="has integers of 8 bits already"):
        export(out, tmp_path / "again.onnx", "--int8", "--calibrate", 1)
    assert not (tmp_path / "again.onnx").exists()


def test_a_network_of_a_file_is_copied_and_what_makes_no_sense_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "copy.onnx"
    export(shipped_path("pillars"), out)
    assert out.read_bytes() == shipped_path("pillars").read_bytes()
    with pytest.raises(ArgumentError, match="--calibrate: has no effect without --int8; add it"):
        export(out, tmp_path / "b.onnx", "--calibrate", 3)
    with pytest.raises(ArgumentError, match="--data: has no effect without --int8; add it"):
        export(out, tmp_path / "b.onnx", "--data", tmp_path)
    with pytest.raises(ArgumentError, match="is the network itself"):
        export(out, out)
    with pytest.raises(ConfigError, match=r"missing\.onnx: cannot be read"):
        export(tmp_path / "missing.onnx", tmp_path / "b.onnx")
    with pytest.raises(ArgumentError, match=r"--out: a name that ends in \.onnx, got '.*/pillars'"):
        export("pillars", tmp_path / "pillars")
    assert not (tmp_path / "pillars").exists()
    assert not (tmp_path / "b.onnx").exists()
