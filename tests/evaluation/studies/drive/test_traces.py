"""Drives as files of other tools: MCAP and OSI, read back."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from osi3trace.osi_trace import OSITrace
from rosbags.rosbag2 import Reader

from evaluation.results.files import log_path
from evaluation.results.logs import read_log
from scenarios.ros.definitions import PREDICTION_ARRAY, ros2_types
from tests.scenarios.ros.bags_made import DATA

START_S = 1_532_402_927.6


def transforms(content: bytes) -> list[tuple[int, float, float]]:
    """Stamp, x and y of the ego."""
    reader = make_reader(io.BytesIO(content), decoder_factories=[DecoderFactory()])
    messages = reader.iter_decoded_messages(topics=["/tf"])
    return [(m.log_time, t.translation.x, t.translation.y) for _, _, m, t in messages]


def topics(content: bytes) -> set[str]:
    summary = make_reader(io.BytesIO(content)).get_summary()
    assert summary is not None
    return {channel.topic for channel in summary.channels.values()}


@pytest.fixture
def dated(write: Callable[..., Path], tmp_path: Path) -> Path:
    """A recording with stamps of 2018."""
    folder = write([(15.0, 0.0)], seconds=1.0)
    for file in folder.iterdir():
        head, *rows = file.read_text().splitlines()
        split = [row.split(",", 1) for row in rows]
        file.write_text("\n".join([head, *(f"{float(t) + START_S:.1f},{rest}" for t, rest in split)]) + "\n")
    return folder


def test_every_drive_is_written_with_its_own_stamps(
    run: Callable[..., Any], dated: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = run(
        "drive",
        dated,
        "--strategy",
        "all,path",
        "--mcap",
        "--no-page",
        "--quiet",
        "--preset",
        "physical",
        "--out",
        out,
    )
    assert (done.status, done.err) == (0, "")
    names = sorted(path.stem for path in (out / "mcap").iterdir())
    assert names == sorted(path.stem for path in (out / "logs").iterdir())
    assert len(names) == 2
    for name in names:
        found = transforms((out / "mcap" / f"{name}.mcap").read_bytes())
        log = read_log(log_path(out, name))
        ego = log[log["kind"] == "ego"].sort_values("time_s")
        # seconds since 1970 as doubles are 0.24 us apart
        assert [t - START_S * 1e9 for t, *_ in found] == pytest.approx(ego["time_s"] * 1e9, abs=500)
        assert [place for _, *place in found] == pytest.approx(ego[["x_m", "y_m"]].to_numpy(), abs=1e-9)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_stamps_of_a_bag_are_kept_to_the_nanosecond(
    run: Callable[..., Any], tmp_path: Path, storage: str
) -> None:
    bag, types = DATA / f"tracker_input_{storage}", ros2_types()
    expected = []
    with Reader(bag) as reader:
        frames = [c for c in reader.connections if c.msgtype == PREDICTION_ARRAY]
        for connection, received_ns, data in reader.messages(frames):
            stamp = types.deserialize_cdr(data, connection.msgtype).header.stamp
            expected.append(stamp.sec * 10**9 + stamp.nanosec or received_ns)
    out = tmp_path / "out"
    done = run("drive", bag, "--strategy", "path", "--mcap", "--no-page", "--quiet", "--out", out)
    assert (done.status, done.err) == (0, "")
    (written,) = (out / "mcap").iterdir()
    stamps = [stamp for stamp, *_ in transforms(written.read_bytes())]
    assert stamps == sorted(expected)
    done = run("replay", out / written.stem, "--osi", tmp_path / "a.osi", "--quiet")
    assert done.status == 0
    trace = OSITrace(str(tmp_path / "a.osi"), "GroundTruth")
    of_osi = [message.timestamp.seconds * 10**9 + message.timestamp.nanos for message in trace]
    trace.close()
    assert of_osi == stamps


def test_replay_of_a_drive_with_its_map(run: Callable[..., Any], driven: Path, tmp_path: Path) -> None:
    name = next((driven / "out" / "logs").glob("*map*")).stem
    done = run("replay", driven / "out" / name, "--mcap", tmp_path / "a.mcap", "--osi", tmp_path)
    assert done.status == 0
    trace = next(tmp_path.glob("*.osi"))
    assert done.out.split() == [str(tmp_path / "a.mcap"), str(trace)]  # no film, which was not asked for
    assert trace.name.startswith("19700101T000000Z_gt_380_")
    assert trace.name.endswith(f"_{name}.osi")
    assert {"/map", "/monitored_area", "/tracks"} <= topics((tmp_path / "a.mcap").read_bytes())
    log = read_log(log_path(driven / "out", name))
    reader = OSITrace(str(trace), "GroundTruth")
    messages = list(reader)
    reader.close()
    assert len(messages) == log.loc[log["kind"] == "ego", "time_s"].nunique()
    assert len(messages[0].lane) > 0
    people = [o for message in messages for o in message.moving_object if o.id.value != 1_000_000_000]
    actors = log[log["kind"] == "actor"]
    assert np.array([(o.base.position.x, o.base.position.y) for o in people]) == pytest.approx(
        actors[["x_m", "y_m"]].to_numpy(), abs=1e-9
    )


def test_a_missing_drive_is_named(run: Callable[..., Any], driven: Path, tmp_path: Path) -> None:
    done = run("replay", driven / "out" / "nothing", "--mcap", tmp_path / "a.mcap")
    assert done.status == 2
    assert done.err.count("\n") == 1
    assert "no drive 'nothing'" in done.err
    assert not (tmp_path / "a.mcap").exists()
