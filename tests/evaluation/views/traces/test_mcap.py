"""The MCAP of a run, read back with other libraries: messages by their schemas, poses against the log."""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError, log_path
from evaluation.results.logs import LOG_COLUMNS, read_log
from evaluation.results.rows import read_runs
from evaluation.runs.folder import read_folder
from evaluation.views.traces import mcap as writer
from evaluation.views.traces.folders import logged_run, write_run_mcaps
from evaluation.views.traces.lanes import REACH_M, lanes_near
from evaluation.views.traces.mcap import mcap_bytes, write_mcap
from evaluation.views.traces.run import LoggedRun
from opendrive import load_map
from smartmot.area import EverythingArea
from smartmot.types import EgoState

EGO = ("x_m", "y_m", "yaw_rad", "speed_mps", "accel_mps2")
Topics = dict[str, list[tuple[int, Any]]]
MAPS = Path(__file__).parents[4] / "scenarios" / "maps"
NAME = "CPNA_{}_dry_static_60kmh_seed0"


def decoded(content: bytes) -> Topics:
    """All messages by topic, decoded with the schemas that the file holds."""
    reader = make_reader(io.BytesIO(content), decoder_factories=[DecoderFactory()])
    topics: Topics = defaultdict(list)
    for _, channel, message, value in reader.iter_decoded_messages():
        topics[channel.topic].append((message.log_time, value))
    summary = reader.get_summary()
    counts = {c.topic: summary.statistics.channel_message_counts[c.id] for c in summary.channels.values()}
    assert counts == {topic: len(messages) for topic, messages in topics.items()}
    return topics


def cubes(messages: list[tuple[int, Any]]) -> pd.DataFrame:
    """Boxes of scene updates in their order, as rows of a log have them."""
    rows = []
    for stamp, update in messages:
        for entity in update.entities:
            assert entity.frame_id == "map"
            for cube in entity.cubes:
                place, turn, size = cube.pose.position, cube.pose.orientation, cube.size
                assert (turn.x, turn.y) == (0.0, 0.0)
                assert place.z == pytest.approx(size.z / 2)
                yaw = 2.0 * np.arctan2(turn.z, turn.w)
                rows.append((stamp, entity.id, place.x, place.y, yaw, size.x, size.y))
    names = ["stamp_ns", "entity", "x_m", "y_m", "yaw_rad", "length_m", "width_m"]
    return pd.DataFrame(rows, columns=names)


def assert_same_boxes(boxes: pd.DataFrame, rows: pd.DataFrame) -> None:
    """Boxes are those of rows of a log, at the same times, in any order within a time."""
    names = ["x_m", "y_m", "yaw_rad", "length_m", "width_m"]
    stamps = np.rint(rows["time_s"].to_numpy() * 1e9).astype(np.int64)
    expected = rows.assign(stamp_ns=stamps).sort_values(["stamp_ns", "x_m", "y_m", "yaw_rad"])
    boxes = boxes.sort_values(["stamp_ns", "x_m", "y_m", "yaw_rad"])
    assert boxes["stamp_ns"].tolist() == expected["stamp_ns"].tolist()
    difference = boxes[names].to_numpy() - expected[names].to_numpy()
    difference[:, 2] = np.angle(np.exp(1j * difference[:, 2]))
    assert np.abs(difference).max(initial=0.0) < 1e-9


@pytest.fixture(scope="module", params=["map", "rectangular"])
def run(request: pytest.FixtureRequest, folder: Path) -> LoggedRun:
    """Two runs past people who stand, one of which ends in a contact."""
    return logged_run(folder / NAME.format(request.param))[0]


@pytest.fixture(scope="module")
def topics(run: LoggedRun) -> Topics:
    return decoded(mcap_bytes(run)[0])


@pytest.mark.parametrize(
    ("topic", "kind"),
    [
        ("/ego", "ego"),
        ("/actors", "actor"),
        ("/detections", "detection"),
        ("/tracks", "track"),
        ("/forecasts", "forecast"),
        ("/ego_forecast", "ego_forecast"),
    ],
)
def test_boxes_are_those_of_the_log(run: LoggedRun, topics: Topics, topic: str, kind: str) -> None:
    rows = run.log[run.log["kind"] == kind]
    assert len(rows) > 0
    assert_same_boxes(cubes(topics[topic]), rows)


