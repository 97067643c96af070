"""Who comes how near to whom if the ego does not brake: all ways and speeds laid over one clock."""

from __future__ import annotations

import numpy as np

from scenarios.drawn.actors import EGO, Actor
from scenarios.drawn.stage import Stage
from smartmot.geometry import signed_gap
from smartmot.types import FloatArray

STEP_S = 0.04
RUN_OUT_M = 15.0
"""A scene ends when the middle of the ego is that far behind the line."""
CLEAR_M = 0.3
"""Least distance of the unbraked ego to everybody whom it does not have to brake for (assumed)."""
APART_M = 0.1
"""Least distance of the others to each other."""
DRIVERS_MPS2 = 3.4
"""Deceleration with which most drivers stop without an emergency (AASHTO, Geometric Design of Highways and
Streets, 2011: the stopping sight distance is made for it)."""
_EVERY, _SPARSE = 3, 10
_BEHIND_M = 8.0


class Timeline:
    """The unbraked ego and all others at instants of a scene.

    Args:
        stage: where.
    """

    def __init__(self, stage: Stage) -> None:
        end_s = stage.lead_s + RUN_OUT_M / stage.speed_mps
        self.time_s = np.arange(0.0, end_s + STEP_S, STEP_S)
        self._stage = stage
        self._ego = stage.route.poses(stage.start_m + stage.speed_mps * self.time_s)
        self._others: list[tuple[FloatArray, FloatArray, FloatArray]] = []

    @property
    def end_s(self) -> float:
        """When the scene ends."""
        return float(self.time_s[-1])

    def gap_m(self, actor: Actor) -> FloatArray:
        """(T,) distances of an actor's outline from the ego's, negative where they overlap."""
        center, yaw = actor.poses(self.time_s)
        ego = np.array([EGO.length_m, EGO.width_m])
        return signed_gap(self._ego[0], ego, self._ego[1], center, _size(actor), yaw)

    def keeps_to_its_ground(self, actor: Actor) -> bool:
        """Whether an actor stays on lanes, or off them, as it is to, as long as it is not behind the ego."""
        if not actor.stays:
            return True
        center = actor.poses(self.time_s[::_SPARSE])[0]
        ego_m = self._stage.start_m + self._stage.speed_mps * self.time_s[::_SPARSE]
        ahead = self._stage.route.place(center)[0] > ego_m - _BEHIND_M
        if not ahead.any():
            return True
        network = self._stage.network
        hits = network.locate(center[ahead])
        kinds = ("driving", "biking") if actor.stays == "on" else ("driving",)
        on = np.isin(np.asarray(network.lanes.lane_type)[hits.lane], kinds)
        covered = np.zeros(int(ahead.sum()), dtype=bool)
        covered[hits.point[on]] = True
        return bool(covered.all() if actor.stays == "on" else not covered.any())

    def is_braked_for(self, actor: Actor) -> bool:
        """Whether an attentive driver would brake for an actor.

        So it is if it would be hit, going on as it moves at any instant, and the ego could no longer stop
        before it as drivers do: a time to collision of v / (2 a). Who follows the road is expected to do so.
        """
        if actor.smooth or actor.motion.speed_mps == 0.0:
            return False
        time_s, speed = self.time_s[::_EVERY], self._stage.speed_mps
        ahead_s = np.arange(0.0, speed / (2.0 * DRIVERS_MPS2), STEP_S)
        center, yaw = actor.poses(time_s)
        velocity = np.gradient(center, time_s, axis=0)
        then = center[:, None] + ahead_s[:, None] * velocity[:, None]
        stations = self._stage.start_m + speed * (time_s[:, None] + ahead_s)
        ego, ego_yaw = self._stage.route.poses(stations.ravel())
        ego_size = np.array([EGO.length_m, EGO.width_m])
        gaps = signed_gap(
            ego.reshape(then.shape),
            ego_size,
            ego_yaw.reshape(stations.shape),
            then,
            _size(actor),
            yaw[:, None],
        )
        return bool((gaps <= 0.0).any())

    def is_apart(self, actor: Actor) -> bool:
        """Whether an actor stays away from all that have been added."""
        if not self._others:
            return True
        center, yaw = actor.poses(self.time_s[::_EVERY])
        others = [np.stack(column) for column in zip(*self._others, strict=True)]
        gaps = signed_gap(others[0], others[2][:, None, :], others[1], center, _size(actor), yaw)
        return bool((gaps > APART_M).all())

    def add(self, actor: Actor) -> None:
        """Note an actor for `is_apart`."""
        center, yaw = actor.poses(self.time_s[::_EVERY])
        self._others.append((center, yaw, _size(actor)))


def _size(actor: Actor) -> FloatArray:
    return np.array([actor.box.length_m, actor.box.width_m])
