"""Sentences say what the log and the settings say."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.runs.folder import RunFolder, read_folder
from evaluation.views.account.explain import explain
from evaluation.views.frames import LogFrames, frames_of
from scenarios.presets import PAPER, PHYSICAL
from smartmot.area import EverythingArea, RectangularArea

BYSTANDER = {
    "id": 4, "category": "pedestrian", "x_m": 18.0, "y_m": -2.4, "yaw_rad": 0.0, "length_m": 0.5,
    "width_m": 0.5, "speed_mps": 0.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def results(folder: Path) -> RunFolder:
    return read_folder(folder)


def account_of(results: RunFolder, strategy: str, speed_kmh: float) -> tuple[Any, Any, LogFrames]:
    runs = results.runs
    run = runs[(runs["strategy"] == strategy) & (runs["v_test_kmh"] == speed_kmh)].to_dict("records")[0]
    setup = results.setups[str(run["log"])]
    frames = frames_of(results.log(str(run["log"])), setup.strategy)
    return explain(frames, run, setup), run, frames


def test_a_hit_names_speed_distance_and_what_the_brakes_need(results: RunFolder) -> None:
    account, run, _ = account_of(results, "rectangular", 60.0)
    assert run["collided"]
    assert account.kind == "mitigated"
    assert account.finding == f"Hits the target pedestrian at {run['v_impact_kmh']:.1f} km/h."
    # from the ego's front to the tracked box, which has 5 cm of noise
    left = float(account.why.split(" m before")[0].split()[-1])
    assert left == pytest.approx(run["flag_distance_m"], abs=0.35)
    # closed form: delay, then deceleration rising linearly to its full value, then constant
    brakes, v = PAPER.brakes, 60 / 3.6
    after = v - brakes.max_decel_mps2 * brakes.build_up_s / 2
    ramp = v * brakes.build_up_s - brakes.max_decel_mps2 * brakes.build_up_s**2 / 6
    need = v * brakes.delay_s + ramp + after**2 / (2 * brakes.max_decel_mps2)
    assert f"from 60 km/h these brakes need {need:.1f} m" in account.why
    assert f"the rectangle, which ends {PAPER.rectangular.max_length_m:.1f} m" in account.why
    assert "was out of reach until then" in account.why
    assert account.story[-1].startswith("Contact: hits the target pedestrian")


def test_a_stop_names_the_distance_left(results: RunFolder) -> None:
    account, run, _ = account_of(results, "map", 60.0)
    assert account.kind == "stop"
    assert account.finding == f"Stops with {run['stop_gap_m']:.1f} m left."
    assert f"within {PAPER.map_area.reach_m:g} m of the ego's centre" in account.why


def test_the_story_follows_the_events(results: RunFolder) -> None:
    account, run, frames = account_of(results, "map", 60.0)
    flag = frames.frame_at(run["flag_time_s"])
    assert account.story[0] == "Follows its lane."
    assert account.story[flag].startswith(f"Emergency brake since t = {run['flag_time_s']:.2f} s")
    assert not any(text.startswith("Emergency") for text in account.story[:flag])
    standing = frames.frame_at(run["t0_s"] + 0.06)
    assert account.story[standing].startswith("Stands and holds")
    free = frames.events.loc[frames.events["label"] == "end_unexpected", "time_s"].item()
    assert account.story[frames.frame_at(free)] == "The way is free: drives on."


def test_the_status_counts_what_the_log_counts(results: RunFolder) -> None:
    account, run, frames = account_of(results, "map", 60.0)
    frame = frames.frame_at(run["flag_time_s"])
    rows = frames.rows("detection", frame)
    kept = int((rows["label"] == "kept").sum())
    assert 0 < kept < len(rows)
    assert f"{kept} of {len(rows)} detections kept" in account.status[frame]
    assert account.status[frame].startswith("60.0 km/h")


def bystander_scene(drive: Any, strategy: Any, *, moving: bool = False) -> LogFrames:
    """An ego at 10 m/s; from t = 0.8 s on it brakes for a pedestrian 2.4 m to the right of its axis."""
    rows: list[dict[str, Any]] = []
    for time in drive().time_s:
        state = "threat" if time >= 0.8 - 1e-9 else "static"
        rows.append({"time_s": time, "kind": "actor", "label": "adversary"} | BYSTANDER)
        rows.append({"time_s": time, "kind": "track", "label": state} | BYSTANDER)
        if moving:
            rows.append({"time_s": time, "kind": "forecast", "horizon_s": 0.5} | BYSTANDER)
    events = ("selector", "unexpected"), ("monitors", "collision"), ("unexpected", "predicted_collision")
    rows += [{"time_s": 0.8, "kind": "event", "category": layer, "label": name} for layer, name in events]
    return frames_of(drive().log(*rows), strategy)


def test_a_false_activation_says_for_what_where_and_why(drive: Any, run_row: Any) -> None:
    from evaluation.runs.folder import RunSetup

    area = RectangularArea(PHYSICAL.rectangular, PHYSICAL.pipeline.braking_distance)
    frames = bystander_scene(drive, area)
    run = run_row(false_activation=True, flag_time_s=0.8, t0_s=1.0)

    class Empty:
        """A map without any lane at the place."""

        def locate(self, _points: Any) -> Any:
            return type("Hits", (), {"lane": np.zeros(0, dtype=int)})()

    class AlongX:
        """A route on no lane."""

        lanes = ()

        def place(self, points: Any) -> Any:
            return points[:, 0], points[:, 1]

    setup = RunSetup("empty", Empty(), AlongX(), PHYSICAL, area)
    account = explain(frames, run, setup)
    assert account.kind == "false"
    assert account.finding == (
        "False activation: emergency braking from 36 km/h to 36 km/h for another pedestrian."
    )
    # at 0.8 s the front is at 8 + 2.2 m, the pedestrian's box begins at 18 - 0.25 m
    assert "7.5 m before another pedestrian, standing off the road, 2.4 m to the right" in account.why
    length = 1.4 * PHYSICAL.pipeline.braking_distance.at(10.0)
    assert f"inside the rectangle ({length:.1f} m long, up to 2.6 m to each side)" in account.why


def test_without_settings_there_are_facts_but_no_reasons(drive: Any, run_row: Any) -> None:
    account = explain(bystander_scene(drive, None), run_row(false_activation=True, flag_time_s=0.8))
    assert account.why == (
        "The brake was requested 7.5 m before another pedestrian, standing, 2.4 m to the right of the ego's "
        "axis."
    )


def test_without_an_area_everything_counts(drive: Any, run_row: Any, results: RunFolder) -> None:
    setup = next(iter(results.setups.values()))
    run = run_row(strategy="all", flag_time_s=0.8, t0_s=1.0, stop_gap_m=1.5)
    account = explain(bystander_scene(drive, EverythingArea(), moving=True), run, setup)
    assert account.finding == "Stops with 1.5 m left."
    assert "everything ahead counts, wherever it is" in account.why


def test_an_object_dropped_before_is_named(drive: Any, run_row: Any) -> None:
    """It is detected all the time, but tracked for two frames only: the area had dropped it."""
    rows: list[dict[str, Any]] = []
    for time in drive().time_s:
        late = time >= 0.7 - 1e-9
        rows.append({"time_s": time, "kind": "detection", "label": "kept" if late else "dropped"} | BYSTANDER)
        if late:
            rows.append({"time_s": time, "kind": "track", "label": "threat"} | BYSTANDER)
    rows.append({"time_s": 0.8, "kind": "event", "category": "unexpected", "label": "predicted_collision"})
    account = explain(frames_of(drive().log(*rows)), run_row(flag_time_s=0.8, t0_s=1.0))
    assert "tracked for only 0.10 s: the monitored area had dropped it before" in account.why


@pytest.mark.parametrize(
    ("strategy", "rows", "reason"),
    [
        ("none", [], "Nothing watches"),
        ("map", [], "Nothing was ever detected"),
        ("map", [("detection", "dropped")], "dropped every detection"),
        (
            "map",
            [("detection", "kept"), ("track", "dynamic")],
            "never counted as being on a collision course",
        ),
        ("map", [("detection", "kept"), ("track", "threat")], "never near enough"),
    ],
)
def test_a_hit_without_braking_has_a_reason(
    drive: Any, run_row: Any, strategy: str, rows: list[tuple[str, str]], reason: str
) -> None:
    more = [{"time_s": 0.5, "kind": kind, "label": label} | BYSTANDER for kind, label in rows]
    more.append({"time_s": 1.0, "kind": "actor", "label": "target"} | BYSTANDER)
    run = run_row(strategy=strategy, collided=True, v_impact_kmh=36.0, contact_time_s=1.0, t0_s=1.0)
    account = explain(frames_of(drive().log(*more)), run)
    assert account.finding == "Hits the target pedestrian at 36.0 km/h without braking."
    assert reason in account.why


def test_an_ego_that_keeps_its_speed_does_not_brake(drive: Any, run_row: Any) -> None:
    account = explain(frames_of(drive().log()), run_row())
    assert (account.kind, account.outcome, account.why) == ("pass", "no braking", "")
    assert account.finding == "Keeps its speed within 1 km/h, and passes without contact."
    assert not account.unnecessary
    assert not math.isnan(float(account.status[0].split()[0]))


def slows(drive: Any, to_kmh: float, *, tracked: bool = True, from_kmh: float = 50.0) -> Any:
    """Log of an ego that loses speed evenly over 2 s, with a pedestrian 2.4 m to the right of its axis."""
    driven = drive(speed_mps=from_kmh / 3.6, frames=41)
    rows: list[dict[str, Any]] = [
        {"time_s": now, "kind": kind, "label": label} | BYSTANDER | {"x_m": 60.0}
        for now in driven.time_s
        for kind, label in (("actor", "other"), ("track", "static"))
        if tracked or kind == "actor"
    ]
    log, time = driven.log(*rows), driven.time_s
    decel = (from_kmh - to_kmh) / 3.6 / time[-1]
    own = log["kind"] == "ego"
    log.loc[own, "speed_mps"] = from_kmh / 3.6 - decel * time
    log.loc[own, "x_m"] = from_kmh / 3.6 * time - decel * time**2 / 2
    log.loc[own, "accel_mps2"] = -decel
    return log


class Sidewalk:
    """A map that is all sidewalk."""

    class lanes:  # noqa: N801
        lane_type = ("sidewalk",)

    def locate(self, points: Any) -> Any:
        return type("Hits", (), {"lane": np.zeros(len(points), dtype=int)})()


class Elsewhere:
    """A route on another lane."""

    lanes = (7,)


def setting_of(must: str) -> Any:
    from evaluation.runs.folder import RunSetup

    return RunSetup("map", Sidewalk(), Elsewhere(), PHYSICAL, None, must)


def test_slowing_is_said_with_its_depth_and_its_cause(drive: Any, run_row: Any) -> None:
    """(50 - 12) / 3.6 m/s in 2 s are 5.3 m/s2."""
    run = run_row(false_activation=False, v_test_kmh=50.0)
    account = explain(frames_of(slows(drive, 12.0)), run, setting_of("nothing"))
    assert account.kind == "unnecessary"
    assert account.unnecessary
    assert account.outcome == "unnecessary braking to 12 km/h"
    assert account.finding == (
        "Unnecessary braking: slows from 50 to 12 km/h at up to 5.3 m/s² for another pedestrian, who stayed "
        "on the sidewalk, without an emergency."
    )
    assert (
        account.story[-1] == "Slows without an emergency for another pedestrian, who stayed on the sidewalk."
    )


def test_slowing_for_an_object_in_the_ego_lane_is_not_unnecessary(drive: Any, run_row: Any) -> None:
    class SameLane:
        lanes = (0,)

    setup = replace(setting_of("nothing"), route=SameLane())
    account = explain(frames_of(slows(drive, 12.0)), run_row(), setup)
    assert (account.kind, account.outcome, account.unnecessary) == ("stop", "slowed to 12 km/h", False)
    assert account.finding == (
        "Slows from 50 to 12 km/h at up to 5.3 m/s² for another pedestrian, who stayed in the ego's lane, "
        "without an emergency."
    )


def test_slowing_in_a_must_brake_scene_avoids_the_collision(drive: Any, run_row: Any) -> None:
    run = run_row(false_activation=False, v_test_kmh=50.0)
    account = explain(frames_of(slows(drive, 12.0)), run, setting_of("brake"))
    assert (account.kind, account.outcome, account.unnecessary) == ("stop", "slowed to 12 km/h", False)
    assert account.finding.startswith(
        "Collision avoided. Slows from 50 to 12 km/h at up to 5.3 m/s² for another"
    )


def test_a_standstill_by_speed_adaptation_is_one(drive: Any, run_row: Any) -> None:
    account = explain(frames_of(slows(drive, 0.0)), run_row(), setting_of("nothing"))
    assert account.outcome == "unnecessary braking to a standstill"
    assert "from 50 km/h to a standstill at up to 6.9 m/s²" in account.finding


@pytest.mark.parametrize(
    ("to_kmh", "kind", "unnecessary"),
    [
        (49.1, "pass", False),  # within the tolerance of a test's speed
        (48.0, "stop", False),  # 0.3 m/s2: it is let roll
        (42.0, "unnecessary", True),  # 1.1 m/s2
    ],
)
def test_what_counts_as_braking(
    drive: Any, run_row: Any, to_kmh: float, kind: str, unnecessary: bool
) -> None:
    account = explain(frames_of(slows(drive, to_kmh)), run_row(), setting_of("nothing"))
    assert (account.kind, account.unnecessary) == (kind, unnecessary)
    assert ("Keeps its speed" in account.finding) == (kind == "pass")
    assert ("no braking" in account.outcome) == (kind == "pass")


def test_slowing_that_the_scenario_asks_for_is_no_unnecessary_braking(drive: Any, run_row: Any) -> None:
    account = explain(frames_of(slows(drive, 12.0, tracked=False)), run_row(), setting_of("nothing"))
    assert (account.kind, account.outcome, account.unnecessary) == ("stop", "slowed to 12 km/h", False)
    assert account.why == "Nothing that it tracks is in its way then."
    unbraked = run_row(strategy="none")
    account = explain(frames_of(slows(drive, 12.0)), unbraked, setting_of("nothing"))
    assert account.why == "Nothing watches in this run: the scenario slows the ego."
    assert "slows from 50 to 12 km/h at up to 5.3 m/s²" in account.finding.lower()


def test_a_must_brake_run_in_which_nothing_braked_has_no_conflict(drive: Any, run_row: Any) -> None:
    account = explain(frames_of(drive().log()), run_row(), setting_of("brake"))
    assert (account.kind, account.outcome) == ("invalid", "no conflict")
    assert "avoided" not in account.finding
    # so is a test with points, and an unbraked run
    for row in (run_row(score=2.0, score_max=2.0), run_row(strategy="none")):
        assert explain(frames_of(drive().log()), row).kind == "invalid"
    assert explain(frames_of(drive().log()), run_row(strategy="none"), setting_of("nothing")).kind == "pass"


def test_a_run_cut_off_avoids_nothing(drive: Any, run_row: Any) -> None:
    run = run_row(end_reason="time_limit")
    account = explain(frames_of(slows(drive, 12.0)), run, setting_of("brake"))
    assert (account.kind, account.outcome) == ("cut", "cut off")
    assert "avoided" not in account.finding
    assert account.finding.endswith("The time limit ended the run at t = 2.0 s.")
    # what it did wrong before remains
    account = explain(frames_of(slows(drive, 12.0)), run, setting_of("nothing"))
    assert account.kind == "unnecessary"


def test_a_contact_after_slowing_is_mitigated(drive: Any, run_row: Any) -> None:
    run = run_row(collided=True, v_impact_kmh=12.0, contact_time_s=2.0, t0_s=2.0)
    account = explain(frames_of(slows(drive, 12.0)), run, setting_of("brake"))
    assert (account.kind, account.outcome) == ("mitigated", "mitigated, 12.0 km/h")
    assert account.finding.startswith(
        "Hits another pedestrian at 12.0 km/h, slowed from 50 to 13 km/h at up to 5.3 m/s² for another "
        "pedestrian"
    )


def test_a_standing_ego_is_hit(drive: Any, run_row: Any) -> None:
    run = run_row(collided=True, v_impact_kmh=0.0, contact_time_s=2.0, t0_s=2.0)
    account = explain(frames_of(slows(drive, 0.0)), run, setting_of("nothing"))
    assert account.finding == "Is hit by another pedestrian while it stands."


def test_an_emergency_that_ends_before_standstill_is_said_with_its_depth(drive: Any, run_row: Any) -> None:
    log = slows(drive, 12.0)
    log.loc[len(log)] = {
        "time_s": 0.5,
        "kind": "event",
        "category": "unexpected",
        "label": "predicted_collision",
    }
    run = run_row(flag_time_s=0.5, false_activation=False)
    account = explain(frames_of(log), run, setting_of("brake"))
    assert (account.kind, account.outcome) == ("stop", "slowed to 12 km/h")
    assert account.finding == (
        "Collision avoided. Slows to 12 km/h in an emergency, and passes without contact."
    )
    # what it lost before the request: a quarter of the way from 50 to 12 km/h
    assert "Before that, the ego had slowed from 50 to 40 km/h at up to 5.3 m/s²" in account.why
