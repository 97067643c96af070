"""Drives as scenarios; places, times and headings by hand."""

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from scenarios.errors import DatasetError
from scenarios.openscenario import Engine, load
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.poses import rigid, turned_about
from scenarios.recorded.to_openscenario import kept_frames, openscenario_bytes
from scenarios.recorded.vehicles import Vehicle

STAMP_S = 100.0 + 0.1 * np.arange(41)
"""4 s at 10 Hz."""


def poses(x, y=0.0, yaw=0.0):
    x, y, yaw = np.broadcast_arrays(np.asarray(x, dtype=float), y, yaw)
    return rigid(turned_about(2, yaw), np.column_stack((x, y, np.zeros(len(x)))))


def labels(*tracks):
    """Rows of identity, category, first frame, and (K, 3) x, y, yaw."""
    rows = [(i, c, k + n, *pose) for i, c, k, way in tracks for n, pose in enumerate(way.tolist())]
    identity, category, frame, x, y, yaw = zip(*rows, strict=True)
    return Objects.of(
        np.array(frame),
        np.column_stack((x, y)),
        object_id=np.array(identity),
        category=np.array(category),
        yaw_rad=np.array(yaw),
        size_m=np.tile((4.0, 2.0), (len(rows), 1)),
    )


def drive(*tracks, ego=None, stamp_s=STAMP_S):
    return Sequence(
        name="drive",
        stamp_s=stamp_s,
        frame_name=tuple(map(str, range(len(stamp_s)))),
        detections=Objects.empty(),
        labels=labels(*tracks) if tracks else Objects.empty(),
        world_SE3_ego=poses(10.0 * (stamp_s - stamp_s[0])) if ego is None else ego,
    )


def way(x, y, yaw):
    return np.column_stack(np.broadcast_arrays(np.asarray(x, dtype=float), y, yaw))


def played(tmp_path: Path, sequence: Sequence, **options) -> tuple[Engine, Path]:
    path = tmp_path / "drive.xosc"
    path.write_bytes(openscenario_bytes(sequence, **options))
    return Engine(load(path)), path


def assert_as_recorded(engine: Engine, sequence: Sequence) -> None:
    """Ego within 5 cm, others within 1 cm and 1 degree, at every frame; nobody else is there."""
    names = [entity.name for entity in engine.definition.entities]
    ego, objects = sequence.ego_xy_yaw(), sequence.labels
    assert objects is not None
    for k, rows in enumerate(objects.frame_rows(len(sequence))):
        ahead_s = sequence.stamp_s[k] - sequence.stamp_s[0] - engine.time_s
        if ahead_s > 0.0:
            engine.advance(ahead_s)
        now = engine.entities
        assert math.dist(now.reference_m[0], ego[k, :2]) < 0.05
        here = {names[i].split("_")[1]: i for i in np.flatnonzero(now.exists).tolist() if i}
        frame = objects[rows]
        assert set(here) == set(map(str, frame.object_id.tolist())), k
        for identity, center, yaw in zip(frame.object_id, frame.center_m, frame.yaw_rad, strict=True):
            row = here[str(identity)]
            assert math.dist(now.boxes.center_m[row], center) < 0.01
            assert abs(math.remainder(now.boxes.yaw_rad[row] - yaw, 2 * math.pi)) < math.radians(1.0)


def test_everybody_is_where_the_recording_has_them(tmp_path: Path) -> None:
    """One drives, stands for 1 s and goes on; one comes and goes; one is parked with a label that shakes."""
    t = STAMP_S - STAMP_S[0]
    waits = way(30 + 5 * np.clip(t, 0, 1.5) + 5 * np.clip(t - 2.5, 0, None), 4.0, 0.0)
    turns = way(20 + 8 * np.sin(t), 10 + 8 * (1 - np.cos(t)), t)
    crosses = way(40.0, -6 + 0.15 * np.arange(20), math.pi / 2)
    rng = np.random.default_rng(0)
    shakes = way(60 + rng.normal(0, 0.02, 41), 8 + rng.normal(0, 0.02, 41), 0.3)
    sequence = drive((1, "car", 0, waits), (2, "truck", 0, turns), (3, "pedestrian", 7, crosses),
                     (4, "car", 0, shakes), (5, "unknown", 40, way([70.0], 9.0, 0.1)))  # fmt: skip
    engine, _ = played(tmp_path, sequence)
    assert_as_recorded(engine, sequence)
    assert engine.definition.map_path is None
    assert {e.name: e.category for e in engine.definition.entities[1:]} == {
        **{"car_1": "car", "truck_2": "truck", "pedestrian_3": "pedestrian", "car_4": "car"},
        "unknown_5": "unknown",
    }
    engine.advance()
    assert engine.over  # the ego is at its end


