"""What the page draws is what the log holds, within a centimetre."""

from pathlib import Path

import numpy as np
import pytest

from evaluation.runs.folder import read_folder
from evaluation.views.account.explain import explain
from evaluation.views.frames import frames_of
from evaluation.views.page.charts import temporal_spec
from evaluation.views.page.payload import pack_run, read_run

ORIGIN = np.array([120.0, -3.0])
TOLERANCE = {
    "x_m": 0.00501, "y_m": 0.00501, "length_m": 0.00501, "width_m": 0.00501, "yaw_rad": 0.000501,
    "speed_mps": 0.00501, "horizon_s": 0.000501, "id": 0.0,
}  # fmt: skip


@pytest.mark.parametrize("index", range(4))
def test_every_row_of_a_run_comes_back(folder: Path, index: int) -> None:
    results = read_folder(folder)
    run = results.runs.to_dict("records")[index]
    log = results.log(str(run["log"]))
    setup = results.setups[str(run["log"])]
    frames = frames_of(log, setup.strategy)
    packed = pack_run(frames, explain(frames, run, setup), ORIGIN, temporal_spec(frames, run))
    read = read_run(packed, ORIGIN)

    times = log.loc[log["kind"] == "ego", "time_s"].to_numpy()
    assert np.abs(read["time_s"] - times).max() <= 0.000501
    for kind in ("actor", "detection", "track", "forecast", "ego_forecast"):
        columns = read["objects"][kind]
        rows = log[log["kind"] == kind].assign(frame=lambda r: np.searchsorted(times, r["time_s"]))
        # at a contact nothing is perceived: what was perceived before is shown again
        shown = columns["frame"] <= rows["frame"].max()
        order = ["frame", *(name for name in ("id", "horizon_s", "x_m", "y_m") if name in columns)]
        found = np.lexsort([columns[name][shown] for name in reversed(order)])
        wanted = rows.sort_values([n for n in order if rows[n].notna().all()], kind="stable")
        if kind == "detection":  # detections have no number: their order within a frame is that of the log
            found = np.argsort(columns["frame"][shown], kind="stable")
            wanted = rows
        assert len(found) == len(wanted) > 0
        for name, tolerance in TOLERANCE.items():
            if name in columns and wanted[name].notna().all():
                assert np.abs(columns[name][shown][found] - wanted[name]).max() <= tolerance, (kind, name)
        assert columns["category"][shown][found].tolist() == wanted["category"].fillna("").tolist()
        assert columns["label"][shown][found].tolist() == wanted["label"].fillna("").tolist()


def test_monitored_areas_come_back(folder: Path) -> None:
    results = read_folder(folder)
    for run in results.runs.to_dict("records"):
        setup = results.setups[str(run["log"])]
        frames = frames_of(results.log(str(run["log"])), setup.strategy)
        packed = pack_run(frames, explain(frames, run, setup), ORIGIN, {})
        areas = read_run(packed, ORIGIN)["areas"]
        for frame in (0, len(frames) // 2, len(frames) - 1):
            truth = frames.areas(frame)
            assert [role for role, _ in areas[frame]] == [role for role, _ in truth]
            for (_, found), (_, wanted) in zip(areas[frame], truth, strict=True):
                assert np.abs(found - wanted).max() <= 0.00501
        assert any(areas)


def test_redrawn_areas_agree_with_what_the_runs_kept(folder: Path) -> None:
    """The log says which detections the area kept; the area made again from the settings says the same."""
    results = read_folder(folder)
    checked = 0
    for run in results.runs.to_dict("records"):
        frames = frames_of(results.log(str(run["log"])), results.setups[str(run["log"])].strategy)
        assert frames.strategy is not None
        for frame in range(len(frames) - 1):
            rows = frames.rows("detection", frame)
            boxes = rows[["x_m", "y_m", "length_m", "width_m", "yaw_rad"]].to_numpy(float)
            from smartmot.types import Boxes

            kept = frames.strategy.at(frames.ego_state(frame)).kept(
                Boxes(boxes[:, :2], boxes[:, 2:4], boxes[:, 4]), rows["category"].to_numpy(np.str_)
            )
            assert kept.tolist() == (rows["label"] == "kept").tolist()
            checked += len(rows)
    assert checked > 1000
