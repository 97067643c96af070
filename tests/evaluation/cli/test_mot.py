"""The command line, as a user sees it."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.cli import main
from evaluation.results.calls import CALL
from evaluation.studies.mot.tables import TRACKS_NUSCENES
from scenarios.catalogue.maps import shipped_map
from tests.scenarios.recorded import argoverse_log

needs_trackeval = pytest.mark.skipif(
    importlib.util.find_spec("trackeval") is None, reason="trackeval is not installed (extra mot)"
)
HEADER = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad,category"


def call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Run the command as the console script does."""
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", "mot", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Two cars at 10 m/s for 5 s on the shipped street: CSV files with labels and ego poses."""
    folder = tmp_path / "drive"
    folder.mkdir()
    rows = [f"{0.1 * k:.1f},{40 + i * 20 + k},{-1.75},4.5,1.8,0.0,car" for k in range(50) for i in range(2)]
    (folder / "detections.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    labels = [f"{row},{i % 2}" for i, row in enumerate(rows)]
    (folder / "labels.csv").write_text("\n".join([f"{HEADER},track_id", *labels]) + "\n")
    ego = [f"{0.1 * k:.1f},{20 + k},-1.75,0.0" for k in range(50)]
    (folder / "ego.csv").write_text("\n".join(["stamp_s,x_m,y_m,yaw_rad", *ego]) + "\n")
    return folder


@needs_trackeval
def test_tables_and_files(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    write = "csv,kitti,nuscenes"
    assert call(monkeypatch, drive, "--out", out, "--write", write, "--similarity", "distance,iou") == 0
    shown = capsys.readouterr().out
    assert "1 sequences, 50 frames, 100 detections (0 impossible ones rejected), 2 tracks" in shown
    assert "HOTA" in shown
    assert "miss" in shown
    assert {path.name for path in out.iterdir()} == {
        *("0.txt", "tracks.csv", TRACKS_NUSCENES, "metrics.csv", "forecast.csv", CALL)
    }
    metrics = pd.read_csv(out / "metrics.csv")
    assert metrics["similarity"].unique().tolist() == ["distance", "iou"]
    assert metrics["mota"].min() == pytest.approx(100.0)
    forecast = pd.read_csv(out / "forecast.csv")
    assert set(forecast["model"]) == {"shipped", "cv", "ctrv", "ca", "imm", "class"}
    assert not forecast["with_map"].any()
    tracks = pd.read_csv(out / "tracks.csv")
    assert len(tracks) == 100


@needs_trackeval
def test_map_filter_and_forecasts_along_lanes(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with (drive / "detections.csv").open("a") as file:
        file.write("4.9,90,60,4.5,1.8,0.0,car\n")
    street = shipped_map("urban_street")
    options = ("--filter", "map", "--map", street, "--write", "nuscenes")
    assert call(monkeypatch, drive, "--out", tmp_path, *options) == 0
    assert "1 detections outside the monitored lanes left out" in capsys.readouterr().out
    assert set(pd.read_csv(tmp_path / "forecast.csv")["with_map"]) == {False, True}
    assert json.loads((tmp_path / TRACKS_NUSCENES).read_text())["meta"]["use_map"] is True


@needs_trackeval
def test_a_log_of_argoverse_2_has_its_own_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    far = argoverse_log.box(3, "far", 5.0, 30.0, "REGULAR_VEHICLE")
    log = argoverse_log.log(tmp_path / "log", [*argoverse_log.boxes(), far])
    options = ("--filter", "map", "--gif", tmp_path / "a.gif", "--frames", "3..4")
    assert call(monkeypatch, log, "--out", tmp_path, *options) == 0
    shown = capsys.readouterr().out
    assert "labels stand in" in shown
    assert "1 detections outside the monitored lanes left out" in shown
    assert "1 sequences, 10 frames, 20 detections" in shown
    assert set(pd.read_csv(tmp_path / "forecast.csv")["with_map"]) == {False, True}
    assert (tmp_path / "tracks.csv").is_file()
    assert (tmp_path / "a.gif").read_bytes()[:3] == b"GIF"


@needs_trackeval
def test_tables_on_a_vector_map(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = argoverse_log.log(tmp_path / "log")
    for named in (log, log / "map" / "log_map_archive_street.json"):
        assert call(monkeypatch, drive, "--out", tmp_path / "out", "--filter", "map", "--map", named) == 0
        assert "detections outside the monitored lanes left out" in capsys.readouterr().out


@needs_trackeval
def test_labels_of_what_is_never_detected_are_pointed_out(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with (drive / "labels.csv").open("a") as file:
        file.write("4.9,90,5,0.6,0.6,0.0,pedestrian,7\n")
    assert call(monkeypatch, drive, "--out", tmp_path) == 0
    shown = capsys.readouterr().out
    assert "labels, but no detections, of pedestrian: not scored" in shown
    assert "nan" not in shown
    assert set(pd.read_csv(tmp_path / "metrics.csv")["category"]) == {"car"}


def test_quiet_prints_nothing(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (drive / "labels.csv").unlink()
    assert (
        call(
            monkeypatch, drive, "--out", tmp_path, "--quiet", "--gif", tmp_path / "a.gif", "--frames", "3..5"
        )
        == 0
    )
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "")
    assert (tmp_path / "a.gif").read_bytes()[:3] == b"GIF"


def test_without_labels_there_are_tracks_only(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (drive / "labels.csv").unlink()
    assert call(monkeypatch, drive, "--out", tmp_path / "out") == 0
    assert "no labels: tracks only, no metrics" in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"tracks.csv", CALL}


@pytest.mark.parametrize(("score", "share"), [(0.39, "4 %"), (0.4, None)])
def test_a_detector_that_is_never_sure_is_pointed_out(
    drive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    score: float,
    share: str | None,
) -> None:
    """With fixed thresholds, `default` lets detections under 0.4 start no track."""
    (drive / "labels.csv").unlink()
    header, *rows = (drive / "detections.csv").read_text().splitlines()
    scores = [0.9] * 4 + [score] * (len(rows) - 4)
    lines = [f"{header},score", *(f"{row},{s}" for row, s in zip(rows, scores, strict=True))]
    (drive / "detections.csv").write_text("\n".join(lines) + "\n")
    assert call(monkeypatch, drive, "--out", tmp_path, "--scores", "fixed") == 0
    shown = capsys.readouterr().out
    assert (f"note: {share} of the car detections have a score of 0.4 or more" in shown) == bool(share)
    assert ("start no track" in shown) == bool(share)


@pytest.mark.parametrize("scores", ["file", "running"])
def test_a_detector_with_low_scores_is_tracked_and_its_scale_is_told(
    drive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    scores: str,
) -> None:
    """Every tenth detection is a false one of 0.02 far off; the others have 0.3."""
    (drive / "labels.csv").unlink()
    header, *rows = (drive / "detections.csv").read_text().splitlines()
    place = header.split(",").index("y_m")
    lines = [f"{header},score"]
    for k, row in enumerate(rows):
        cells = row.split(",")
        if k % 10 == 9:
            cells[place] = str(500.0 + k)
        lines.append(",".join(cells) + (",0.02" if k % 10 == 9 else ",0.3"))
    (drive / "detections.csv").write_text("\n".join(lines) + "\n")
    assert call(monkeypatch, drive, "--out", tmp_path, "--scores", scores) == 0
    shown = capsys.readouterr().out
    weak = len(rows) // 10
    told = f"how many are too weak to start a track: car 0.31 ({weak} of {len(rows)})"
    assert (told in shown) == (scores == "file")
    tracks = pd.read_csv(tmp_path / "tracks.csv")
    assert len(tracks) > 0.7 * len(rows)
    assert tracks["y_m"].max() < 400.0


def test_a_profile_is_written_and_taken(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (drive / "labels.csv").unlink()
    profile = tmp_path / "new" / "mine.json"
    assert call(monkeypatch, drive, "--out", tmp_path, "--profile", profile) == 0
    assert f"profile {profile}: 10 Hz; score of a sure detection and noise: car 1" in capsys.readouterr().out
    assert call(monkeypatch, drive, "--out", tmp_path, "--config", profile) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--config", "nowhere.json"), "nowhere.json: No such file"),
        (("--profile", "profile.txt"), "--profile: profile.txt must end in .json"),
        (("--scores", "low"), "--scores: unknown 'low'; use one of: file, running, fixed"),
        (("--format", "xml"), "--format: unknown 'xml'; use one of: kitti, nuscenes, csv, simbev"),
        (("--config", "best"), "--config: unknown 'best'"),
        (("--filter", "map"), "--filter map: needs --map"),
        (("--filter", "lanes"), "--filter: unknown 'lanes'"),
        (("--similarity", "volume"), "--similarity: unknown 'volume'"),
        (("--threshold", "0.5"), "--threshold: unknown '0.5'"),
        (("--write", "xml"), "--write: unknown 'xml'"),
        (("--gif", "a.gif", "--frames", "5"), "--frames: expected FIRST..LAST"),
        (("--gif", "a.gif", "--frames", "9..5"), "--frames: expected FIRST..LAST"),
        (("--sequence", "7"), "--sequence: no '7'; there are: 0"),
        (("--gif", "a.gif", "--frames", "90..95"), "--frames: sequence 0 has 50 frames"),
        (("--map", "nowhere.xodr"), "nowhere.xodr"),
    ],
)
def test_mistakes_are_one_line_and_status_2(
    drive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    message: str,
) -> None:
    (drive / "labels.csv").unlink()
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, drive, "--out", tmp_path, *arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.strip().splitlines()) == 1


@pytest.mark.parametrize("name", ["nowhere", "empty"])
def test_folders_without_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (tmp_path / "empty").mkdir()
    assert call(monkeypatch, tmp_path / name, "--out", tmp_path) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


@needs_trackeval
def test_kitti_with_every_configuration(kitti: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for config in ("default", "smartmot", "centerpoint", "ab3dmot"):
        out = tmp_path / config
        assert (
            call(
                monkeypatch,
                kitti,
                "--config",
                config,
                "--sequence",
                "0012",
                "--no-forecast",
                "-q",
                "--out",
                out,
            )
            == 0
        )
        metrics = pd.read_csv(out / "metrics.csv", dtype={"sequence": str})
        assert set(metrics["sequence"]) == {"all", "0012"}
        whole = metrics[metrics["sequence"] == "all"].set_index("category")
        assert list(whole.index) == ["car", "pedestrian", "cyclist"]
        assert whole.loc["car", "hota"] > 70.0
        lines = (out / "0012.txt").read_text().splitlines()
        keys = [tuple(line.split()[:2]) for line in lines]
        assert len(set(keys)) == len(keys)


def test_running_without_ego_poses(
    kitti: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("detections", "calib"):
        (tmp_path / name).symlink_to(kitti / name)
    assert call(monkeypatch, tmp_path, "--sequence", "0012", "--out", tmp_path / "out") == 0
    assert "note: no ego poses: tracking in the vehicle's own frame" in capsys.readouterr().out
    tracks = pd.read_csv(tmp_path / "out" / "tracks.csv")
    assert np.isfinite(tracks.select_dtypes("number")).all(axis=None)


def test_help_has_examples_and_start_up_is_light() -> None:
    code = """
import sys
from evaluation.cli import main
sys.argv = ["smartmot-eval", "mot", "--help"]
try:
    main()
except SystemExit as stop:
    assert not stop.code
print([m for m in ("pandas", "scipy", "matplotlib", "trackeval", "evaluation.mot") if m in sys.modules])
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "Examples" in run.stdout
    assert run.stdout.splitlines()[-1] == "[]"


@needs_trackeval
def test_a_table_with_columns_of_another_data_set(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"4,{k},{10 + 0.4 * k:.1f},-20,0,1.8,4.4" for k in range(50)]
    table = tmp_path / "00_tracks.csv"
    table.write_text("\n".join(["trackId,frame,xCenter,yCenter,heading,width,length", *rows]) + "\n")
    pairs = "track_id=trackId,x_m=xCenter,y_m=yCenter,yaw_deg=heading,length_m=length"
    options = (table, "--out", tmp_path / "out", "--columns")
    assert call(monkeypatch, *options, pairs) == 2
    asked = capsys.readouterr().err
    assert "also needed: length_m= and width_m=" in asked
    assert "--frame-rate HZ" in asked
    assert asked.count("\n") == 1
    assert call(monkeypatch, *options, f"{pairs},width_m=width", "--frame-rate", 25) == 0
    tracks = pd.read_csv(tmp_path / "out" / "tracks.csv")
    assert tracks["stamp_s"].iloc[-1] == pytest.approx(49 / 25)
    assert tracks["x_m"].iloc[-1] == pytest.approx(10 + 0.4 * 49, abs=0.05)
