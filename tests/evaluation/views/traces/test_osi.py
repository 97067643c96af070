"""Traces of ASAM OSI, read back by osi-python: the truth against the log, lanes against the map."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely
from osi3.osi_groundtruth_pb2 import GroundTruth
from osi3.osi_lane_pb2 import Lane, LaneBoundary
from osi3.osi_object_pb2 import MovingObject
from osi3trace.osi_trace import OSITrace

from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError
from evaluation.results.logs import LOG_COLUMNS
from evaluation.views.traces import osi
from evaluation.views.traces.folders import truth_of_run
from evaluation.views.traces.lanes import lanes_near
from evaluation.views.traces.osi import HOST_ID, ground_truth, write_osi
from evaluation.views.traces.osi_lanes import LANE_IDS, add_lanes
from evaluation.views.traces.run import LoggedRun
from opendrive import RoadNetwork, load_map

MAPS = Path(__file__).parents[4] / "scenarios" / "maps"
NAME = "CPNA_map_dry_static_60kmh_seed0"
KINDS = Lane.Classification
MARKS = LaneBoundary.Classification


def read(path: Path) -> list[Any]:
    trace = OSITrace(str(path), "GroundTruth")
    messages = list(trace)
    trace.close()
    return messages


@pytest.fixture(scope="module")
def run(folder: Path) -> LoggedRun:
    return truth_of_run(folder / NAME)[0]


@pytest.fixture(scope="module")
def trace(run: LoggedRun, tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    path, notes = write_osi(tmp_path_factory.mktemp("osi") / "run.osi", run)
    assert notes == ()
    return read(path)


def rows_of(log: pd.DataFrame, kind: str) -> pd.DataFrame:
    keys = ["time_s"] if kind == "ego" else ["time_s", "id"]
    return log[log["kind"] == kind].sort_values(keys, kind="stable").drop_duplicates(keys, keep="last")


def test_stamps_are_the_logs(run: LoggedRun, trace: list[Any]) -> None:
    stamps = [message.timestamp.seconds * 10**9 + message.timestamp.nanos for message in trace]
    assert stamps == [round(t * 1e9) for t in rows_of(run.log, "ego")["time_s"]]
    assert {(m.version.version_major, m.version.version_minor) for m in trace} == {(3, 8)}


@pytest.mark.parametrize("kind", ["ego", "actor"])
def test_objects_are_those_of_the_log(run: LoggedRun, trace: list[Any], kind: str) -> None:
    found = []
    for message in trace:
        assert message.host_vehicle_id.value == HOST_ID
        assert len({o.id.value for o in message.moving_object}) == len(message.moving_object)
        objects = [o for o in message.moving_object if (o.id.value == HOST_ID) == (kind == "ego")]
        for moving in sorted(objects, key=lambda o: o.id.value):
            base = moving.base
            assert base.position.z == pytest.approx(base.dimension.height / 2)
            speed = base.velocity.x * np.cos(base.orientation.yaw) + base.velocity.y * np.sin(
                base.orientation.yaw
            )
            across = base.velocity.y * np.cos(base.orientation.yaw) - base.velocity.x * np.sin(
                base.orientation.yaw
            )
            assert across == pytest.approx(0.0, abs=1e-9)
            found.append(
                (base.position.x, base.position.y, base.orientation.yaw, base.dimension.length,
                 base.dimension.width, speed)
            )  # fmt: skip
    names = ["x_m", "y_m", "yaw_rad", "length_m", "width_m", "speed_mps"]
    assert np.array(found) == pytest.approx(rows_of(run.log, kind)[names].to_numpy(), abs=1e-9)


def test_types_and_heights_are_the_scenarios(run: LoggedRun, trace: list[Any]) -> None:
    categories = dict(
        zip(rows_of(run.log, "actor")["id"], rows_of(run.log, "actor")["category"], strict=True)
    )
    for moving in trace[0].moving_object:
        if moving.id.value == HOST_ID:
            continue
        category = categories[moving.id.value]
        # of the target as in its catalog, of those who stand 1.6 m (scenarios/catalogue/bystanders.py)
        assert moving.base.dimension.height == pytest.approx(1.8 if moving.id.value == 0 else 1.6)
        vehicle = category == "car"
        assert moving.type == (MovingObject.TYPE_VEHICLE if vehicle else MovingObject.TYPE_PEDESTRIAN)
        assert moving.HasField("vehicle_classification") == vehicle
    assert set(categories.values()) == {"pedestrian", "car"}


def test_acceleration_is_the_change_of_velocity(run: LoggedRun, trace: list[Any]) -> None:
    """OSI: velocity(t) = velocity(t - dt) + acceleration(t) dt; the ego's along its heading is the log's."""
    for before, after in itertools.pairwise(trace):
        earlier = {o.id.value: o.base for o in before.moving_object if o.id.value != HOST_ID}
        dt = after.timestamp.seconds - before.timestamp.seconds
        dt += (after.timestamp.nanos - before.timestamp.nanos) * 1e-9
        for moving in after.moving_object:
            if moving.id.value in earlier:
                base, old = moving.base, earlier[moving.id.value]
                assert base.velocity.x == pytest.approx(old.velocity.x + base.acceleration.x * dt, abs=1e-6)
                assert base.velocity.y == pytest.approx(old.velocity.y + base.acceleration.y * dt, abs=1e-6)
    host = [next(o.base for o in m.moving_object if o.id.value == HOST_ID) for m in trace]
    along = [
        b.acceleration.x * np.cos(b.orientation.yaw) + b.acceleration.y * np.sin(b.orientation.yaw)
        for b in host
    ]
    assert along == pytest.approx(rows_of(run.log, "ego")["accel_mps2"].to_numpy(), abs=1e-9)
    assert min(along) < -3.0


def test_a_turn_has_its_centripetal_acceleration(drive: Any) -> None:
    """v^2 / r towards the centre, and v / r as the rate of the heading."""
    log = drive(speed_mps=10.0, yaw_rate_radps=0.5).log()
    messages, _ = ground_truth(LoggedRun("turn", log))
    for message in messages[1:]:
        base = message.moving_object[0].base
        yaw = base.orientation.yaw
        left = base.acceleration.y * np.cos(yaw) - base.acceleration.x * np.sin(yaw)
        assert left == pytest.approx(10.0 * 0.5)
        assert base.orientation_rate.yaw == pytest.approx(0.5)


def test_lanes_are_in_the_first_message_alone(trace: list[Any]) -> None:
    assert len(trace[0].lane) == 4
    assert not any(len(message.lane) or len(message.lane_boundary) for message in trace[1:])


def test_the_street_has_its_marks(trace: list[Any]) -> None:
    """`urban_street.xodr`: two lanes of 3.5 m, a broken line between them, sidewalks of 2.5 m beside."""
    lines = {
        boundary.boundary_line[0].position.y: (boundary.classification.type, boundary.classification.color)
        for boundary in trace[0].lane_boundary
    }
    assert lines == {
        0.0: (MARKS.TYPE_DASHED_LINE, MARKS.COLOR_WHITE),
        3.5: (MARKS.TYPE_SOLID_LINE, MARKS.COLOR_WHITE),
        -3.5: (MARKS.TYPE_SOLID_LINE, MARKS.COLOR_WHITE),
        6.0: (MARKS.TYPE_NO_LINE, MARKS.COLOR_NONE),
        -6.0: (MARKS.TYPE_NO_LINE, MARKS.COLOR_NONE),
    }
    kinds = [(lane.classification.type, lane.classification.subtype) for lane in trace[0].lane]
    assert sorted(kinds) == [
        (KINDS.TYPE_DRIVING, KINDS.SUBTYPE_NORMAL),
        (KINDS.TYPE_DRIVING, KINDS.SUBTYPE_NORMAL),
        (KINDS.TYPE_NONDRIVING, KINDS.SUBTYPE_SIDEWALK),
        (KINDS.TYPE_NONDRIVING, KINDS.SUBTYPE_SIDEWALK),
    ]


@pytest.fixture(scope="module", params=["urban_bend", "urban_intersection", "urban_street_parking"])
def world(request: pytest.FixtureRequest) -> tuple[RoadNetwork, Any]:
    network = load_map(MAPS / f"{request.param}.xodr")
    truth = GroundTruth()
    left, low, right, high = network.bounds
    add_lanes(truth, network, lanes_near(network, np.array([[left, low], [right, high]])))
    return network, truth


def line_of(boundary: Any) -> np.ndarray:
    return np.array([(p.position.x, p.position.y) for p in boundary.boundary_line])


def test_boundaries_are_within_5_cm_of_the_borders(world: tuple[RoadNetwork, Any]) -> None:
    """The greatest error that OSI allows, measured from the map's own borders, 0.5 m apart."""
    network, truth = world
    lines = {b.id.value: line_of(b) for b in truth.lane_boundary}
    for lane in truth.lane:
        index = lane.id.value - LANE_IDS
        start, end = float(network.lanes.s_start_m[index]), float(network.lanes.s_end_m[index])
        borders = network.borders(index, np.linspace(start, end, int((end - start) / 0.5) + 2))
        if network.lanes.direction[index] < 0:  # left and right of OSI are those of s
            borders = borders[::-1]
        sides = lane.classification.left_lane_boundary_id, lane.classification.right_lane_boundary_id
        for border, ids in zip(borders, sides, strict=True):
            line = shapely.LineString(np.concatenate([lines[i.value] for i in ids]))
            assert shapely.distance(shapely.points(border), line).max() < 0.05


