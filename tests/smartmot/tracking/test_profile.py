import json
from pathlib import Path
from typing import Any

import pytest

from smartmot.errors import ConfigError
from smartmot.tracking.configs import tracker_config
from smartmot.tracking.profile import CategoryProfile, DetectorProfile, is_profile

PROFILE = DetectorProfile(
    "lidar", 10.0, {"car": CategoryProfile(1000, 0.7, 0.08), "pedestrian": CategoryProfile(12, 0.4)}
)


def test_a_profile_survives_its_file(tmp_path: Path) -> None:
    PROFILE.save(tmp_path / "p.json")
    assert DetectorProfile.load(tmp_path / "p.json") == PROFILE


def test_a_configuration_takes_what_the_profile_knows(tmp_path: Path) -> None:
    PROFILE.save(tmp_path / "p.json")
    usual, config = tracker_config("default"), tracker_config(str(tmp_path / "p.json"))
    reference, noise = config.score_reference, config.filter.position_sigma_m
    assert reference is not None
    assert (reference.car, reference.pedestrian, reference.cyclist) == (0.7, 0.4, 1.0)  # type: ignore[union-attr]
    assert (noise.car, noise.pedestrian) == (0.08, usual.filter.position_sigma_m)  # type: ignore[union-attr]
    assert config.lifecycle == usual.lifecycle


@pytest.mark.parametrize(
    ("name", "expected"), [("a/b.json", True), ("B.JSON", True), ("m:json", False), ("default", False)]
)
def test_names_of_profiles(name: str, expected: bool) -> None:
    assert is_profile(name) == expected


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"kind": "map"}, "no detector profile"),
        ({"version": 7}, "profile of version 7, this release reads 1"),
        ({"rate_hz": 0}, "rate_hz must be positive, got 0"),
        ({"rate_hz": "fast"}, "rate_hz must be positive, got 'fast'"),
        ({"name": 3}, "name must be a text"),
        ({"categories": {"tram": {"detections": 1, "reference_score": 0.5}}}, "category 'tram' is unknown"),
        (
            {"categories": {"car": {"detections": 1, "reference_score": 1.5}}},
            "reference_score must be over 0",
        ),
        (
            {"categories": {"car": {"detections": 1, "reference_score": 0.5, "position_sigma_m": -1}}},
            "positive",
        ),
        ({"categories": {"car": {"score": 1}}}, "score"),
        ({"categories": [1]}, "p.json"),
        ({"categories": {"car": 1}}, "p.json"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(change: dict[str, Any], told: str, tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    PROFILE.save(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ConfigError, match=r"p\.json: ") as error:
        DetectorProfile.load(path)
    assert told in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[1]", b"\xff\xfe", b'{"kind": "smartmot detector profile", "version": 1}']
)
def test_no_profile_at_all(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "p.json").write_bytes(content)
    with pytest.raises(ConfigError, match=r"p\.json: "):
        tracker_config(str(tmp_path / "p.json"))
    with pytest.raises(ConfigError, match=r"q\.json: No such file"):
        tracker_config(str(tmp_path / "q.json"))
