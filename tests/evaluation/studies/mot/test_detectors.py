"""Recordings of several detectors: whose boxes, when they arrive, what the user is told."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.cli import main
from evaluation.errors import ArgumentError
from evaluation.studies.mot.detectors import detectors_of, left_out_lines
from evaluation.studies.mot.run import prepare, track_dataset
from scenarios.errors import DatasetError
from scenarios.recorded.csv_files import read_csv
from smartmot import DetectorProfile, tracker_config
from smartmot.plugins import Plugin

HEADER = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad,score,category,detector"
CONFIG = tracker_config("default")


def _call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", "mot", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def _recording(folder: Path, camera_delay_s: float | None, last: str = "") -> Path:
    """A car at 10 m/s, a lidar at 10 Hz; a camera at 5 Hz, 0.05 s later, alone sees a second car."""
    folder.mkdir(exist_ok=True)
    rows = []
    for k in range(30):
        t = 0.1 * k
        arrival = "" if camera_delay_s is None else f",{t:.3f}"
        rows.append((t, f"{t:.3f},{10.0 * t},0,4.5,1.8,0,0.9,car,lidar{arrival}"))
        if k % 2 == 0:
            t += 0.05
            arrival = "" if camera_delay_s is None else f",{t + camera_delay_s:.3f}"
            rows += [
                (t, f"{t:.3f},{x},{y},4.5,1.8,0,0.4,car,camera{arrival}") for x, y in ((10.0 * t, 0), (5, 9))
            ]
    header = HEADER + ("" if camera_delay_s is None else ",received_s")
    lines = [header, *(line for _, line in sorted(rows, key=lambda row: row[0])), last]
    (folder / "detections.csv").write_text("\n".join(filter(None, lines)) + "\n")
    return folder


def test_late_measurements_lead_to_the_same_tracks(tmp_path: Path) -> None:
    ends = []
    for name, delay_s in (("prompt", None), ("late", 0.33)):
        study = prepare(_recording(tmp_path / name, delay_s), CONFIG)
        assert list(study.detectors) == ["camera", "lidar"]
        [tracked] = track_dataset(study.data, study.config, detectors=study.detectors)  # type: ignore[arg-type]
        assert left_out_lines([tracked]) == []
        last = (
            tracked.tracks.frame == 42
        )  # of the lidar at 2.7 s: the camera's of 2.25 s and before have arrived
        ends.append(tracked.tracks[last])
    prompt, late = ends
    assert len(prompt) == len(late) == 2
    np.testing.assert_allclose(late.center_m, prompt.center_m, atol=0.05)
    assert sorted(late.object_id.tolist()) == [1, 2]


def test_what_is_told_of_each_detector(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    profile = tmp_path / "camera.json"
    DetectorProfile("camera", 5.0, delay_s=0.33, trust=0.5).save(profile)
    folder = _recording(tmp_path / "data", 0.33)
    assert _call(monkeypatch, folder, "--detectors", f"camera={profile}", "--out", tmp_path / "out") == 0
    told = capsys.readouterr().out
    assert "detector camera: 30 boxes in 15 measurements, 0.33 s late (median), trust 0.5" in told
    assert "detector lidar: 30 boxes in 30 measurements" in told
    assert "left out" not in told


def test_measurements_beyond_the_buffer_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = _recording(tmp_path / "data", 1.5)
    assert _call(monkeypatch, folder, "--scores", "running", "--out", tmp_path / "out") == 0
    told = capsys.readouterr().out
    # those that the lidar is more than a second ahead of when they arrive: of 0.05 to 1.85 s
    assert "detector camera: 10 measurements arrived later than the tracker waits: left out" in told
    assert "detector lidar: 1" not in told


def test_weak_boxes_are_those_of_a_detector_and_not_of_the_sum(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The camera's 0.4 is as sure as the lidar's 0.9: 0.3 starts a track by the one alone."""
    folder = _recording(tmp_path / "data", None)
    file = folder / "detections.csv"
    lines = file.read_text().splitlines()
    weak = [f"3.1,{x},0,4.5,1.8,0,0.3,car,{name}" for x, name in ((500, "camera"), (600, "lidar"))]
    file.write_text("\n".join([*lines, *weak]) + "\n")
    assert _call(monkeypatch, folder, "--out", tmp_path / "out") == 0
    told = capsys.readouterr().out
    assert "detector lidar: 1 boxes have scores too low to start a track" in told
    assert "detector camera: 1 boxes" not in told
    assert "dropped" not in told


