"""Parameters of the live node as settings."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenarios.errors import ScenarioError
from scenarios.live.detectors import LiveDetector
from scenarios.live.node.parameters import PARAMETERS, live_settings
from scenarios.live.settings import LiveSettings
from scenarios.recorded.vehicles import Vehicle


def test_what_is_not_given_is_what_a_bag_is_seen_with() -> None:
    assert live_settings({}) == (LiveSettings(), None)
    assert live_settings({"strategy": "", "map": ""}) == (LiveSettings(), None)


def test_values_reach_the_settings() -> None:
    settings, map_file = live_settings(
        {
            "max_age": 3,
            "detection_th": 0.25,
            "dataset": "nuscenes",
            "map": "town.xodr",
            "preset": "paper",
            "strategy": "rectangular",
            "rule": "cascade",
            "velocity_frame": "world",
            "output_frame": "sensor",
            "vehicle": [4.0, 1.7, 1.3],
            "sensor_pose": [1.0, 0.0, 1.8, 0.5],
            "map_frame": "earth",
            "base_frame": "car",
        }
    )
    assert map_file == Path("town.xodr")
    assert settings == LiveSettings(
        max_age=3,
        detection_th=0.25,
        dataset="nuscenes",
        preset="paper",
        strategy="rectangular",
        rule="cascade",
        velocity_frame="world",
        output_frame="sensor",
        vehicle=Vehicle(4.0, 1.7, 1.3),
        sensor_pose=(1.0, 0.0, 1.8, 0.5),
        map_frame="earth",
        base_frame="car",
    )


def test_whole_numbers_are_numbers() -> None:
    settings, _ = live_settings({"detection_th": 0, "vehicle": [4, 2], "sensor_pose": [1, 0, 2, 0]})
    assert (settings.detection_th, settings.vehicle, settings.sensor_pose) == (
        0,
        Vehicle(4.0, 2.0),
        (1.0, 0.0, 2.0, 0.0),
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("max_age", 3.0),
        ("max_age", "3"),
        ("max_age", True),
        ("max_age", -1),
        ("max_age", None),
        ("detection_th", 1.5),
        ("detection_th", float("nan")),
        ("detection_th", "high"),
        ("detection_th", False),
        ("dataset", "waymo"),
        ("dataset", 7),
        ("map", 2024),
        ("velocity_frame", "car"),
        ("output_frame", "odom"),
        ("vehicle", [4.4]),
        ("vehicle", [4.4, 1.8, 0.0, 0.0]),
        ("vehicle", [0.0, 1.8]),
        ("vehicle", "4.4,1.8"),
        ("sensor_pose", [0.0, 0.0, float("inf"), 0.0]),
        ("sensor_pose", [True, False, True, False]),
        ("sensor_pose", []),
    ],
)
def test_values_that_are_none_of_the_kind_are_refused_with_the_name(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=name) as caught:
        live_settings({name: value})
    assert "\n" not in str(caught.value)


def test_unknown_parameters_are_refused_with_the_known_ones() -> None:
    with pytest.raises(ScenarioError, match="'max_aeg'") as caught:
        live_settings({"max_aeg": 3})
    assert all(name in str(caught.value) for name in PARAMETERS)


def test_a_file_of_detectors_is_read(tmp_path: Path) -> None:
    file = tmp_path / "detectors.toml"
    file.write_text('[lidar]\ntopic = "/boxes"\n')
    settings, _ = live_settings({"detectors": str(file)})
    assert settings == LiveSettings(detectors=(LiveDetector("lidar", "/boxes"),))
