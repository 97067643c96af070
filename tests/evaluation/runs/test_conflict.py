"""Whether there is anything to avoid: who would be touched without braking, when and where."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.runs import conflict as module
from evaluation.runs.conflict import (
    Conflict,
    Part,
    Touch,
    conflict_of,
    conflicts,
    told_without_conflict,
    unbraked,
)
from scenarios.catalogue.library import DEFINITIONS
from scenarios.spec import NO_AEB, RunSpec

WALK_MPS = 5.0 / 3.6
WIDTH_M = 1.8  # of the shipped ego; 4.4 m long
H_POINT_PERCENT = 100.0 * 0.06 / WIDTH_M  # the box's centre is this far before the H-point

LATE = '<TraveledDistanceCondition value="$_Lead"/>'


def crossing(tmp_path: Path, edits: dict[str, str], speed_kmh: float = 40.0, **values: float) -> RunSpec:
    """CPNA-75 from the shipped crossing scenario with pieces of its text replaced."""
    text = (DEFINITIONS / "crossing.xosc").read_text()
    fixed = {
        "../maps/": f"{DEFINITIONS.parent}/maps/",
        'path="catalogs/': f'path="{DEFINITIONS}/catalogs/',
    }
    for old, new in {**fixed, **edits}.items():
        assert old in text, old
        text = text.replace(old, new)
    file = tmp_path / "crossing.xosc"
    file.write_text(text)
    parameters = {"Ego_speed_kmh": speed_kmh, "Impact_percent": 75.0, **values}
    return RunSpec(
        "CPNA",
        str(file),
        tuple(sorted(parameters.items())),
        "map",
        "physical",
        "dry",
        speed_kmh,
        adapts=False,
    )


def late(seconds: float, speed_kmh: float) -> dict[str, str]:
    """The target sets off later than for the place that is asked for."""
    return {LATE: LATE.replace("$_Lead", f"${{$_Lead+{seconds * speed_kmh / 3.6!r}}}")}


def touch_of(spec: RunSpec) -> Touch:
    """The first contact without braking."""
    touch = conflict_of(spec).touch
    assert touch is not None
    return touch


@pytest.mark.parametrize("percent", [25.0, 75.0])
def test_the_unbraked_ego_meets_the_target_at_the_place(tmp_path: Path, percent: float) -> None:
    spec = crossing(tmp_path, {}, Impact_percent=percent)
    found = conflict_of(spec)
    assert (found.target, found.missing) == ("Target", "")
    touch = touch_of(spec)
    assert touch.part is Part.FRONT
    assert touch.ego_speed_kmh == pytest.approx(40.0)
    assert touch.place_percent() == pytest.approx(percent + H_POINT_PERCENT, abs=0.05)
    assert touch.place_percent(-0.06) == pytest.approx(percent, abs=0.05)


@pytest.mark.parametrize("seconds", [0.1, 0.3])
def test_a_target_that_sets_off_late_is_met_where_it_has_come_to(tmp_path: Path, seconds: float) -> None:
    """It walks from the right edge, which is 0 %."""
    expected = 75.0 + H_POINT_PERCENT - 100.0 * WALK_MPS * seconds / WIDTH_M
    place = touch_of(crossing(tmp_path, late(seconds, 40.0))).place_percent()
    assert place == pytest.approx(expected, abs=0.05)


def test_a_target_that_comes_after_the_front_hits_the_side(tmp_path: Path) -> None:
    """1.6 s late at 10 km/h: the front is past, the 4.4 m behind it are not."""
    spec = crossing(tmp_path, late(1.6, 10.0), 10.0)
    assert touch_of(spec).part is Part.SIDE
    assert conflict_of(spec).missing == ""  # a contact with the target all the same


def test_a_target_that_comes_far_too_late_or_never_is_no_conflict(tmp_path: Path) -> None:
    told = "no conflict without braking: the ego touches no road user"
    assert conflict_of(crossing(tmp_path, late(5.0, 40.0))).missing == told
    assert conflict_of(crossing(tmp_path, {LATE: LATE.replace("$_Lead", "99999")})).missing == told
    # nor is one that comes after the time limit: at 5 km/h the ego drives 83 m in 60 s
    crawling = crossing(tmp_path, {LATE: LATE.replace("$_Lead", "99999")}, 5.0, Lead_s=200.0)
    assert conflict_of(crawling).missing == f"{told} within 60 s, the time limit"


def test_a_deleted_target_is_no_conflict(tmp_path: Path) -> None:
    event = """<Event name="vanish" priority="parallel"><Action name="vanish"><GlobalAction>
      <EntityAction entityRef="Target"><DeleteEntityAction/></EntityAction></GlobalAction></Action>
      <StartTrigger><ConditionGroup><Condition name="later" delay="0" conditionEdge="none"><ByEntityCondition>
      <TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities>
      <EntityCondition><TraveledDistanceCondition value="${$_Lead+1}"/></EntityCondition></ByEntityCondition>
      </Condition></ConditionGroup></StartTrigger></Event>
      <Event name="set off" """
    spec = crossing(tmp_path, {'<Event name="set off" ': event})
    assert conflict_of(spec).missing.startswith("no conflict without braking")


def test_somebody_else_who_is_touched_first_is_named(tmp_path: Path) -> None:
    spec = crossing(
        tmp_path,
        {
            '<ScenarioObject name="Target">': """<ScenarioObject name="Waiting car">
              <CatalogReference catalogName="Vehicles" entryName="small_car"/></ScenarioObject>
              <ScenarioObject name="Target">""",
            '<Private entityRef="Target">': """<Private entityRef="Waiting car"><PrivateAction>
              <TeleportAction><Position>
              <WorldPosition x="${$Line_x-15}" y="$Line_y" h="$Line_yaw"/></Position>
              </TeleportAction></PrivateAction></Private><Private entityRef="Target">""",
        },
    )
    assert conflict_of(spec).target == "Target"
    assert conflict_of(spec).missing == (
        "no conflict with the target: without braking the ego touches Waiting car first"
    )


def straight(**changes: object) -> Touch:
    """A touch of 40 km/h with a target of 4 m by 1.7 m that crosses at right angles, at the ego's front."""
    touch = Touch(
        time_s=3.0,
        entity="Target",
        ego_speed_kmh=40.0,
        entity_speed_kmh=20.0,
        part=Part.FRONT,
        ahead_m=0.85,
        left_m=0.0,
        heading_ahead=0.0,
        heading_left=1.0,
        entity_length_m=4.0,
        entity_width_m=1.7,
        ego_length_m=4.4,
        ego_width_m=1.8,
        axle_to_front_m=3.5,
        turns=0,
    )
    return replace(touch, **changes)  # type: ignore[arg-type]


