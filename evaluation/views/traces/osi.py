"""The truth of a run as a trace of ASAM OSI's GroundTruth messages: docs/osi.md says what is in it."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import _smartmot
from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError, write_whole
from evaluation.views.pictures import told_of_writing
from evaluation.views.plots.log_rows import placed_signals, signals_at
from evaluation.views.plots.objects import signal_lamp
from evaluation.views.traces.lanes import lanes_near
from evaluation.views.traces.run import (
    HEIGHTS_M,
    NANOSECONDS,
    LoggedRun,
    TimedRows,
    actor_rows,
    ego_rows,
    ego_states,
)
from opendrive import RoadNetwork
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd
    from osi3.osi_groundtruth_pb2 import GroundTruth
    from osi3.osi_version_pb2 import InterfaceVersion

OPTION, SUFFIX = "--osi", ".osi"
HOST_ID = 1_000_000_000
"""Identifier of the ego; all others have that of the log."""

_VEHICLES = {
    "car": "TYPE_MEDIUM_CAR",
    "cyclist": "TYPE_BICYCLE",
    "truck": "TYPE_HEAVY_TRUCK",
    "motorcycle": "TYPE_MOTORBIKE",
}
"""Classes of OSI's vehicles by category."""
LIGHT_IDS = HOST_ID + 1
"""Identifiers of traffic lights, from this one on."""
_LIGHTS = {
    "red": ("COLOR_RED", "MODE_CONSTANT"),
    "yellow": ("COLOR_YELLOW", "MODE_CONSTANT"),
    "green": ("COLOR_GREEN", "MODE_CONSTANT"),
    "off": ("COLOR_UNKNOWN", "MODE_OFF"),
}
"""Colour and mode of OSI's traffic lights by the lamp that is lit."""
_LENGTH = struct.Struct("<I")
"""Before each message of a trace: its length."""


def require_osi() -> None:
    """See that what writes OSI is installed.

    Raises:
        ArgumentError: it is not.
    """
    try:
        import osi3.osi_groundtruth_pb2  # noqa: F401
    except ImportError as error:
        raise ArgumentError(_smartmot.missing_extra(f"{OPTION}: traces", "osi", error)) from None


def write_osi(path: Path, run: LoggedRun) -> tuple[Path, tuple[str, ...]]:
    """Write the truth of a run as a single-channel binary trace, as a whole or not at all.

    Args:
        path: `FILE.osi`, or a folder, in which the file is named as OSI's convention has it.
        run: the run; its map is that of the world, not that of perception.

    Returns:
        The file, and what it does not hold, a line each.

    Raises:
        ArgumentError: osi-python is missing, the name does not end with `.osi`, or writing fails.
        ResultsError: the log has no ego, times that stamps cannot hold, or an identity that is negative or
            not less than `HOST_ID`.
    """
    require_osi()
    if not path.is_dir() and path.suffix != SUFFIX:
        raise ArgumentError(f"{OPTION}: expected FILE{SUFFIX} or a folder, got {path}")
    messages, notes = ground_truth(run)
    if path.is_dir():
        path /= trace_name(run, len(messages))
    packed = [message.SerializeToString(deterministic=True) for message in messages]
    with told_of_writing(OPTION, path):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, b"".join(part for data in packed for part in (_LENGTH.pack(len(data)), data)))
    return path, notes


