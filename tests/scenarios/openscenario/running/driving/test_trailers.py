"""Coupled trailers against the closed forms of the kinematic model of tractor and trailer."""

import copy
import math

import pytest

from scenarios.openscenario import ContentError, Engine, RunError, load
from tests.scenarios.openscenario.conftest import (
    CAR,
    act,
    at,
    at_time,
    condition,
    event,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
)

HITCH_M, COUPLER_M = -1.2, 3.25
TRAILER = CAR.replace('name="car" vehicleCategory="car"', 'name="box" vehicleCategory="trailer"').replace(
    "</Vehicle>", f'<TrailerCoupler dx="{COUPLER_M}"/>{{}}</Vehicle>'
)
TOWER = CAR.replace("</Vehicle>", f'<TrailerHitch dx="{HITCH_M}"/>{{}}</Vehicle>')
SEMI = '<TrailerHitch dx="-0.5"/>'


def inline(inner="", name="box"):
    return f'<Trailer><Trailer name="{name}">{TRAILER.format(inner)}</Trailer></Trailer>'


def world(x, y, h=0.0):
    return teleport(f'<Position><WorldPosition x="{x}" y="{y}" h="{h}"/></Position>')


def circle(radius, length):
    """Follow a circle to the left from where the entity is."""
    return (
        '<PrivateAction><RoutingAction><FollowTrajectoryAction><Trajectory name="t" closed="false"><Shape>'
        f'<Clothoid curvature="{1 / radius}" curvatureDot="0" length="{length}">'
        '<Position><RelativeObjectPosition entityRef="Other" dx="0" dy="0"/></Position></Clothoid></Shape>'
        "</Trajectory><TimeReference><None/></TimeReference>"
        '<TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )


EGO_ASIDE = private("Ego", world(0, -200))


@pytest.fixture
def plane(write):
    """A scenario on a plane; the ego is a plain car, or what is given."""

    def make(*acts, other, init, ego=CAR):
        path = write(*acts, other=other, init=init)
        text = path.read_text("utf-8").replace('<LogicFile filepath="two_roads.xodr"/>', "")
        plain = f'<ScenarioObject name="Ego">{CAR}'
        assert plain in text
        path.write_text(text.replace(plain, f'<ScenarioObject name="Ego">{ego}'), encoding="utf-8")
        return load(path)

    return make


def test_on_a_circle_the_axle_comes_to_the_circle_of_the_closed_form(plane):
    """The hitch runs on a circle of sqrt(R^2 + h^2), the axle of the trailer L behind it on its own one."""
    radius, v = 15.0, 5.0
    definition = plane(
        other=TOWER.format(inline(SEMI + inline(name="rear"))),
        init=EGO_ASIDE + private("Other", world(0, 0), speed(v), circle(radius, 60.0)),
    )
    assert [entity.name for entity in definition.entities] == ["Ego", "Other", "box", "rear"]
    # from heading pi/2 off on, the angles die away as exp(-s/L): after 4 L and more less than 2 %
    run = Engine(definition).run(10.0)
    hitch_m = math.hypot(radius, HITCH_M)
    axle_m = math.sqrt(hitch_m**2 - COUPLER_M**2)
    x, y, yaw, trailer_mps = at(run, "box", 10.0)
    # 50 m are 15 L: what is left of the beginning is below 1e-6
    assert math.hypot(x, y - radius) == pytest.approx(axle_m, abs=1e-4)
    assert trailer_mps == pytest.approx(v * axle_m / radius, abs=1e-4)
    along = math.atan2(x, radius - y)  # of the circle there
    assert math.remainder(yaw - along, 2 * math.pi) == pytest.approx(0.0, abs=1e-4)
    rear_m = math.sqrt(axle_m**2 + 0.5**2 - COUPLER_M**2)
    x, y, _, rear_mps = at(run, "rear", 10.0)
    assert math.hypot(x, y - radius) == pytest.approx(rear_m, abs=1e-3)
    assert rear_mps == pytest.approx(v * rear_m / radius, abs=1e-3)


CONNECT = (
    '<PrivateAction><TrailerAction><ConnectTrailerAction trailerRef="Other"/></TrailerAction></PrivateAction>'
)
DISCONNECT = "<PrivateAction><TrailerAction><DisconnectTrailerAction/></TrailerAction></PrivateAction>"
ANGLE = 1.2
BESIDE = private("Other", world(HITCH_M - COUPLER_M * math.cos(ANGLE), -COUPLER_M * math.sin(ANGLE), ANGLE))
"""The trailer at an angle behind the ego, its coupler on the hitch."""


def connected(*more):
    return act(
        maneuver(
            event("connect", CONNECT, trigger(condition(at_time(1)))),
            event("go", speed(4), trigger(condition(at_time(2)))),
            *more,
        ),
        actors="Ego",
    )


@pytest.mark.parametrize("step_s", [0.01, 0.07])
def test_along_a_straight_line_it_runs_on_a_tractrix(plane, step_s):
    """tan(phi/2) = tan(phi0/2) exp(-s/L), whatever the step."""
    definition = plane(
        connected(),
        ego=TOWER.format(""),
        other=TRAILER.format(""),
        init=private("Ego", world(0, 0)) + BESIDE,
    )
    engine = Engine(definition, step_s=step_s)
    engine.advance(2.0)
    assert engine.entities.boxes.yaw_rad[1] == pytest.approx(ANGLE)
    engine.advance(1.4)
    way_m = 4 * 1.4
    phi = 2 * math.atan(math.tan(ANGLE / 2) * math.exp(-way_m / COUPLER_M))
    hitch_m = way_m + HITCH_M
    now = engine.entities
    assert now.boxes.yaw_rad[1] == pytest.approx(phi, abs=1e-9)
    assert now.reference_m[1] == pytest.approx(
        (hitch_m - COUPLER_M * math.cos(phi), -COUPLER_M * math.sin(phi)), abs=1e-9
    )
    assert now.speed_mps[1] == pytest.approx(4 * math.cos(phi), abs=1e-9)
    # the way of the axle: L ln(sin(phi0) / sin(phi))
    travelled_m = COUPLER_M * math.log(math.sin(ANGLE) / math.sin(phi))
    other = engine.world.actors["Other"]
    assert other.state(engine.time_s).travelled_m == pytest.approx(travelled_m, rel=1e-3)
    assert engine.notes == (), engine.notes


def test_who_is_let_go_keeps_its_speed_and_a_second_one_can_be_connected(plane):
    free = event("free", DISCONNECT, trigger(condition(at_time(4))))
    stop = event("stop", speed(0), trigger(condition(at_time(5))))
    definition = plane(
        connected(free, stop),
        ego=TOWER.format(""),
        other=TRAILER.format(""),
        init=private("Ego", world(0, 0)) + private("Other", world(HITCH_M - COUPLER_M, 0)),
    )
    engine = Engine(definition)
    engine.advance(5.5)
    apart = engine.entities.reference_m[0] - engine.entities.reference_m[1]
    # alone for 1 s at the same speed, then the ego stands for half a second
    assert apart == pytest.approx((-HITCH_M + COUPLER_M - 2.0, 0.0), abs=1e-9)
    assert engine.entities.speed_mps.tolist() == [0.0, 4.0]


def test_own_trailers_are_no_contact_and_not_seen_and_those_of_others_are(plane):
    definition = plane(
        ego=TOWER.format(inline(name="mine")),
        other=TOWER.format(inline(name="theirs")),
        init=private("Ego", world(0, 0), speed(10)) + private("Other", world(60, 0)),
    )
    engine = Engine(definition)
    assert dict(zip(engine.entities.name.tolist(), engine.entities.seen.tolist(), strict=True)) == {
        "Ego": True,
        "mine": False,
        "Other": True,
        "theirs": True,
    }
    run = engine.run()
    assert run.contact_entity == "theirs"
    # from the ego's front to the rear of the trailer's box, 0.5 m behind its axle
    gap_m = 60 + HITCH_M - COUPLER_M - 0.5 - 3.5
    assert run.contact_time_s == pytest.approx(gap_m / 10, abs=1e-6)


def test_what_a_trailer_is_to_do_itself_is_noted_and_a_teleport_takes_it_along(plane):
    jump = event("jump", world(50, 10, math.pi / 2), trigger(condition(at_time(2))))
    definition = plane(
        act(maneuver(jump), actors="Ego"),
        act(maneuver(event("e", speed(9))), actors="Other", name="second"),
        ego=TOWER.format('<Trailer><TrailerRef entityRef="Other"/></Trailer>'),
        other=TRAILER.format(""),
        init=private("Other", world(7, 7)) + private("Ego", world(0, 0), speed(1)),
    )
    engine = Engine(definition)
    run = engine.run(4.0)
    assert at(run, "Other", 1.0) == pytest.approx((1 + HITCH_M - COUPLER_M, 0, 0, 1))
    assert at(run, "Other", 3.0) == pytest.approx((50, 11 + HITCH_M - COUPLER_M, math.pi / 2, 1))
    assert engine.notes == (
        "TeleportAction of 'Other' is not carried out: it is towed by 'Ego'",
        "SpeedAction of 'Other' is not carried out: it is towed by 'Ego'",
    )


def test_pushed_back_it_stays_straight_and_a_copy_goes_on_the_same(plane):
    """Straight behind is an equilibrium, if an unstable one."""
    definition = plane(
        ego=TOWER.format(inline()),
        other=CAR,
        init=private("Ego", world(0, 0), speed(-2)) + private("Other", world(0, 50)),
    )
    engine = Engine(definition)
    engine.advance(1.0)
    twin = copy.deepcopy(engine)
    engine.advance(2.0)
    twin.advance(2.0)
    assert engine.entities.reference_m[1] == pytest.approx((-6 + HITCH_M - COUPLER_M, 0))
    assert engine.entities.speed_mps[1] == pytest.approx(-2.0)
    assert twin.entities.reference_m.tolist() == engine.entities.reference_m.tolist()


@pytest.mark.parametrize(
    ("ego", "other", "text"),
    [
        (CAR.replace("</Vehicle>", f"{inline()}</Vehicle>"), CAR, "'Ego' has a trailer and no TrailerHitch"),
        (
            TOWER.format('<Trailer><TrailerRef entityRef="Other"/></Trailer>'),
            CAR,
            "'Other' is a trailer and has no TrailerCoupler",
        ),
        (
            TOWER.format('<Trailer><TrailerRef entityRef="Nobody"/></Trailer>'),
            CAR,
            "the trailer 'Nobody' of 'Ego' is no entity",
        ),
        (
            TRAILER.format(SEMI + '<Trailer><TrailerRef entityRef="Other"/></Trailer>'),
            TRAILER.format(SEMI + '<Trailer><TrailerRef entityRef="Ego"/></Trailer>'),
            "is towed by itself",
        ),
    ],
)
def test_impossible_couplings_are_refused(plane, ego, other, text):
    with pytest.raises(ContentError, match=text) as caught:
        plane(ego=ego, other=other, init=private("Ego", world(0, 0)) + private("Other", world(9, 0)))
    assert "\n" not in str(caught.value)


def test_a_trailer_of_the_same_name_gets_that_of_its_towing_vehicle_before_it(plane):
    definition = plane(
        ego=TOWER.format(inline()),
        other=TOWER.format(inline()),
        init=private("Ego", world(0, 0)) + private("Other", world(60, 0)),
    )
    names = [entity.name for entity in definition.entities]
    assert names == ["Ego", "box", "Other", "Other.box"]
    assert [entity.trailer for entity in definition.entities] == ["box", None, "Other.box", None]


def test_connecting_from_afar_is_noted_and_what_cannot_be_coupled_ends_the_run(plane):
    init = private("Ego", world(0, 0)) + private("Other", world(HITCH_M - COUPLER_M - 2, 0))
    engine = Engine(plane(connected(), ego=TOWER.format(""), other=TRAILER.format(""), init=init))
    run = engine.run(1.5)
    assert at(run, "Other", 1.5)[0] == pytest.approx(HITCH_M - COUPLER_M)
    assert [note for note in engine.notes if "from 2.00 m away: it jumps there" in note]
    with pytest.raises(RunError, match="'Other' cannot be coupled to 'Ego'"):
        Engine(plane(connected(), ego=CAR, other=TRAILER.format(""), init=init)).run(1.5)
    again = event("again", CONNECT, trigger(condition(at_time(1.2))))
    with pytest.raises(RunError, match="one of them already is coupled"):
        Engine(plane(connected(again), ego=TOWER.format(""), other=TRAILER.format(""), init=init)).run(1.5)


def entity_action(inner):
    return f'<GlobalAction><EntityAction entityRef="Other">{inner}</EntityAction></GlobalAction>'


def test_trailers_are_added_and_deleted_with_their_towing_vehicle(plane):
    place = '<Position><WorldPosition x="40" y="0" h="0"/></Position>'
    add = entity_action(f"<AddEntityAction>{place}</AddEntityAction>")
    delete = entity_action("<DeleteEntityAction/>")
    events = (
        event("add", add, trigger(condition(at_time(1)))),
        event("delete", delete, trigger(condition(at_time(2)))),
    )
    definition = plane(
        act(maneuver(*events), actors="Ego"),
        other=TOWER.format(inline()),
        init=private("Ego", world(0, 0)),
        ego=CAR,
    )
    run = Engine(definition).run(3.0)
    there = [run.exists[int(abs(run.time_s - t).argmin())].tolist() for t in (0.5, 1.5, 2.5)]
    assert there == [[True, False, False], [True, True, True], [True, False, False]]
    assert at(run, "box", 1.5)[:2] == pytest.approx((40 + HITCH_M - COUPLER_M, 0))