def test_identifiers_are_unique_and_known(world: tuple[RoadNetwork, Any]) -> None:
    network, truth = world
    lanes = {lane.id.value: lane.classification for lane in truth.lane}
    boundaries = {boundary.id.value for boundary in truth.lane_boundary}
    assert len(lanes) == len(truth.lane) == sum(kind != "none" for kind in network.lanes.lane_type)
    assert len(boundaries) == len(truth.lane_boundary)
    assert not lanes.keys() & boundaries
    for own, lane in lanes.items():
        assert {i.value for i in (*lane.left_lane_boundary_id, *lane.right_lane_boundary_id)} <= boundaries
        for neighbour in lane.left_adjacent_lane_id:
            other = lanes[neighbour.value]
            assert own in [i.value for i in other.right_adjacent_lane_id]
            assert list(other.right_lane_boundary_id) == list(lane.left_lane_boundary_id)


def test_lanes_follow_one_another(world: tuple[RoadNetwork, Any]) -> None:
    """A lane begins where the one before ends, or begins if its s runs the other way."""
    _, truth = world
    centres = {
        lane.id.value: np.array([(p.x, p.y) for p in lane.classification.centerline])
        for lane in truth.lane
        if lane.classification.type == KINDS.TYPE_DRIVING
    }
    pairs = 0
    for lane in truth.lane:
        if lane.id.value not in centres:
            continue
        own = centres[lane.id.value]
        for pairing in lane.classification.lane_pairing:
            for side, point in (("antecessor_lane_id", own[0]), ("successor_lane_id", own[-1])):
                if pairing.HasField(side):
                    other = centres[getattr(pairing, side).value]
                    assert np.hypot(*(other[[0, -1]] - point).T).min() < 0.1
                    pairs += 1
    assert pairs > 0 or len(centres) < 3


