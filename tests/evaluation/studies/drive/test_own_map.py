"""Drives over logs that bring their own map."""

import json
from pathlib import Path

import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.drive.recordings import Source
from evaluation.studies.drive.study import Options, drive_all, prepare
from scenarios.errors import DatasetError
from scenarios.recorded.maps.vector_map import VectorMap
from tests.scenarios.recorded import argoverse_log

SHARED = Path(__file__).parents[4].parent / "shared" / "argoverse2" / "logs"


class NoProgress:
    def begin(self, description: str, total: int) -> None:
        pass

    def done(self) -> None:
        pass


def test_the_map_of_a_log(tmp_path: Path) -> None:
    study = prepare(Options(Source(argoverse_log.log(tmp_path / "log")), preset="physical"))
    [recording] = study.recordings
    assert isinstance(study.maps[recording.map_path], VectorMap)
    assert [spec.strategy for spec in study.specs] == ["rectangular", "map", "all", "path", "adaptive"]
    # the EGO_VEHICLE box of the data set, poses at the rear axle
    assert (recording.vehicle.length_m, recording.vehicle.center_ahead_m) == (4.877, 1.42)
    result = drive_all(study, tmp_path / "out", NoProgress())
    assert all(drive.off_map == (0, 1) for drive in result.drives if drive.spec.strategy == "map")
    written = json.loads((tmp_path / "out" / "drives.json").read_text())
    assert written["configuration"]["recordings"][0]["map"].endswith("log_map_archive_street.json")


def test_a_log_without_a_map(tmp_path: Path) -> None:
    log = argoverse_log.log(tmp_path / "log")
    (archive,) = (log / "map").iterdir()
    archive.write_text("{")
    with pytest.raises(DatasetError, match=r"log_map_archive_street\.json: line 1: not JSON"):
        prepare(Options(Source(log)))
    archive.unlink()
    strategies = [spec.strategy for spec in prepare(Options(Source(log))).specs]
    assert strategies == ["rectangular", "all", "path", "adaptive"]
    with pytest.raises(ArgumentError, match="strategy map: the data have no map"):
        prepare(Options(Source(log), strategies=("map",)))


@pytest.mark.parametrize(
    "name", ["3b3570b4-7b0b-3268-a571-b0889dbf40b6", "7fab2350-7eaf-3b7e-a39d-6937a4c1bede"]
)
def test_real_logs(name: str, tmp_path: Path) -> None:
    if not SHARED.is_dir():
        pytest.skip("logs of Argoverse 2 are not in ../shared/argoverse2")
    study = prepare(Options(Source(SHARED / name), strategies=("map",)))
    result = drive_all(study, tmp_path, NoProgress())
    assert [drive.off_map[0] for drive in result.drives] == [0]
    # what the last label shows arrives after the recording has ended
    assert result.drives[0].frames == len(study.recordings[0].sequence) - 1
