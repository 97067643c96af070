"""What a run gives: the entities at an instant, the first contact, and the run as a whole."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from scenarios.openscenario.running.actors import State
from smartmot.types import BoolArray, Boxes, FloatArray, StrArray


@dataclass(frozen=True, slots=True, eq=False)
class Entities:
    """All entities at one instant, as arrays in the order of the scenario, map frame.

    Args:
        time_s: when.
        name: (N,) names.
        category: (N,) detection categories.
        reference_m: (N, 2) reference points (of vehicles: middle of the rear axle).
        boxes: N bounding boxes.
        speed_mps: (N,) along the heading, negative in reverse.
        exists: (N,) not deleted.
        seen: (N,) exists and is visible to sensors.
    """

    time_s: float
    name: StrArray
    category: StrArray
    reference_m: FloatArray
    boxes: Boxes
    speed_mps: FloatArray
    exists: BoolArray
    seen: BoolArray


@dataclass(frozen=True, slots=True)
class Contact:
    """First touch of the ego's outline with another.

    Args:
        time_s: when.
        entity: the other.
        ego_speed_mps, entity_speed_mps: along their headings.
        impact_location_percent: where the centre of the other's box meets the ego's width: 0 its right edge,
            100 its left edge (Euro NCAP's counting).
    """

    time_s: float
    entity: str
    ego_speed_mps: float
    entity_speed_mps: float
    impact_location_percent: float


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What a run came to; None where it did not happen. N entities, T samples.

    Args:
        contact_time_s: first contact of the ego.
        contact_entity: with whom.
        target: the entity that the scenario is about.
        target_start_time_s: when it left standstill.
        target_steady_time_s: since when its speed was constant at the contact (without contact: at the end).
        ego_speed_at_contact_kmh, target_speed_at_contact_kmh: of the ego and of the entity hit.
        impact_location_percent: see `Contact`.
        end_time_s: end of the run.
        stopped: whether the storyboard's stop trigger ended it (not the time limit).
        names: (N,) entities.
        time_s: (T,) sampling times.
        x_m, y_m, yaw_rad: (T, N) reference points and headings.
        speed_mps: (T, N) speeds.
        exists: (T, N) whether the entity is there.
    """

    contact_time_s: float | None
    contact_entity: str | None
    target: str | None
    target_start_time_s: float | None
    target_steady_time_s: float | None
    ego_speed_at_contact_kmh: float | None
    target_speed_at_contact_kmh: float | None
    impact_location_percent: float | None
    end_time_s: float
    stopped: bool
    names: StrArray
    time_s: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    yaw_rad: FloatArray
    speed_mps: FloatArray
    exists: BoolArray


def _column() -> array[float]:
    return array("d")


@dataclass(slots=True)
class Samples:
    """What a run came to so far, as columns that grow: no object is kept of a time or an entity.

    Args:
        time_s: sampling times.
        states: x, y, yaw and speed of each entity, time by time.
        exists: which of them are there, time by time.
    """

    time_s: array[float] = field(default_factory=_column)
    states: array[float] = field(default_factory=_column)
    exists: bytearray = field(default_factory=bytearray)

    def add(self, time_s: float, states: Iterable[State], exists: Iterable[bool]) -> None:
        """Take a sample."""
        self.time_s.append(time_s)
        for state in states:
            self.states.extend(state[:4])
        self.exists.extend(exists)

    def columns(self, count: int) -> tuple[FloatArray, FloatArray, BoolArray]:
        """(T,) times, (T, N, 4) x, y, yaw and speed, (T, N) who is there; N: so many entities."""
        times = np.array(self.time_s)
        states = np.array(self.states).reshape(len(times), count, 4)
        return times, states, np.array(self.exists, dtype=np.bool_).reshape(len(times), count)

    def __deepcopy__(self, memo: dict[int, object]) -> Samples:
        """Columns of its own."""
        return Samples(self.time_s[:], self.states[:], self.exists[:])


@lru_cache(maxsize=64)
def read_only(names: tuple[str, ...]) -> StrArray:
    """Names as an array that cannot be changed."""
    array = np.array(names, dtype=np.str_)
    array.setflags(write=False)
    return array
