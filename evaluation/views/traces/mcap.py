"""A run as MCAP with foxglove's schemas, a view of its log: docs/mcap.md says what is in it."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import _smartmot
from evaluation.errors import ArgumentError
from evaluation.metrics.criticality import criticality
from evaluation.results.files import write_whole
from evaluation.views.pictures import told_of_writing
from evaluation.views.plots.log_rows import placed_signals, signals_at
from evaluation.views.traces import signals
from evaluation.views.traces.lanes import lanes_near
from evaluation.views.traces.run import (
    LoggedRun,
    TimedRows,
    actor_rows,
    decision_times,
    ego_rows,
    ego_states,
    rows_of,
)
from smartmot.area import MonitoredAreaStrategy
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from foxglove import Context

OPTION = "--mcap"
SUFFIX = ".mcap"

Messages = tuple[Any, Sequence[tuple[int, Any]]]
"""A channel, and its messages, each with its stamp in ns."""


def require_foxglove() -> None:
    """See that what writes MCAP is installed.

    Raises:
        ArgumentError: it is not.
    """
    try:
        import foxglove  # noqa: F401
    except ImportError as error:
        raise ArgumentError(_smartmot.missing_extra(f"{OPTION}: files", "foxglove", error)) from None


def write_mcap(path: Path, run: LoggedRun, option: str = OPTION) -> tuple[str, ...]:
    """Write a run as MCAP, as a whole or not at all; equal logs give equal bytes.

    Args:
        path: file to write; its folder is made if needed.
        run: the run.
        option: the command line option that asks for it, for messages.

    Returns:
        What the file does not show, a line each.

    Raises:
        ArgumentError: foxglove-sdk is missing, the name does not end with `.mcap`, or writing fails.
        ResultsError: the log has no ego, or times that stamps cannot hold.
        smartmot.errors.PluginError: a monitored area of the user's own fails.
    """
    require_foxglove()
    if path.suffix != SUFFIX:
        raise ArgumentError(f"{option}: expected FILE{SUFFIX}, got {str(path)!r}")
    content, notes = mcap_bytes(run)
    with told_of_writing(option, path):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content)
    return notes


def mcap_bytes(run: LoggedRun) -> tuple[bytes, tuple[str, ...]]:
    """The file of a run, and what it does not show; see `write_mcap`."""
    from foxglove import Context, open_mcap
    from foxglove.mcap import MCAPWriteOptions

    context, content = Context(), io.BytesIO()
    # one thread: what several make of the data depends on their number
    writer = open_mcap(content, context=context, writer_options=MCAPWriteOptions(compression_threads=0))
    try:
        writer.write_metadata(
            "smartmot", {"run": run.name, "start_s": repr(run.start_s), "frame": "map: x east, y north, m"}
        )
        topics, notes = _topics(run, context)
        in_time = sorted(
            ((stamp, rank, channel, message)
             for rank, (channel, messages) in enumerate(topics)
             for stamp, message in messages),
            key=lambda entry: entry[:2],
        )  # fmt: skip
        for stamp, _, channel, message in in_time:
            channel.log(message, log_time=stamp)
    finally:
        writer.close()
    return content.getvalue(), notes


def _topics(run: LoggedRun, context: Context) -> tuple[list[Messages], tuple[str, ...]]:
    """All channels with their messages, in the order in which those of one time are written."""
    from foxglove.channels import FrameTransformChannel, SceneUpdateChannel

    from evaluation.views.traces import scene

    def channel(topic: str) -> SceneUpdateChannel:
        return SceneUpdateChannel(topic, context=context)

    ego, actors = ego_rows(run.log), actor_rows(run.log)
    stamps_ns = run.stamps_ns(ego.time_s)
    stamps = scene.timestamps(stamps_ns)
    topics: list[Messages] = []
    notes = run.notes
    if run.network is not None:
        near = lanes_near(run.network, np.column_stack((ego["x_m"], ego["y_m"])))
        topics.append((channel("/map"), [(stamps_ns[0], scene.map_scene(run.network, near, stamps[0]))]))
        notes += near.notes
    topics += [
        (FrameTransformChannel("/tf", context=context), _paired(stamps_ns, scene.transforms(ego, stamps))),
        (channel("/ego"), _paired(stamps_ns, scene.ego_scene(ego, stamps))),
        (channel("/actors"), _paired(stamps_ns, scene.actor_scene(actors, stamps))),
        _signals(run, ego, stamps_ns, context),
    ]
    topics += _perception(run, ego, context)
    changes = placed_signals(run.log)
    if len(changes):
        topics.append((channel("/traffic_signals"), _lights(run, changes)))
    events = _events(run, context)
    return [*topics, events], notes


def _lights(run: LoggedRun, changes: pd.DataFrame) -> list[tuple[int, Any]]:
    """What all traffic signals show, whenever one of them changes."""
    from evaluation.views.traces import scene

    times = np.unique(changes["time_s"].to_numpy(np.float64))
    stamps_ns = run.stamps_ns(times)
    lit = [signals_at(changes, time_s)[["category", "label", "x_m", "y_m"]] for time_s in times.tolist()]
    rows = [list(held.itertuples(index=False, name=None)) for held in lit]
    stamps = scene.timestamps(stamps_ns)
    return _paired(stamps_ns, [scene.signal_scene(*part) for part in zip(rows, stamps, strict=True)])


def _perception(run: LoggedRun, ego: TimedRows, context: Context) -> list[Messages]:
    """What perception made of each frame, and where it looked; nothing where nothing perceives."""
    from foxglove.channels import SceneUpdateChannel

    from evaluation.views.traces import scene

    time_s = decision_times(run.log)
    if not len(time_s):
        return []
    stamps_ns = run.stamps_ns(time_s)
    stamps = scene.timestamps(stamps_ns)
    rows = {
        kind: rows_of(run.log, kind, time_s) for kind in ("detection", "track", "forecast", "ego_forecast")
    }
    made = {
        "/detections": scene.detection_scene(rows["detection"], stamps),
        "/tracks": scene.track_scene(rows["track"], stamps),
        "/forecasts": scene.forecast_scene(rows["forecast"], stamps),
        "/ego_forecast": scene.forecast_scene(rows["ego_forecast"], stamps, "ego"),
    }
    paired = {topic: _paired(stamps_ns, messages) for topic, messages in made.items()}
    if run.strategy is not None:
        paired["/monitored_area"] = _areas(run, run.strategy, ego, time_s)
    return [(SceneUpdateChannel(topic, context=context), messages) for topic, messages in paired.items()]


def _areas(
    run: LoggedRun, strategy: MonitoredAreaStrategy, ego: TimedRows, time_s: FloatArray
) -> list[tuple[int, Any]]:
    """The monitored area at the decisions for which there is an ego."""
    from evaluation.views.traces import scene

    decided = np.flatnonzero(np.isin(ego.time_s, time_s))
    states = ego_states(ego)
    areas = [strategy.at(states[k]).polygons() for k in decided.tolist()]
    stamps_ns = run.stamps_ns(ego.time_s[decided])
    return _paired(stamps_ns, scene.area_scene(areas, scene.timestamps(stamps_ns)))


def _signals(run: LoggedRun, ego: TimedRows, stamps_ns: Sequence[int], context: Context) -> Messages:
    """Speed, acceleration and time to collision of the ego, to be plotted."""
    from foxglove import Channel, Schema

    columns = {str(name): run.log[name].to_numpy() for name in run.log.columns}
    least_s = criticality(columns, 1.0).time_to_collision_s
    schema = Schema(
        name=f"{signals.PACKAGE}.{signals.MESSAGE}", encoding="protobuf", data=signals.descriptor()
    )
    channel = Channel("/ego/signals", schema=schema, message_encoding="protobuf", context=context)
    of_signals = (ego["speed_mps"], ego["accel_mps2"], np.where(np.isfinite(least_s), least_s, np.nan))
    return channel, _paired(stamps_ns, signals.encoded(of_signals))


def _events(run: LoggedRun, context: Context) -> Messages:
    """Events of the log, and the contact, which the log does not name."""
    from foxglove.channels import LogChannel

    from evaluation.views.traces import scene

    rows = run.log[run.log["kind"] == "event"]
    events = list(zip(rows["time_s"].tolist(), rows["category"], rows["label"], strict=True))
    if run.contact_time_s is not None:
        events.append((run.contact_time_s, "run", "contact"))
    events.sort(key=lambda event: event[0])
    stamps_ns = run.stamps_ns(np.array([time for time, *_ in events], dtype=np.float64))
    logs = [
        scene.event_log(stamp, str(layer), str(name))
        for stamp, (_, layer, name) in zip(scene.timestamps(stamps_ns), events, strict=True)
    ]
    return LogChannel("/events", context=context), _paired(stamps_ns, logs)


def _paired(stamps_ns: Sequence[int], messages: Sequence[Any]) -> list[tuple[int, Any]]:
    return list(zip(stamps_ns, messages, strict=True))