def test_messages_are_as_many_as_frames(run: LoggedRun, topics: Topics) -> None:
    kinds = run.log.groupby("kind")["time_s"].nunique()
    for topic in ("/ego", "/actors", "/tf", "/ego/signals"):
        assert len(topics[topic]) == kinds["ego"]
    for topic in ("/detections", "/tracks", "/forecasts", "/ego_forecast", "/monitored_area"):
        assert len(topics[topic]) == kinds["ego_forecast"]  # one per decision, also of frames without boxes
    assert len(topics["/map"]) == 1


def test_entities_have_identity_class_and_state(run: LoggedRun, topics: Topics) -> None:
    tracks = run.log[run.log["kind"] == "track"]
    expected = [
        (str(int(row.id)), row.category, row.label, f"{row.category} {int(row.id)}")
        for row in tracks.sort_values("time_s", kind="stable").itertuples()
    ]
    found = []
    for _, update in topics["/tracks"]:
        for entity in update.entities:
            metadata = {pair.key: pair.value for pair in entity.metadata}
            found.append((entity.id, metadata["class"], metadata["state"], entity.texts[0].text))
    assert found == expected
    labels = {entity.id for _, update in topics["/detections"] for entity in update.entities}
    assert labels == set(run.log.loc[run.log["kind"] == "detection", "label"])


def test_no_message_leaves_anything_of_another_frame(topics: Topics) -> None:
    """Each update deletes all that its topic showed before: any frame, reached in any way, is whole."""
    for topic in (
        "/ego",
        "/actors",
        "/detections",
        "/tracks",
        "/forecasts",
        "/ego_forecast",
        "/monitored_area",
    ):
        for stamp, update in topics[topic]:
            (deletion,) = update.deletions
            assert deletion.type == 1  # ALL in foxglove/SceneEntityDeletion.proto
            assert deletion.timestamp.ToNanoseconds() == stamp
            names = [entity.id for entity in update.entities]
            assert len(set(names)) == len(names)
            assert all(entity.timestamp.ToNanoseconds() == stamp for entity in update.entities)


def test_the_transform_is_the_ego(run: LoggedRun, topics: Topics) -> None:
    ego = run.log[run.log["kind"] == "ego"].sort_values("time_s")
    found = [
        (t.translation.x, t.translation.y, 2 * np.arctan2(t.rotation.z, t.rotation.w))
        for _, t in topics["/tf"]
    ]
    assert {(t.parent_frame_id, t.child_frame_id) for _, t in topics["/tf"]} == {("map", "base_link")}
    assert found == pytest.approx(ego[["x_m", "y_m", "yaw_rad"]].to_numpy(), abs=1e-9)


def test_signals_are_those_of_the_log(run: LoggedRun, topics: Topics) -> None:
    ego = run.log[run.log["kind"] == "ego"].sort_values("time_s")
    signals = [message for _, message in topics["/ego/signals"]]
    assert [s.speed_mps for s in signals] == ego["speed_mps"].tolist()
    assert [s.accel_mps2 for s in signals] == ego["accel_mps2"].tolist()
    least = np.array([s.time_to_collision_s for s in signals])
    assert np.nanmin(least) < 1.5
    assert (least[np.isfinite(least)] >= 0.0).all()


def test_events_are_log_messages(run: LoggedRun, topics: Topics) -> None:
    events = run.log[run.log["kind"] == "event"].sort_values("time_s", kind="stable")
    expected = [(round(e.time_s * 1e9), e.category, e.label) for e in events.itertuples()]
    found = [(stamp, log.name, log.message.split(":")[0]) for stamp, log in topics["/events"]]
    if run.contact_time_s is not None:
        assert found.pop() == (round(run.contact_time_s * 1e9), "run", "contact")
    assert found == expected
    levels = {log.message: log.level for _, log in topics["/events"]}
    assert levels["unexpected: emergency brake requested"] == 4  # ERROR in foxglove/Log.proto


def test_lanes_and_areas_are_outlines(run: LoggedRun, topics: Topics, folder: Path) -> None:
    network = read_folder(folder).setup(run.name).network
    assert network is not None
    ((_, update),) = topics["/map"]
    lanes = {entity.id: entity for entity in update.entities if entity.id.startswith("lane ")}
    assert len(lanes) == sum(kind != "none" for kind in network.lanes.lane_type)
    for k, (road, section, number) in enumerate(network.lanes.key):
        line = lanes[f"lane {road}/{section}/{number}"].lines[0]
        outline = network.lane_polygon(k, network.lanes.s_start_m[k], network.lanes.s_end_m[k])
        drawn = shapely.Polygon([(p.x, p.y) for p in line.points])
        assert shapely.equals_exact(drawn, shapely.Polygon(outline), tolerance=1e-9, normalize=True)
    roles = {entity.id for _, update in topics["/monitored_area"] for entity in update.entities}
    assert roles == {"rectangle"} if "rectangular" in run.name else "current" in roles


