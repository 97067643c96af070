"""Streets drawn at random: labels of crowded ones with poor sensors are as right as those of others."""

import functools
import hashlib
import math
from dataclasses import replace

import numpy as np

from benchmarks.training_frames import Source, street_frames
from evaluation.studies.lidar.drawn import DrawnFrame, drawn_frames
from scenarios.drawn.map_set import MAPS
from scenarios.sensors.lidar import lidar_config


@functools.cache
def frames(*, rough: bool) -> tuple[DrawnFrame, ...]:
    config = lidar_config("hdl64")
    config = replace(config, pattern=replace(config.pattern, field_rad=math.radians(90.0)))
    maps = [MAPS / f"{name}.xodr" for name in ("straight_street", "country_road")]
    return tuple(drawn_frames(maps, config, 8, 91, in_turn=True, varied=True, rough=rough))


def test_points_of_a_body_are_in_its_box_and_on_the_ground_under_it() -> None:
    """No echo over a person is over the box, none is far under it, and most heads are seen."""
    hidden = []
    for frame in frames(rough=True):
        for row in np.flatnonzero((frame.points > 80) & (frame.category == "pedestrian")):
            own, at = frame.boxes[np.array([row])], frame.boxes.center_m[row]
            if np.hypot(*at[:2]) < 8.0:  # the field of view ends under the head
                continue
            inside = np.abs(frame.cloud.xyz_m[:, :2] - at[:2]).max(axis=1) < 0.2
            height = frame.cloud.xyz_m[inside, 2] - (at[2] - 0.5 * own.size_m[0, 2])
            assert height.min() > -0.15
            assert height.max() < own.size_m[0, 2] + 0.1
            hidden.append(own.size_m[0, 2] - height.max())
    assert len(hidden) >= 3
    assert np.median(hidden) < 0.1


def test_crowded_streets_have_more_road_users_ahead_and_farther_away() -> None:
    def ahead(rough: bool) -> list[float]:
        return [
            float(np.hypot(x, y))
            for frame in frames(rough=rough)
            for x, y in frame.boxes.center_m[frame.category == "cyclist", :2]
            if abs(math.atan2(y, x)) < math.radians(45.0)
        ]

    usual, crowded = ahead(rough=False), ahead(rough=True)
    assert len(crowded) > len(usual)
    assert np.median(crowded) > np.median(usual)


def test_poor_sensors_lose_echoes_far_away() -> None:
    """The same share of the usual clouds is farther than 30 m in every frame, less of most rough ones."""
    share = {
        rough: np.mean([(np.hypot(*f.cloud.xyz_m[:, :2].T) > 30.0).mean() for f in frames(rough=rough)])
        for rough in (False, True)
    }
    assert share[True] < share[False]


def test_frames_to_learn_from_are_the_same_each_time_and_named() -> None:
    source = Source("mid70", 70.4, 80, rough=True)
    made = [street_frames(source, 5, 2) for _ in range(2)]
    digest = {hashlib.sha256(b"".join(f.points.tobytes() for f in each)).hexdigest() for each in made}
    assert len(digest) == 1
    assert [frame.name for frame in made[0]] == [f"mid70_70.4_rough_{k}" for k in range(8, 12)]
    # heights are over the ground that the cloud shows: who stands on it begins near 0
    bottom = np.concatenate([f.boxes.center_m[:, 2] - 0.5 * f.boxes.size_m[:, 2] for f in made[0]])
    seen = np.concatenate([f.counts >= 20 for f in made[0]])
    assert np.median(np.abs(bottom[seen])) < 0.15
