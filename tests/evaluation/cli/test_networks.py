"""Networks in the closed loop from the command line: several varied, and runs whose network is gone."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import pytest

from evaluation.cli import main
from smartmot.lidar.learned import Decoder, PillarGrid
from tests.networks import upright_network

SMALL = Decoder(PillarGrid((0.0, 16.0), (-8.0, 8.0), 0.5, 64), ("car", "pedestrian", "cyclist"))


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


@pytest.fixture
def networks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two networks in a folder whose name has an umlaut and a space; paths below the working folder."""
    pytest.importorskip("onnxruntime")
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "müde netze"
    folder.mkdir()
    names = []
    for slope in (4.0, 3.0):
        path = folder / f"steil {slope:g}.onnx"
        path.write_bytes(upright_network(SMALL, slope))
        names.append(str(path.relative_to(tmp_path)))
    return names


def test_networks_are_varied_beside_one_another(networks: list[str], tmp_path: Path) -> None:
    varied = ("--vary", "sensor=mid70", "--vary", f"perception={','.join(networks)}")
    scenes = ("--scenes", "people on the sidewalk", "--seeds", 1, "--workers", 1, "--strategies", "map")
    assert call("compare", *varied, *scenes, "--out", "out", "--format", "png") == 0
    rows = list(csv.DictReader((tmp_path / "out" / "table.csv").read_text(encoding="utf-8").splitlines()))
    named = [row["settings"].split("perception=")[1].split("@")[0] for row in rows]
    assert named == networks


def test_a_run_is_shown_again_without_its_network(
    networks: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lidar = ("--preset", "physical", "--sensor", "mid70", "--perception", networks[0])
    run = ("cpna", *lidar, "--speeds", 30, "--strategy", "map", "--no-pictures", "--out", "out")
    assert call(*run) == 0
    (log,) = (tmp_path / "out" / "logs").iterdir()
    (tmp_path / networks[0]).unlink()
    capsys.readouterr()
    assert call("replay", log, "--gif", "film.gif") == 0
    assert (tmp_path / "film.gif").read_bytes()[:6] == b"GIF89a"
    # another run needs it
    assert call(*run) == 2
    error = capsys.readouterr().err
    assert "steil 4.onnx: cannot be read: No such file" in error
    assert "Traceback" not in error
