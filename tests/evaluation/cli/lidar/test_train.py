"""`lidar export` where nothing has to be computed."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from evaluation.cli.lidar.train import export_command
from evaluation.errors import ArgumentError
from evaluation.studies.training import NETWORK


def test_a_trained_network_is_copied_without_pytorch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("torch", "onnx", "onnxruntime"):
        monkeypatch.setitem(sys.modules, name, None)
    out = tmp_path / "copy.onnx"
    with pytest.raises(ArgumentError, match=r"network.onnx: no network; finish the training first"):
        export_command(tmp_path, out, quiet=True)
    (tmp_path / NETWORK).write_bytes(b"weights")
    export_command(tmp_path, out, quiet=True)
    assert out.read_bytes() == b"weights"