def test_a_delay_of_the_profile_stands_in_for_times_of_arrival(tmp_path: Path) -> None:
    data = read_csv(_recording(tmp_path / "data", None))
    late = {"lidar": DetectorProfile("lidar", 10.0), "camera": DetectorProfile("camera", 5.0, delay_s=0.33)}
    [tracked] = track_dataset(data, replace(CONFIG, score_reference=1.0), detectors=late)
    second = tracked.tracks[tracked.tracks.center_m[:, 1] > 5.0]
    stamps = tracked.sequence.stamp_s[second.frame]
    lidar_only = tracked.sequence.detections.detector == "lidar"
    of_lidar = np.unique(tracked.sequence.detections.frame[lidar_only])
    seen_then = stamps[np.isin(second.frame, of_lidar)]
    assert seen_then[0] == pytest.approx(0.4)  # the first frame of the lidar after 0.05 s + 0.33 s


@pytest.mark.parametrize(
    ("last", "profiles", "message"),
    [
        ("9.0,0,0,4.5,1.8,0,0.9,car,", {}, "some boxes have none"),
        (
            "",
            {"radar": DetectorProfile("radar", 20.0)},
            "no detector 'radar' in the data; there are: camera, lidar",
        ),
    ],
)
def test_detectors_that_are_not_there(
    tmp_path: Path, last: str, profiles: dict[str, DetectorProfile], message: str
) -> None:
    data = read_csv(_recording(tmp_path / "data", None, last))
    with pytest.raises(DatasetError, match=message):
        detectors_of(data, "file", profiles)


def test_a_recording_of_one_detector_has_no_profiles(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "detections.csv").write_text(HEADER.removesuffix(",detector") + "\n0.0,0,0,4,2,0,0.9,car\n")
    assert detectors_of(read_csv(folder), "file", {}) == {}


@pytest.mark.parametrize("text", ["lidar", "=a.json", "lidar={a},lidar={a}"])
def test_a_wrong_option_is_one_line(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.json"
    DetectorProfile("lidar", 10.0).save(path)
    assert _call(monkeypatch, tmp_path, "--detectors", text.format(a=path)) == 2
    assert "--detectors: expected NAME=FILE" in capsys.readouterr().err


def test_existence_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pandas as pd

    folder = _recording(tmp_path / "data", None)
    for name, told in (("default", True), ("smartmot", False)):
        assert _call(monkeypatch, folder, "--config", name, "--out", tmp_path / name, "--quiet") == 0
        table = pd.read_csv(tmp_path / name / "tracks.csv")
        assert ("existence" in table) == told
    existence = pd.read_csv(tmp_path / "default" / "tracks.csv")["existence"]
    assert existence.iloc[0] == 0.5
    assert existence.iloc[-1] > 0.99


def test_times_of_another_clock_are_refused(tmp_path: Path) -> None:
    data = read_csv(_recording(tmp_path / "data", 1.7e9))
    with pytest.raises(DatasetError, match="is it in seconds, by the clock of stamp_s"):
        detectors_of(data, "file", {})


def test_profiles_are_not_for_trackers_of_ones_own(tmp_path: Path) -> None:
    folder = _recording(tmp_path / "data", None)
    given = {"lidar": DetectorProfile("lidar", 10.0)}
    with pytest.raises(ArgumentError, match="--detectors: a tracker of your own"):
        prepare(folder, Plugin("somewhere:Tracker", ""), profiles=given)
