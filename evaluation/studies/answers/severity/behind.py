"""What vehicles of SUMO behind the ego make of its braking."""

from __future__ import annotations

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.metrics.rear_end import Followers
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import Simulation
from scenarios.spec import RunSpec
from scenarios.traffic import Traffic
from scenarios.traffic.demand import STEP_S
from smartmot.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Behind:
    """What the first vehicle behind the ego did from the first emergency request on.

    Args:
        struck_kmh: by how much it was faster when it touched the ego; None: it did not.
        ttc_s: least time to collision with the ego while it was straight behind; 0 of one that touched it,
            None if it never came nearer.
        decel_mps2: its greatest deceleration, over 0.1 s.
    """

    struck_kmh: float | None
    ttc_s: float | None
    decel_mps2: float


def with_followers(spec: RunSpec, count: int, drivers: Followers) -> RunSpec:
    """A run with vehicles behind the ego whose driver is one of a distribution, by the run's seed.

    The same in all runs of a scene. Krauss' model without dawdling: time gap, time between decisions and
    greatest deceleration are the driver's, all else is SUMO's default.

    Args:
        spec: the run.
        count: of vehicles.
        drivers: time gaps and reaction times; each is drawn from its equally probable ones.
    """
    chosen = random.Random(spec.seed)
    gap_s, dead_s = chosen.choice(drivers.gap_s.tolist()), chosen.choice(drivers.dead_s.tolist())
    traffic = Traffic(
        followers=count,
        tau_s=gap_s,
        reaction_s=max(round(dead_s / STEP_S), 1) * STEP_S,
        emergency_decel_mps2=drivers.decel_mps2,
        sigma=0.0,
    )
    return replace(spec, traffic=traffic)


def behind_of(simulation: Simulation, outcome: Outcome) -> Behind | None:
    """What the first follower made of the first emergency request; None without a request or a follower."""
    entities = [e.name for e in simulation.engine.definition.entities if e.name != simulation.engine.ego.name]
    name = Traffic().names[0][0]
    if outcome.flag_time_s is None or name not in entities:
        return None
    log = outcome.log.table()
    rows = np.flatnonzero((log["kind"] == "actor") & (log["id"] == entities.index(name)))
    if not len(rows):
        return None  # there was no room for it
    own = np.flatnonzero(log["kind"] == "ego")
    time_s, first = np.unique(log["time_s"][rows], return_index=True)
    rows = rows[first]
    speed = log["speed_mps"][rows]
    at = own[np.searchsorted(log["time_s"][own], time_s).clip(max=len(own) - 1)]
    ego, own_size = _columns(log, at, "x_m", "y_m", "yaw_rad"), _columns(log, at, "length_m", "width_m")
    gap_m = gaps_m(
        ego, own_size, _columns(log, rows, "x_m", "y_m"), _columns(log, rows, "length_m", "width_m")
    )
    after = time_s >= outcome.flag_time_s - 1e-9
    hit = next((contact for contact in outcome.struck if contact.entity == name), None)
    ttc_s = 0.0 if hit else least_ttc_s(gap_m[after], (speed - log["speed_mps"][at])[after])
    decel = np.diff(speed) / np.maximum(np.diff(time_s), STEP_S / 10)
    return Behind(
        None if hit is None else 3.6 * (hit.entity_speed_mps - hit.ego_speed_mps),
        ttc_s,
        max(0.0, -float(decel[after[1:]].min(initial=0.0))),
    )


def _columns(log: Mapping[str, NDArray[Any]], rows: IntArray, *names: str) -> FloatArray:
    return np.stack([log[name][rows] for name in names], axis=-1)


def gaps_m(
    ego_pose: FloatArray, ego_size_m: FloatArray, center_m: FloatArray, size_m: FloatArray
) -> FloatArray:
    """(T,) free distances to who is straight behind; NaN for who is not, such as beside the way in a bend.

    Args:
        ego_pose: (T, 3) x, y in m and heading in rad.
        ego_size_m: (T, 2) length and width.
        center_m: (T, 2) of who drives behind.
        size_m: (T, 2) its length and width.
    """
    dx, dy = (ego_pose[:, :2] - center_m).T
    cos, sin = np.cos(ego_pose[:, 2]), np.sin(ego_pose[:, 2])
    length_m, width_m = (ego_size_m + size_m).T / 2
    gap_m = cos * dx + sin * dy - length_m
    return np.asarray(np.where((gap_m > 0.0) & (np.abs(cos * dy - sin * dx) < width_m), gap_m, np.nan))


def least_ttc_s(gap_m: FloatArray, closing_mps: FloatArray) -> float | None:
    """Least free distance over the speed at which it shrinks; None where it never does.

    Args:
        gap_m: (T,) free distances; NaN where there is none.
        closing_mps: (T,) speeds at which they shrink.
    """
    closes = (closing_mps > 1e-6) & ~np.isnan(gap_m)
    least = float((gap_m[closes] / closing_mps[closes]).min(initial=math.inf))
    return least if math.isfinite(least) else None