def test_who_stands_has_speed_0(tmp_path: Path) -> None:
    """Frames within 2 mm are one place."""
    shakes = way(60 + 0.0005 * (np.arange(41) % 2), 8.0, 0.3)
    engine, path = played(tmp_path, drive((1, "car", 0, shakes)))
    assert b"FollowTrajectoryAction" not in path.read_bytes().split(b"</Init>")[1]
    engine.advance(2.0)
    assert engine.entities.speed_mps[1] == 0.0


def test_a_longer_gap_is_an_absence(tmp_path: Path) -> None:
    first, second = way(30 + np.arange(10.0), 3.0, 0.0), way(50 + np.arange(10.0), 3.0, 0.0)
    sequence = drive((1, "car", 0, first), (1, "car", 25, second))
    engine, _ = played(tmp_path, sequence)
    assert [e.name for e in engine.definition.entities] == ["Ego", "car_1_2", "car_1"]
    assert_as_recorded(engine, sequence)


def test_a_short_gap_is_bridged(tmp_path: Path) -> None:
    along = way(30 + np.arange(41.0), 3.0, 0.0)
    sequence = drive((1, "car", 0, along[:10]), (1, "car", 15, along[15:]))
    engine, _ = played(tmp_path, sequence)
    engine.advance(1.2)
    assert engine.entities.reference_m[1] == pytest.approx([42.0, 3.0], abs=1e-6)


def test_whom_the_ego_passes_last_comes_first(tmp_path: Path) -> None:
    """Passed after 2 s, after 1 s, never."""
    parked = [(i, "car", 0, way(np.full(41, x), 4.0, 0.0)) for i, x in enumerate((20.0, 10.0, 90.0))]
    engine, _ = played(tmp_path, drive(*parked))
    assert [e.name for e in engine.definition.entities[1:]] == ["car_2", "car_0", "car_1"]
    engine, _ = played(tmp_path, drive(*parked), first=1, names={1: "Target"})
    assert [e.name for e in engine.definition.entities[1:]] == ["Target", "car_0", "car_2"]


def test_the_run_goes_on_if_the_ego_has_braked(tmp_path: Path) -> None:
    """After 4 s at 10 m/s all go straight on for up to 5 s: the ego's way is 90 m long, the other's too."""
    others = way(30 + 10 * (STAMP_S - STAMP_S[0]), 4.0, 0.0)
    _, path = played(tmp_path, drive((1, "car", 0, others)))
    root = etree.fromstring(path.read_bytes())
    ends = [(line[-1].get("time"), line[-1][0][0].get("x")) for line in root.iter("Polyline")]
    assert ends == [("9.000000", "90.0000"), ("9.000000", "120.0000")]


def test_times_are_rounded_to_a_microsecond_and_the_bytes_are_the_same() -> None:
    stamp_s = 1.6e9 + np.cumsum(0.1 + 1e-9 * np.arange(41))
    sequence = drive((1, "car", 0, way(np.arange(41.0), 4.0, 0.0)), stamp_s=stamp_s)
    assert openscenario_bytes(sequence) == openscenario_bytes(sequence)


def test_frames_on_a_line_are_left_out() -> None:
    time = np.arange(5.0)
    straight = np.column_stack((2 * time, np.zeros((5, 2))))
    assert kept_frames(time, straight).tolist() == [0, 4]
    straight[2, 1] = 0.01
    assert set(kept_frames(time, straight).tolist()) >= {0, 2, 4}
    turned = np.column_stack((2 * time, np.zeros(5), 0.1 * (time >= 3)))
    assert {2, 3} <= set(kept_frames(time, turned).tolist())


def test_the_ego_s_box(tmp_path: Path) -> None:
    """The rear axle is recorded, 1.4 m behind the middle."""
    sequence = drive(ego=poses(np.zeros(41), 10.0 * (STAMP_S - STAMP_S[0]), math.pi / 2))
    engine, _ = played(tmp_path, sequence, ego=Vehicle(4.8, 1.9, 1.4))
    assert engine.entities.boxes.center_m[0] == pytest.approx([0.0, 1.4], abs=1e-4)
    assert engine.entities.boxes.size_m[0].tolist() == [4.8, 1.9]
    assert engine.ego_speed_mps == pytest.approx(10.0)