def test_monitored_areas_are_those_of_the_strategy(run: LoggedRun, topics: Topics) -> None:
    assert run.strategy is not None
    ego = run.log[(run.log["kind"] == "ego") & (run.log["time_s"] == 0.0)].iloc[0]
    state = EgoState(0.0, *(float(ego[name]) for name in EGO), 0.0, float(ego.length_m), float(ego.width_m))
    expected = [ring for _, ring in run.strategy.at(state).polygons()]
    _, update = topics["/monitored_area"][0]
    rings = [line.points for entity in update.entities for line in entity.lines]
    assert len(rings) == len(expected) > 0
    found = sorted([(p.x, p.y) for p in ring] for ring in rings)
    for ring, other in zip(found, sorted(map(np.ndarray.tolist, expected)), strict=True):
        assert np.array(ring) == pytest.approx(np.array(other), abs=1e-9)


def test_of_a_great_map_only_what_is_near_is_written() -> None:
    """The ego stands so far to the left of a map that its leftmost lanes alone are within reach."""
    network = load_map(MAPS / "urban_intersection.xodr")
    left, low, right, high = network.bounds
    everything = lanes_near(network, np.array([[left, low], [right, high]]))
    assert everything.notes == ()
    corner = np.array([[left - REACH_M + 1.0, 0.5 * (low + high)]])
    near = lanes_near(network, corner)
    assert 0 < len(near.lane) < len(everything.lane)
    assert near.left_out == len(everything.lane) - len(near.lane)
    assert near.notes[0].startswith(f"{near.left_out} of {len(everything.lane)} lanes")
    assert all(outline[:, 0].min() <= left + 1.0 for outlines in near.outlines_m for outline in outlines)


def test_a_contact_is_an_event(folder: Path) -> None:
    runs = read_runs(folder)
    hit = runs[runs["collided"]].iloc[0]
    messages = decoded(mcap_bytes(logged_run(folder / hit["log"])[0])[0])["/events"]
    stamp, last = messages[-1]
    assert (stamp, last.message) == (round(hit["contact_time_s"] * 1e9), "contact: contact")


def test_equal_logs_give_equal_bytes(folder: Path, run: LoggedRun, tmp_path: Path) -> None:
    content = mcap_bytes(run)[0]
    assert mcap_bytes(run)[0] == content
    again = "from pathlib import Path; from evaluation.views.traces.folders import logged_run; "
    again += "from evaluation.views.traces.mcap import write_mcap; "
    again += (
        f"write_mcap(Path({str(tmp_path / 'a.mcap')!r}), logged_run(Path({str(folder / run.name)!r}))[0])"
    )
    subprocess.run([sys.executable, "-c", again], check=True)
    assert (tmp_path / "a.mcap").read_bytes() == content


def test_all_runs_of_a_folder(folder: Path, run: LoggedRun, tmp_path: Path) -> None:
    folder = shutil.copytree(folder, tmp_path / "copy")
    counted: list[tuple[int, int]] = []
    write_run_mcaps(folder, progress=lambda done, total: counted.append((done, total)))
    names = sorted(path.stem for path in (folder / "mcap").iterdir())
    assert names == sorted(read_runs(folder)["log"])
    assert counted == [(k + 1, len(names)) for k in range(len(names))]
    assert (folder / "mcap" / f"{run.name}.mcap").read_bytes() == mcap_bytes(run)[0]


def made(*rows: dict[str, Any]) -> pd.DataFrame:
    return pd.DataFrame(list(rows), columns=list(LOG_COLUMNS))


def ego_row(time_s: float, x_m: float = 0.0) -> dict[str, Any]:
    return {"time_s": time_s, "kind": "ego", "x_m": x_m, "y_m": 0.0, "yaw_rad": 0.0, "length_m": 4.4,
            "width_m": 1.8, "speed_mps": 10.0, "accel_mps2": -1.0}  # fmt: skip