def made(*rows: dict[str, Any]) -> pd.DataFrame:
    return pd.DataFrame(list(rows), columns=list(LOG_COLUMNS))


EGO = {"time_s": 0.0, "kind": "ego", "x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0, "length_m": 4.4, "width_m": 1.8,
       "speed_mps": 10.0, "accel_mps2": 0.0}  # fmt: skip


def test_a_folder_gets_the_name_of_the_convention(tmp_path: Path) -> None:
    """timestamp_type_osi-version_protobuf-version_frames_name, from OSI's naming conventions."""
    path, notes = write_osi(tmp_path, LoggedRun("street", made(EGO), start_s=1629299142.0))
    parts = path.name.split("_")
    assert parts[:3] == ["20210818T150542Z", "gt", "380"]
    assert parts[3].isdigit()
    assert parts[4:] == ["1", "street.osi"]
    assert len(read(path)) == 1
    assert notes == ("No map is known: the trace has no lanes.",)


def test_equal_runs_give_equal_bytes(run: LoggedRun, tmp_path: Path) -> None:
    first, second = (write_osi(tmp_path / f"{name}.osi", run)[0].read_bytes() for name in "ab")
    assert first == second


def test_another_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"--osi: expected FILE\.osi or a folder"):
        write_osi(tmp_path / "run.mcap", LoggedRun("a", made(EGO)))


@pytest.mark.parametrize("identity", [-1, HOST_ID])
def test_identities_that_a_trace_cannot_hold_are_refused(identity: int) -> None:
    actor = EGO | {"kind": "actor", "id": identity, "category": "car", "label": "other"}
    with pytest.raises(ResultsError, match=f"must lie in 0 to 999999999: {identity}$"):
        ground_truth(LoggedRun("a", made(EGO, actor)))


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "osi3", None)
    monkeypatch.delitem(sys.modules, "osi3.osi_groundtruth_pb2", raising=False)
    with pytest.raises(ArgumentError, match=r"smartmot\[osi\]"):
        osi.require_osi()
