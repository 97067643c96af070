"""What a forecast leaves open: the spread of places across any direction, and that of velocities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmot.forecast.motion import codes, forecast_covariance
from smartmot.types import FloatArray, Forecast, StrArray, Tracks

_LINEAR, _TURNING = 9, 5
"""Entries of a filter's state: see `smartmot.forecast.motion`."""


@dataclass(frozen=True, slots=True, eq=False)
class UncertainMotion:
    """Where M objects are going, and how sure that is; one frame of coordinates for all.

    Args:
        time_s: (T,) times after now.
        center_m: (M, T, 2) forecast centres.
        yaw_rad: (M, T) forecast headings.
        size_m: (M, 2) length and width.
        category: (M,) names out of CATEGORIES.
        velocity_mps: (M, 2) velocities over ground now.
        place_m2: (M, T, 2, 2) covariances of the centres, but for the turn rate.
        velocity_m2ps2: (M, 2, 2) covariances of the velocities.
        turn_rad2ps2: (M,) variances of the turn rates with which the forecast goes on.
    """

    time_s: FloatArray
    center_m: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    category: StrArray
    velocity_mps: FloatArray
    place_m2: FloatArray
    velocity_m2ps2: FloatArray
    turn_rad2ps2: FloatArray

    def __len__(self) -> int:
        return len(self.size_m)

    def __getitem__(self, rows: object) -> UncertainMotion:
        """That of some of the objects."""
        return UncertainMotion(
            self.time_s,
            *(
                getattr(self, name)[rows]
                for name in (
                    "center_m", "yaw_rad", "size_m", "category", "velocity_mps", "place_m2",
                    "velocity_m2ps2", "turn_rad2ps2",
                )
            ),
        )  # fmt: skip

    @classmethod
    def of(cls, tracks: Tracks, forecast: Forecast, delay_s: float = 0.0) -> UncertainMotion:
        """That of tracks with their forecast.

        The places spread by the variances of place and velocity, carried on, and by the accelerations that no
        model knows (`forecast_covariance`). A tracker that tells no covariance is taken for exact but for
        these.

        Args:
            tracks: M tracks.
            forecast: theirs.
            delay_s: age of the tracks' estimate now, in which it spreads as well.
        """
        entries = tracks.covariance.shape[1]
        place = forecast.covariance_m2
        if place is None:
            place = forecast_covariance(tracks.covariance, codes(tracks.category), forecast.time_s + delay_s)
        velocity, turn = np.zeros((len(tracks), 2, 2)), np.zeros(len(tracks))
        if entries >= _LINEAR:
            velocity = tracks.covariance[:, 5:7, 5:7]
            turn = tracks.covariance[:, 8, 8]
        elif entries == _TURNING:
            c, s = np.cos(tracks.boxes.yaw_rad), np.sin(tracks.boxes.yaw_rad)
            speed = np.hypot(tracks.velocity_mps[:, 0], tracks.velocity_mps[:, 1])
            along, across = tracks.covariance[:, 3, 3], speed**2 * tracks.covariance[:, 2, 2]
            velocity = np.empty((len(tracks), 2, 2))
            velocity[:, 0, 0] = along * c**2 + across * s**2
            velocity[:, 1, 1] = along * s**2 + across * c**2
            velocity[:, 0, 1] = velocity[:, 1, 0] = (along - across) * c * s
            turn = tracks.covariance[:, 4, 4]
        return cls(
            forecast.time_s,
            forecast.center_m,
            forecast.yaw_rad,
            forecast.size_m,
            tracks.category,
            tracks.velocity_mps,
            place,
            velocity,
            np.where(tracks.dynamic, turn, 0.0),  # what stands is forecast to stay
        )

    def turned(self, turn_rad: float, center_m: FloatArray) -> UncertainMotion:
        """The same in a frame that is turned: headings grow by `turn_rad`, the centres are given."""
        c, s = np.cos(turn_rad), np.sin(turn_rad)
        turn = np.array([[c, -s], [s, c]])
        return UncertainMotion(
            self.time_s,
            center_m,
            self.yaw_rad + turn_rad,
            self.size_m,
            self.category,
            self.velocity_mps @ turn.T,
            turn @ self.place_m2 @ turn.T,
            turn @ self.velocity_m2ps2 @ turn.T,
            self.turn_rad2ps2,
        )

    def sigma_m(self, normal: FloatArray) -> FloatArray:
        """(M, T) standard deviations of the places along unit vectors, (M, T, 2).

        A turn rate that is off by w takes an object of speed v off its course by v w t^2 / 2.
        """
        variance = np.einsum("mti,mtij,mtj->mt", normal, self.place_m2, normal)
        return np.asarray(np.sqrt(variance + self._turned_away_m2(normal)))

    def drift_sigma_m(self, normal: FloatArray) -> FloatArray:
        """(M, T) standard deviations of the ways driven along unit vectors by errors of the velocity alone.

        That is how far what keeps its place along the vector is forecast to move.

        Args:
            normal: (M, T, 2) unit vectors.
        """
        variance = np.einsum("mti,mij,mtj->mt", normal, self.velocity_m2ps2, normal) * self.time_s**2
        return np.asarray(np.sqrt(variance + self._turned_away_m2(normal)))

    def _turned_away_m2(self, normal: FloatArray) -> FloatArray:
        """(M, T) variances along unit vectors by the turn rates."""
        vx, vy = self.velocity_mps[:, None, 0], self.velocity_mps[:, None, 1]
        beside = (
            vx * normal[..., 1] - vy * normal[..., 0]
        )  # the speed, times the share of the course's normal
        return np.asarray(beside**2 * self.turn_rad2ps2[:, None] * self.time_s**4 / 4.0)