@pytest.mark.parametrize("name", ['a<&">b', "$x", "${1+1}", "a\0b", "a\x1bb", "\ud800", "x\ny", "é 漢"])
def test_odd_names_are_names(tmp_path: Path, name: str) -> None:
    """Nobody is called by a parameter's value, and nothing that XML cannot hold is written."""
    along = way(30 + np.arange(41.0), 3.0, 0.0)
    sequence = replace(drive((1, "car", 0, along)), name=name)
    engine, _ = played(tmp_path, sequence, names={1: name})
    written = "".join("_" if c in "$\0\x1b\ud800\n" else c for c in name)
    assert [e.name for e in engine.definition.entities] == ["Ego", written]


def test_names_are_unique(tmp_path: Path) -> None:
    along = way(30 + np.arange(41.0), 3.0, 0.0)
    sequence = drive((1, "car", 0, along[:10]), (1, "car", 25, along[25:]), (2, "car", 0, along + 5.0),
                     (3, "car", 0, along + 9.0))  # fmt: skip
    engine, _ = played(tmp_path, sequence, names={1: "A", 2: "A_2", 3: "Ego"})
    names = [e.name for e in engine.definition.entities]
    assert names[0] == "Ego"
    assert sorted(names[1:]) == ["A", "A_2", "A_2_2", "Ego_2"]


def test_who_turns_round_and_round_does_so_again(tmp_path: Path) -> None:
    """54 degrees from frame to frame, evenly: the frames in between cannot be left out."""
    spins = way(30 + 5 * (STAMP_S - STAMP_S[0]), 4.0, np.linspace(0.0, 12 * math.pi, 41))
    sequence = drive((1, "car", 0, spins))
    engine, _ = played(tmp_path, sequence)
    assert_as_recorded(engine, sequence)


def test_the_file_has_what_the_schema_asks_for(tmp_path: Path) -> None:
    """OpenSCENARIO 1.3: the elements of the root and their order; all of it where a schema is at hand."""
    others = way(30 + np.arange(41.0), 3.0, 0.0)
    categories = ("car", "truck", "pedestrian", "cyclist", "motorcycle", "unknown")
    _, path = played(tmp_path, drive(*((k, c, 2 * k, others[2 * k :]) for k, c in enumerate(categories))))
    root = etree.parse(path).getroot()
    assert [child.tag for child in root] == [
        *("FileHeader", "CatalogLocations", "RoadNetwork", "Entities", "Storyboard")
    ]
    spec = importlib.util.find_spec("qc_openscenario")  # of the package asam-qc-openscenarioxml
    if spec is not None and spec.origin is not None:
        schema = etree.XMLSchema(etree.parse(Path(spec.origin).parent / "schema/1.3.0/OpenSCENARIO.xsd"))
        schema.assertValid(root)


def test_what_is_refused() -> None:
    with pytest.raises(DatasetError, match="no ego poses"):
        openscenario_bytes(Sequence("s", STAMP_S, ("",) * 41, Objects.empty(), Objects.empty()))
    with pytest.raises(DatasetError, match="no labels"):
        openscenario_bytes(Sequence("s", STAMP_S, ("",) * 41, Objects.empty(), None, poses(np.zeros(41))))
    with pytest.raises(DatasetError, match="the ego drives in reverse at 0 s"):
        openscenario_bytes(drive(ego=poses(-1.0 * (STAMP_S - STAMP_S[0]))))
    with pytest.raises(DatasetError, match="two frames at rising times"):
        openscenario_bytes(drive(stamp_s=np.array([3.0]), ego=poses([0.0])))


def test_kitti(tmp_path: Path, kitti: Path) -> None:
    from scenarios.recorded.formats import read_dataset

    sequence = next(s for s in read_dataset(kitti).sequences if s.name == "0012")
    engine, _ = played(tmp_path, sequence)
    assert_as_recorded(engine, sequence)


def test_recorded_heights_are_the_z_of_places() -> None:
    """The ego climbs 1 m on its way, somebody stands 6 m up; a recording without heights writes none."""
    ego = poses(np.linspace(0.0, 40.0, 41))
    way = np.column_stack((np.full(41, 60.0), np.zeros(41), np.zeros(41)))
    others = replace(labels((1, "car", 0, way)), bottom_m=np.full(41, 6.0))
    names = tuple(map(str, range(41)))
    drive = Sequence("a", STAMP_S, names, Objects.empty(), others, ego)
    flat = etree.fromstring(openscenario_bytes(drive))
    assert not [place for place in flat.iter("WorldPosition") if "z" in place.attrib]
    ego[:, 2, 3] = np.linspace(6.0, 7.0, 41)
    places = list(etree.fromstring(openscenario_bytes(drive)).iter("WorldPosition"))
    heights = {float(place.get("x", "")): float(place.get("z", "")) for place in places}
    assert heights[0.0] == 6.0
    assert heights[40.0] == 7.0
    assert heights[60.0] == 6.0
