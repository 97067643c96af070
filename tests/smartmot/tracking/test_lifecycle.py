import numpy as np
import pytest

from smartmot.errors import ConfigError
from smartmot.filters.motion_models import PerCategory
from smartmot.tracking.lifecycle import Lifecycle, LifecycleConfig


@pytest.mark.parametrize(
    ("coasted_s", "outside_s", "alive"),
    [(0.0, 0.0, True), (0.15, 0.0, True), (3 * 0.05, 3 * 0.05, True), (0.16, 0.0, False), (0.0, 0.2, False)],
)
def test_a_track_survives_max_age_and_no_longer(coasted_s: float, outside_s: float, alive: bool) -> None:
    rules = Lifecycle(LifecycleConfig())
    found = rules.survives(np.array([True]), np.array([coasted_s]), np.array([outside_s]), np.zeros(1, int))
    assert found.tolist() == [alive]


def test_three_frames_survive_at_epoch_stamps() -> None:
    start = 1.7e9 + 0.123456
    stamp = start + 0.05 + 0.05 + 0.05
    coasted = np.array([stamp - start])
    rules = Lifecycle(LifecycleConfig())
    assert rules.survives(np.array([True]), coasted, np.zeros(1), np.zeros(1, int)).all()


def test_a_long_pause_ends_what_may_not_live_that_long() -> None:
    rules = Lifecycle(LifecycleConfig(max_age_s=PerCategory.grouped(0.5, 5.0, 0.5)))
    code = np.array([0, 1])
    assert rules.bridges(2.0, code).tolist() == [True, True]
    assert rules.bridges(2.1, code).tolist() == [False, True]
    assert rules.bridges(5.1, code).tolist() == [False, False]


def test_tentative_tracks_may_die_sooner_and_categories_differ() -> None:
    rules = Lifecycle(LifecycleConfig(max_age_s=PerCategory.grouped(0.5, 1.0, 0.5), tentative_max_age_s=0.0))
    confirmed, code = np.array([True, True, False, False]), np.array([0, 1, 0, 0])
    coasted = np.array([0.8, 0.8, 0.1, 0.0])
    assert rules.survives(confirmed, coasted, np.zeros(4), code).tolist() == [False, True, False, True]


def test_confirmation_waits_for_a_match_at_the_age_and_stays() -> None:
    later, at_once = Lifecycle(LifecycleConfig(confirm_s=0.1)), Lifecycle(LifecycleConfig())
    before = np.array([False, False, False, True])
    age, coasted = np.array([0.05, 0.1, 0.2, 0.3]), np.array([0.0, 0.0, 0.05, 0.1])
    code = np.zeros(4, int)
    assert later.confirm(before, age, coasted, code).tolist() == [False, True, False, True]
    assert at_once.confirm(before, age, coasted, code).tolist() == [True, True, False, True]


@pytest.mark.parametrize("name", ["confirm_s", "max_age_s"])
@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_rejects_impossible_times(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"LifecycleConfig.{name}: allowed 0 to inf"):
        LifecycleConfig(**{name: value})