def trace_name(run: LoggedRun, frames: int) -> str:
    """Name of a trace: stamp, type, versions of OSI and protobuf, frames, and the name of the log.

    https://opensimulationinterface.github.io/osi-antora-generator, "OSI trace file naming conventions".
    """
    import google.protobuf

    stamp = datetime.fromtimestamp(run.start_ns // NANOSECONDS, UTC).strftime("%Y%m%dT%H%M%SZ")
    version = _version()
    protobuf = google.protobuf.__version__.replace(".", "")
    osi = f"{version.version_major}{version.version_minor}{version.version_patch}"
    return f"{stamp}_gt_{osi}_{protobuf}_{frames}_{run.name}{SUFFIX}"


def ground_truth(run: LoggedRun) -> tuple[list[GroundTruth], tuple[str, ...]]:
    """One message per time of the ego, the lanes in the first alone; and what they do not hold.

    Raises:
        ResultsError: see `write_osi`.
    """
    from osi3.osi_groundtruth_pb2 import GroundTruth

    ego, actors = ego_rows(run.log), actor_rows(run.log)
    possible = (actors["id"] >= 0) & (actors["id"] < HOST_ID)
    if not possible.all():
        first = actors["id"][~possible][0]
        raise ResultsError(f"{run.name}: identities must lie in 0 to {HOST_ID - 1}: {first:.0f}")
    stamps_ns = run.stamps_ns(ego.time_s)
    messages = []
    for stamp in stamps_ns:
        message = GroundTruth()
        message.version.CopyFrom(_version())
        message.timestamp.seconds, message.timestamp.nanos = divmod(stamp, NANOSECONDS)
        message.host_vehicle_id.value = HOST_ID
        messages.append(message)
    _add_objects(messages, ego, [HOST_ID] * len(ego), ["car"] * len(ego), run, _ego_motion(ego))
    identities = [int(value) for value in actors["id"].tolist()]
    _add_objects(messages, actors, identities, actors.text, run, _motion(actors))
    _add_lights(messages, ego.time_s, placed_signals(run.log))
    return messages, (*run.notes, *_add_map(messages[0], run, ego))


Motion = tuple[FloatArray, FloatArray, FloatArray]
"""Velocities (N, 2), accelerations (N, 2), and yaw rates (N,); NaN where they are not known."""


def _ego_motion(ego: TimedRows) -> Motion:
    """Along the heading the log's acceleration, across it that of the turn."""
    ahead = _heading(ego)
    left = np.column_stack((-ahead[:, 1], ahead[:, 0]))
    rate = np.array([state.yaw_rate_radps for state in ego_states(ego)])
    speed, accel = ego["speed_mps"][:, None], ego["accel_mps2"][:, None]
    return ahead * speed, ahead * accel + left * speed * rate[:, None], rate


def _motion(actors: TimedRows) -> Motion:
    """Accelerations as OSI defines them: the velocity's change since the frame before, per time."""
    velocity = _heading(actors) * actors["speed_mps"][:, None]
    order = np.lexsort((actors["time_s"], actors["id"]))
    step_s = np.diff(actors["time_s"][order])
    change, turn = np.diff(velocity[order], axis=0), np.diff(actors["yaw_rad"][order])
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    same = np.diff(actors["id"][order]) == 0
    accel, rate = np.full((len(order), 2), np.nan), np.full(len(order), np.nan)
    accel[order[1:][same]] = change[same] / step_s[same, None]
    rate[order[1:][same]] = turn[same] / step_s[same]
    return velocity, accel, rate


def _heading(rows: TimedRows) -> FloatArray:
    yaw = rows["yaw_rad"].astype(np.float64)
    return np.column_stack((np.cos(yaw), np.sin(yaw)))


def _add_objects(
    messages: Sequence[GroundTruth],
    rows: TimedRows,
    identities: Sequence[int],
    categories: Sequence[str],
    run: LoggedRun,
    motion: Motion,
) -> None:
    """Add moving objects, each to the message of its time."""
    from osi3.osi_object_pb2 import MovingObject

    vehicle = MovingObject.VehicleClassification
    columns = [rows[name].tolist() for name in ("x_m", "y_m", "yaw_rad", "length_m", "width_m")]
    velocity, accel, rate = (part.tolist() for part in motion)
    for message, part in zip(messages, rows.slices, strict=True):
        for k in range(part.start, part.stop):
            x, y, yaw, length, width = (column[k] for column in columns)
            category = categories[k]
            height = run.height_m.get(identities[k], HEIGHTS_M.get(category, HEIGHTS_M["unknown"]))
            added = message.moving_object.add()
            added.id.value = identities[k]
            base = added.base
            base.dimension.length, base.dimension.width, base.dimension.height = length, width, height
            base.position.x, base.position.y, base.position.z = x, y, 0.5 * height
            base.orientation.yaw, base.orientation.pitch, base.orientation.roll = yaw, 0.0, 0.0
            (base.velocity.x, base.velocity.y), base.velocity.z = velocity[k], 0.0
            if not np.isnan(accel[k][0]):
                (base.acceleration.x, base.acceleration.y), base.acceleration.z = accel[k], 0.0
                base.orientation_rate.yaw = rate[k]
            if category == "pedestrian":
                added.type = MovingObject.TYPE_PEDESTRIAN
            elif category in _VEHICLES:
                added.type = MovingObject.TYPE_VEHICLE
                added.vehicle_classification.type = vehicle.Type.Value(_VEHICLES[category])
                added.vehicle_classification.role = vehicle.ROLE_CIVIL
            else:
                added.type = MovingObject.TYPE_OTHER


def _add_lights(messages: Sequence[GroundTruth], time_s: FloatArray, changes: pd.DataFrame) -> None:
    """Add the lamp that is lit of every traffic signal to the message of each time."""
    from osi3.osi_trafficlight_pb2 import TrafficLight

    from evaluation.views.traces.osi_lanes import OPENDRIVE

    kind = TrafficLight.Classification
    identity = {signal: LIGHT_IDS + k for k, signal in enumerate(sorted(set(changes["category"])))}
    for message, now_s in zip(messages, time_s.tolist() if len(changes) else (), strict=False):
        rows = signals_at(changes, now_s)[["category", "label", "x_m", "y_m"]]
        for signal, state, x_m, y_m in rows.itertuples(index=False):
            lamp = signal_lamp(state)
            light = message.traffic_light.add()
            light.id.value = identity[signal]
            light.base.position.x, light.base.position.y = x_m, y_m
            color, mode = _LIGHTS.get(lamp, ("COLOR_OTHER", "MODE_OTHER"))
            light.classification.color = kind.Color.Value(color)
            light.classification.mode = kind.Mode.Value(mode)
            source = light.source_reference.add()
            source.type = OPENDRIVE
            source.identifier.append(str(signal))


def _add_map(message: GroundTruth, run: LoggedRun, ego: TimedRows) -> tuple[str, ...]:
    """Add lanes and boundaries around the ego's way; what is left out."""
    if run.network is None:
        return ("No map is known: the trace has no lanes.",)
    if not isinstance(run.network, RoadNetwork):
        return ("Lanes are written of OpenDRIVE maps only: the trace has none.",)
    from evaluation.views.traces.osi_lanes import add_lanes

    near = lanes_near(run.network, np.column_stack((ego["x_m"], ego["y_m"])))
    add_lanes(message, run.network, near)
    message.map_reference = run.network.name
    return near.notes


def _version() -> InterfaceVersion:
    """OSI's version, as the library says it."""
    from osi3 import osi_version_pb2

    options = osi_version_pb2.DESCRIPTOR.GetOptions()
    version: InterfaceVersion = options.Extensions[osi_version_pb2.current_interface_version]
    return version