def test_a_standing_ego_or_its_rear_cannot_be_helped_by_braking() -> None:
    assert Conflict("Target", straight()).missing == ""
    assert "the ego stands" in Conflict("Target", straight(ego_speed_kmh=0.0)).missing
    assert "at its rear" in Conflict("Target", straight(part=Part.REAR)).missing


def test_a_box_that_stands_askew_is_moved_on_to_where_its_near_face_is_met() -> None:
    """A corner touches 0.6 m before; at 40 km/h less the target's part along the ego's way."""
    turn = math.radians(20.0)
    touch = straight(ahead_m=0.85 + 0.6, heading_ahead=math.sin(turn), heading_left=math.cos(turn))
    later_s = 0.6 / (40.0 / 3.6 - 20.0 / 3.6 * math.sin(turn))
    left = 20.0 / 3.6 * math.cos(turn) * later_s
    assert touch.place_percent() == pytest.approx(50.0 + 100.0 * left / 1.8)


def test_an_unbraked_run_is_made_once_for_all_strategies_and_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[RunSpec] = []
    original = module._carried_out

    def counted(run: RunSpec) -> Conflict:
        made.append(run)
        return original(run)

    monkeypatch.setattr(module, "_carried_out", counted)
    monkeypatch.setattr(module, "_KNOWN", {})
    spec = crossing(tmp_path, {})
    others = [replace(spec, strategy="rectangular", seed=3, weather="wet"), replace(spec, strategy=NO_AEB)]
    steps: list[int] = []
    found = conflicts([spec, *others], done=lambda: steps.append(1))
    assert len(found) == len(made) == len(steps) == 1
    assert {unbraked(one) for one in (spec, *others)} == set(found)
    assert made[0].strategy == NO_AEB
    assert not made[0].adapts
    conflict_of(replace(spec, preset="paper"))
    assert len(made) == 1
    crossing(tmp_path, late(0.3, 40.0))  # the same path and parameters, another content
    assert touch_of(spec).place_percent() < 60.0
    assert len(made) == 2


def test_what_run_says_where_nothing_is_to_be_avoided(tmp_path: Path) -> None:
    never = crossing(tmp_path, {LATE: LATE.replace("$_Lead", "99999")})
    two = [never, replace(never, strategy="rectangular")]
    assert told_without_conflict(two, conflicts(two)) == [
        "CPNA, 40 km/h: no conflict without braking: the ego touches no road user"
    ]
