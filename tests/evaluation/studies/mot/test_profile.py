"""Profiles of detectors whose noise and scores are known."""

from pathlib import Path

import numpy as np
import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.mot.profile import profile_of, write_profile
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, Objects, Sequence


def _data(sigma_m: float, rate_hz: float, score: float, speed_mps: float, frames: int = 120) -> Dataset:
    """Ten objects of a category 20 m apart; the first five stand."""
    rng = np.random.default_rng(1)
    frame, which = (part.ravel() for part in np.meshgrid(np.arange(frames), np.arange(10), indexing="ij"))
    moving = np.where(which < 5, 0.0, speed_mps)
    center = np.column_stack((moving * frame / rate_hz, 20.0 * which))
    count = len(frame)
    detections = Objects.of(
        frame,
        center + rng.normal(0.0, sigma_m, (count, 2)),
        size_m=np.tile((4.5, 1.8), (count, 1)),
        yaw_rad=np.zeros(count),
        category=np.full(count, "car"),
        score=np.full(count, score),
    )
    sequence = Sequence("s", np.arange(frames) / rate_hz, tuple(map(str, range(frames))), detections)
    return Dataset("csv", (sequence,))


@pytest.mark.parametrize(("rate_hz", "speed_mps"), [(10.0, 12.0), (20.0, 5.0), (2.0, 8.0)])
@pytest.mark.parametrize("sigma_m", [0.05, 0.2])
def test_rate_score_and_noise_are_those_of_the_detector(
    sigma_m: float, rate_hz: float, speed_mps: float
) -> None:
    profile = profile_of(_data(sigma_m, rate_hz, 0.5, speed_mps), "mine")
    assert (profile.name, list(profile.categories)) == ("mine", ["car"])
    assert profile.rate_hz == pytest.approx(rate_hz)
    car = profile.categories["car"]
    assert car.detections == 1200
    assert car.reference_score == pytest.approx(0.5, rel=0.05)
    assert car.position_sigma_m == pytest.approx(sigma_m, rel=0.12)


def test_too_few_detections_tell_no_noise() -> None:
    assert profile_of(_data(0.1, 10.0, 0.5, 0.0, frames=5), "mine").categories["car"].position_sigma_m is None


def test_nothing_to_estimate_from(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="--profile: needs detections in two frames"):
        profile_of(_data(0.1, 10.0, 0.5, 0.0, frames=1), "mine")
    with pytest.raises(ArgumentError, match=r"--profile: .*p\.txt must end in \.json"):
        write_profile(_data(0.1, 10.0, 0.5, 0.0), tmp_path / "p.txt")
