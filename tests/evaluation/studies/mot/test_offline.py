"""Hindsight: gaps filled, single false detections left out, scored and written apart."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.cli import main
from evaluation.studies.mot.offline import offline_config, with_hindsight
from evaluation.studies.mot.run import score_tracks, track_dataset
from scenarios.recorded.csv_files import read_csv
from smartmot import tracker_config

HEADER = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad,score,category"
HIDDEN = range(20, 40)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A pedestrian at 1.4 m/s, hidden for 2 s of 6; a weak false box beside the way in three frames."""
    rng = np.random.default_rng(0)
    rows, labels = [], []
    for k in range(60):
        t, x = 0.1 * k, 0.14 * k
        labels.append(f"{t:.1f},{x:.3f},0,0.6,0.6,0,1,pedestrian,7")
        if k not in HIDDEN:
            noisy = rng.normal(0.0, 0.1, 2)
            rows.append(f"{t:.1f},{x + noisy[0]:.3f},{noisy[1]:.3f},0.6,0.6,0,0.9,pedestrian")
        if k in (5, 6, 7):
            rows.append(f"{t:.1f},3,6,0.6,0.6,0,0.2,pedestrian")
    data = tmp_path / "data"
    data.mkdir()
    (data / "detections.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    (data / "labels.csv").write_text("\n".join([f"{HEADER},track_id", *labels]) + "\n")
    return data


def test_a_gap_is_filled_where_the_object_was(folder: Path) -> None:
    data, config = read_csv(folder), tracker_config("default")
    matched = track_dataset(data, offline_config(config, data), hindsight=True)
    [smooth] = [with_hindsight(each, config) for each in matched]
    tracks = smooth.tracks
    assert set(tracks.object_id.tolist()) == {1}
    assert tracks.frame.tolist() == list(range(60))
    expected = np.column_stack((0.14 * tracks.frame, np.zeros(60)))
    error = np.linalg.norm(tracks.center_m - expected, axis=1)
    assert error[HIDDEN.start : HIDDEN.stop].max() < 0.3
    np.testing.assert_allclose(tracks.velocity_mps[10:50].mean(axis=0), [1.4, 0.0], atol=0.1)
    [online] = track_dataset(data, config)
    for similarity in ("distance", "iou"):
        hota = [score_tracks([each], [similarity])[0].hota for each in (online, smooth)]
        assert hota[1] > hota[0] + 3.0


def _call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", "mot", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def test_offline_figures_stand_beside_the_online_ones(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert _call(monkeypatch, folder, "--offline", "--no-forecast", "--out", out) == 0
    shown = capsys.readouterr().out
    assert shown.index("Tracking accuracy") < shown.index("Offline tracking accuracy")
    online, offline = (pd.read_csv(path / "metrics.csv") for path in (out, out / "offline"))
    assert online["misses"].max() >= 15  # coasting is shown for 0.45 s
    assert offline["misses"].max() == 0
    assert offline["fragmentations"].max() == 0
    tracks = pd.read_csv(out / "offline" / "tracks.csv")
    assert len(tracks) == 60
    assert np.isfinite(tracks[["x_m", "y_m", "yaw_rad", "z_m", "height_m"]]).all(axis=None)


@pytest.mark.parametrize("config", ["imm", "ukf"])
def test_other_filters_are_refused_in_one_line(
    config: str,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    assert _call(monkeypatch, folder, "--offline", "--no-forecast", "--config", config, "--out", out) == 2
    assert "--offline: smooths tracks of linear motion models" in capsys.readouterr().err


def test_nothing_detected_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "detections.csv").write_text(f"{HEADER}\n0.0,0,0,4,2,0,0.01,unknown\n")
    out = tmp_path / "out"
    assert _call(monkeypatch, tmp_path, "--offline", "--out", out) == 0
    assert len((out / "offline" / "tracks.csv").read_text().splitlines()) <= 2


def test_log_odds_are_smoothed_as_the_probabilities_that_they_are(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the detector of the KITTI files gives them; at -1 a sum of scores is negative."""
    boxes = pd.read_csv(folder / "detections.csv")
    boxes["score"] = np.where(boxes["score"] > 0.5, 0.27, 0.05)
    shown = {}
    for name, score in (
        ("probability", boxes["score"]),
        ("logit", np.log(boxes["score"] / (1.0 - boxes["score"]))),
    ):
        data, out = tmp_path / name, tmp_path / f"out_{name}"
        data.mkdir()
        boxes.assign(score=score).to_csv(data / "detections.csv", index=False)
        (data / "labels.csv").write_bytes((folder / "labels.csv").read_bytes())
        assert _call(monkeypatch, data, "--offline", "--no-forecast", "--out", out) == 0
        shown[name] = pd.read_csv(out / "offline" / "tracks.csv")
    one, two = shown["probability"], shown["logit"]
    assert len(one) == 60
    assert two["category"].tolist() == one["category"].tolist()
    np.testing.assert_allclose(two[["x_m", "y_m"]], one[["x_m", "y_m"]], atol=1e-6)
    np.testing.assert_allclose(two["score"], np.log(one["score"] / (1.0 - one["score"])), atol=1e-3)


@pytest.mark.parametrize("config", ["ab3dmot", "centerpoint"])
def test_rates_that_are_known_exactly_can_be_smoothed(
    config: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    assert _call(monkeypatch, folder, "--offline", "--no-forecast", "--config", config, "--out", out) == 0
    tracks = pd.read_csv(out / "offline" / "tracks.csv")
    assert len(tracks) > 30
    assert np.isfinite(tracks[["x_m", "y_m", "yaw_rad"]]).all(axis=None)


@pytest.mark.parametrize("config", ["default", "imm", "ab3dmot"])
def test_frames_without_any_track_are_no_end(
    config: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing in the first second, nothing for four seconds in between; frames are those of the labels."""
    stamps = [0.1 * k for k in range(80)]
    seen = [t for t in stamps if 1.0 <= t < 2.5 or t > 6.5]
    boxes = [f"{t:.1f},{3.0 * t:.3f},0,4,1.8,0,0.9,car" for t in seen]
    labels = [f"{t:.1f},{3.0 * t:.3f},0,4,1.8,0,1,car,1" for t in stamps]
    (tmp_path / "detections.csv").write_text("\n".join([HEADER, *boxes]) + "\n")
    (tmp_path / "labels.csv").write_text("\n".join([f"{HEADER},track_id", *labels]) + "\n")
    out = tmp_path / "out"
    assert _call(monkeypatch, tmp_path, "--no-forecast", "--config", config, "--out", out) == 0
    tracks = pd.read_csv(out / "tracks.csv")
    assert len(tracks) > 10
    assert ("existence" in tracks) == (config != "ab3dmot")
