"""The run log is what docs/run-log.md says it is."""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from opendrive import load_map
from scenarios.catalogue.cpna import CpnaTest, build, find_site
from scenarios.catalogue.maps import shipped_map
from scenarios.presets import PAPER
from scenarios.simulation.log import COLUMNS, TEXT_COLUMNS, RunLog
from scenarios.simulation.outcome import Outcome
from scenarios.strategies import make_strategy

DOCUMENT = (Path(__file__).parents[3] / "docs" / "run-log.md").read_text()
Table = dict[str, NDArray[np.generic]]


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    """A run with a contact and bystanders."""
    site = find_site(load_map(shipped_map("urban_street")), 80.0)
    test = CpnaTest(80.0, adversaries="static")
    return build(test, site, PAPER, make_strategy("map", PAPER, site)).run()


@pytest.fixture(scope="module")
def table(outcome: Outcome) -> Table:
    return outcome.log.table()


def of_kind(table: Table, kind: str) -> Table:
    rows = table["kind"] == kind
    return {name: column[rows] for name, column in table.items()}


def test_columns_are_those_of_the_document(table: Table) -> None:
    listed = re.search(r"Columns:\s+`([^`]+)`", DOCUMENT)
    assert listed is not None
    assert tuple(re.split(r",\s*", listed[1])) == COLUMNS == tuple(table)
    assert set(TEXT_COLUMNS) < set(COLUMNS)


def test_kinds_are_those_of_the_document(table: Table) -> None:
    documented = set(re.findall(r"^\| `(\w+)` \|", DOCUMENT.split("## logs")[1], re.MULTILINE))
    assert {*table["kind"].tolist(), "signal"} == documented  # the scenario has no traffic signals


def test_columns_have_equal_length_and_the_right_type(table: Table) -> None:
    assert len({len(column) for column in table.values()}) == 1
    for name, column in table.items():
        assert column.dtype.kind == ("U" if name in TEXT_COLUMNS else "f")


def test_ego_is_logged_at_every_frame_and_at_the_contact(outcome: Outcome, table: Table) -> None:
    ego = of_kind(table, "ego")
    assert outcome.contact_time_s is not None
    assert np.diff(ego["time_s"][:-1]) == pytest.approx(0.05)
    assert ego["time_s"][-1] == outcome.contact_time_s
    assert ego["speed_mps"][-1] == outcome.impact_speed_mps
    assert np.isnan(ego["horizon_s"]).all()
    braking = ego["accel_mps2"] < -1.0
    assert braking.any()
    assert (ego["time_s"][braking] > outcome.flag_time_s).all()


def test_ground_truth_has_every_actor_in_every_frame(table: Table) -> None:
    actors, frames = of_kind(table, "actor"), len(of_kind(table, "ego")["time_s"])
    assert set(actors["label"].tolist()) == {"target", "other"}
    ids, counts = np.unique(actors["id"], return_counts=True)
    assert (actors["label"] == "target").sum() == frames
    assert counts.tolist() == [frames] * len(ids)
    assert len(ids) > 5


def test_detections_are_kept_or_dropped(outcome: Outcome, table: Table) -> None:
    """In the frame of the flag: the target is kept, who stands 2.2 m over the kerb is dropped."""
    actors, seen = of_kind(table, "actor"), of_kind(table, "detection")
    now = [np.abs(kind["time_s"] - outcome.flag_time_s) < 1e-9 for kind in (actors, seen)]
    assert set(seen["label"].tolist()) == {"kept", "dropped"}

    def label_at(x_m: float, y_m: float) -> str:
        distance = np.hypot(seen["x_m"] - x_m, seen["y_m"] - y_m)
        distance[~now[1]] = np.inf
        assert distance.min() < 0.3  # noise
        return str(seen["label"][distance.argmin()])

    places = np.column_stack((actors["x_m"], actors["y_m"]))
    (target,) = places[now[0] & (actors["label"] == "target")]
    assert label_at(*target) == "kept"
    # the lane centre of this street is 1.75 m from its middle, the kerb 3.5 m
    beyond = now[0] & (actors["label"] == "other") & (np.abs(np.abs(places[:, 1]) - 5.7) < 0.01)
    assert beyond.any()
    assert {label_at(*place) for place in places[beyond]} == {"dropped"}


def test_forecast_times_are_half_seconds_ahead(table: Table) -> None:
    for kind in ("forecast", "ego_forecast"):
        horizon = of_kind(table, kind)["horizon_s"]
        assert horizon.min() == pytest.approx(0.5)
        assert horizon * 2 == pytest.approx(np.round(horizon * 2))
    tracks, forecast = of_kind(table, "track"), of_kind(table, "forecast")
    known = set(zip(tracks["time_s"].tolist(), tracks["id"].tolist(), strict=True))
    assert set(zip(forecast["time_s"].tolist(), forecast["id"].tolist(), strict=True)) <= known


def test_a_threat_is_named_when_the_flag_is_sent(outcome: Outcome, table: Table) -> None:
    tracks = of_kind(table, "track")
    assert set(tracks["label"].tolist()) <= {"static", "dynamic", "threat"}
    assert "threat" in tracks["label"][np.abs(tracks["time_s"] - outcome.flag_time_s) < 1e-9]


def test_events_carry_layer_and_name(outcome: Outcome, table: Table) -> None:
    events = of_kind(table, "event")
    assert set(events["category"].tolist()) <= {"start", "selector", "unexpected", "monitors"}
    named = dict(zip(events["label"].tolist(), events["time_s"].tolist(), strict=True))
    assert events["label"][0] == "run_start"
    assert named["predicted_collision"] == pytest.approx(outcome.flag_time_s)


def test_boxes_are_complete_where_there_is_a_box(table: Table) -> None:
    boxes = table["kind"] != "event"
    for name in ("x_m", "y_m", "yaw_rad", "length_m", "width_m"):
        assert np.isfinite(table[name][boxes]).all()
        assert np.isnan(table[name][~boxes]).all()


def test_nothing_logged_is_an_empty_table() -> None:
    nobody = np.array([], dtype=np.str_)
    assert {name: len(column) for name, column in RunLog(nobody, nobody).table().items()} == dict.fromkeys(
        COLUMNS, 0
    )