def test_a_log_without_perception_shows_the_truth_alone() -> None:
    topics = decoded(mcap_bytes(LoggedRun("alone", made(ego_row(0.0), ego_row(0.1, 1.0))))[0])
    assert set(topics) == {"/tf", "/ego", "/actors", "/ego/signals"}
    assert all(np.isnan(message.time_to_collision_s) for _, message in topics["/ego/signals"])
    assert [len(update.entities) for _, update in topics["/actors"]] == [0, 0]


def test_stamps_of_a_recording_are_its_own() -> None:
    log = made(ego_row(0.0), ego_row(0.1, 1.0))
    content, notes = mcap_bytes(LoggedRun("dated", log, start_s=1_532_402_927.647951))
    stamps = [stamp for stamp, _ in decoded(content)["/tf"]]
    assert stamps[0] == pytest.approx(1_532_402_927_647_951_000, abs=500)
    assert stamps[1] - stamps[0] == 100_000_000
    assert notes == ()


@given(
    st.integers(1, 4_000_000_000_000_000_000),
    st.lists(st.integers(100_000, 2_000_000_000), min_size=1, max_size=20),
)
def test_stamps_of_frames_are_kept_to_the_nanosecond(first_ns: int, steps_ns: list[int]) -> None:
    frame_ns = first_ns + np.concatenate(([0], np.cumsum(steps_ns)))
    frame_s = frame_ns * 1e-9  # as readers and logs of drives have them
    time_s = frame_s - frame_s[0]
    log = made(*(ego_row(t) for t in time_s.tolist()))
    run = LoggedRun("exact", log, start_s=float(frame_s[0]), frame_ns=frame_ns)
    assert run.stamps_ns(time_s) == frame_ns.tolist()
    # between two frames times go on from the first
    between_s = 0.5 * (time_s[0] + time_s[1])
    assert run.stamps_ns(np.array([between_s])) == pytest.approx([first_ns + between_s * 1e9], abs=1500)


@pytest.mark.parametrize("start_s", [-5.0, 5e9])
def test_stamps_that_do_not_fit_count_from_zero_and_are_named(start_s: float) -> None:
    content, notes = mcap_bytes(LoggedRun("odd", made(ego_row(0.0)), start_s=start_s))
    assert [stamp for stamp, _ in decoded(content)["/tf"]] == [0]
    assert len(notes) == 1
    assert f"{start_s:.6g}" in notes[0]


def test_times_before_zero_are_refused() -> None:
    with pytest.raises(ResultsError, match="odd"):
        mcap_bytes(LoggedRun("odd", made(ego_row(-1.0))))


def test_a_log_without_ego_is_refused() -> None:
    with pytest.raises(ResultsError, match="ego"):
        mcap_bytes(LoggedRun("none", made({"time_s": 0.0, "kind": "event", "label": "warning"})))


def test_two_rows_at_one_time_are_one_message() -> None:
    actor = {"time_s": 0.0, "kind": "actor", "id": 3, "category": "car", "label": "other", "x_m": 9.0,
             "y_m": 0.0, "yaw_rad": 0.0, "length_m": 4.0, "width_m": 1.8, "speed_mps": 0.0}  # fmt: skip
    log = made(ego_row(0.0), actor, ego_row(0.0, 2.0), actor | {"x_m": 8.0})
    topics = decoded(mcap_bytes(LoggedRun("twice", log, strategy=EverythingArea()))[0])
    assert cubes(topics["/ego"])["x_m"].tolist() == [2.0]
    assert cubes(topics["/actors"])[["entity", "x_m"]].to_numpy().tolist() == [["3", 8.0]]


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (folder := tmp_path / "is a folder.mcap").mkdir()
    with pytest.raises(ArgumentError, match=r"--mcap: cannot write .*directory"):
        write_mcap(folder, LoggedRun("a", made(ego_row(0.0))))


@pytest.mark.parametrize("name", ["run.txt", "", "run"])
def test_another_name_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ArgumentError, match=r"--mcap: expected FILE\.mcap, got"):
        write_mcap(tmp_path / name, LoggedRun("odd", made(ego_row(0.0))))


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(ArgumentError, match=r"smartmot\[foxglove\]"):
        writer.require_foxglove()


def test_the_log_that_is_read_is_that_of_the_folder(folder: Path, run: LoggedRun) -> None:
    pd.testing.assert_frame_equal(run.log, read_log(log_path(folder, run.name)))
