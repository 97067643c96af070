"""The area that adapts: probabilities against sampled motion, Bayes' rule, a rigid motion, and the map."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from opendrive import RoadNetwork, load_map
from scenarios.catalogue.maps import shipped_map
from smartmot.area import AdaptiveArea, AdaptiveAreaConfig, reaching
from smartmot.area.adaptive import entering
from smartmot.area.localised import Alignment, LocalisedArea
from smartmot.errors import ConfigError
from smartmot.forecast.uncertain import UncertainMotion
from smartmot.path import PlannedPath
from smartmot.types import BoolArray, EgoState

TIME_S = np.arange(0.0, 3.05, 0.1)
EGO = EgoState(stamp_s=0.0, x_m=0.0, y_m=0.0, yaw_rad=0.0, speed_mps=10.0, yaw_rate_radps=0.0)
PATH = PlannedPath.through([[0.0, 0.0], [100.0, 0.0]])
SURE_TO_GO = AdaptiveAreaConfig(entering=1.0, over_kerb=1.0)


def motion(
    y_m: float,
    vy_mps: float,
    sigma_mps: float,
    *,
    x_m: float = 25.0,
    vx_mps: float = 0.0,
    turn_rad2ps2: float = 0.0,
    place_m2: float = 0.0,
    category: str = "pedestrian",
) -> UncertainMotion:
    """One object of 0.5 m by 0.5 m that goes straight on, with a normal error of its velocity."""
    velocity = np.array([[vx_mps, vy_mps]])
    center = np.array([[x_m, y_m]])[:, None] + velocity[:, None] * TIME_S[:, None]
    spread = place_m2 + sigma_mps**2 * TIME_S**2
    return UncertainMotion(
        TIME_S,
        center,
        np.zeros((1, len(TIME_S))),
        np.array([[0.5, 0.5]]),
        np.array([category]),
        velocity,
        spread[None, :, None, None] * np.eye(2),
        sigma_mps**2 * np.eye(2)[None],
        np.array([turn_rad2ps2]),
    )


def counted(
    seen: UncertainMotion, config: AdaptiveAreaConfig, lane_map: RoadNetwork | None = None
) -> BoolArray:
    answer = reaching(AdaptiveArea(lane_map, config).at(EGO, PATH), lambda: seen)
    assert answer is not None
    return answer


@pytest.mark.parametrize(
    ("y_m", "vy_mps", "sigma_mps"),
    [(4.0, -1.0, 0.3), (4.0, -0.8, 0.5), (-3.0, 0.5, 0.4), (6.0, -1.3, 0.5), (2.0, 0.2, 0.6)],
)
def test_an_object_counts_by_the_share_of_motions_that_reach_the_path(
    y_m: float, vy_mps: float, sigma_mps: float
) -> None:
    """Velocities are drawn; who is within the ego's half width and its own at any time has reached it."""
    drawn = vy_mps + sigma_mps * np.random.default_rng(1).standard_normal(200_000)
    places = y_m + drawn[:, None] * TIME_S[[0, -1]]
    border = EGO.width_m / 2 + 0.25
    share = float((places * math.copysign(1.0, y_m) <= border).any(axis=1).mean())
    assert 0.02 < share < 0.98
    seen = motion(y_m, vy_mps, sigma_mps)
    assert counted(seen, replace(SURE_TO_GO, probability=share - 0.01)).tolist() == [True]
    assert counted(seen, replace(SURE_TO_GO, probability=share + 0.01)).tolist() == [False]


def test_a_turn_rate_that_is_not_known_takes_an_object_off_its_course() -> None:
    """Of a speed v and a turn rate drawn around 0, the way aside is v w t^2 / 2 while angles are small."""
    sigma, speed = 0.02, 8.0
    seen = motion(2.0, 0.0, 0.0, vx_mps=speed, turn_rad2ps2=sigma**2)
    aside = speed * sigma * np.random.default_rng(2).standard_normal(200_000) * TIME_S[-1] ** 2 / 2
    share = float((2.0 + aside <= EGO.width_m / 2 + 0.25).mean())
    assert counted(seen, replace(SURE_TO_GO, probability=share - 0.01)).tolist() == [True]
    assert counted(seen, replace(SURE_TO_GO, probability=share + 0.01)).tolist() == [False]
    along = seen.sigma_m(np.broadcast_to([1.0, 0.0], (1, len(TIME_S), 2)))
    np.testing.assert_allclose(along, 0.0, atol=1e-12)


@given(
    before=st.floats(0.01, 0.99),
    moved_m=st.floats(0.01, 5.0),
    noise_m=st.floats(0.2, 5.0),
    across_m=st.floats(0.1, 5.0),
)
def test_evidence_is_weighed_by_the_rule_of_bayes(
    before: float, moved_m: float, noise_m: float, across_m: float
) -> None:
    goes = before * norm.pdf(moved_m, scale=math.hypot(noise_m, across_m))
    stays = (1.0 - before) * norm.pdf(moved_m, scale=noise_m)
    columns = (np.array([x]) for x in (before, moved_m, noise_m, across_m))
    assert entering(*columns)[0] == pytest.approx(goes / (goes + stays), rel=1e-9)


def test_who_walks_is_not_taken_for_noise_and_who_goes_away_does_not_go_to_the_path() -> None:
    columns = (np.array(x) for x in ([0.1, 0.1], [4.0, -4.0], [0.01, 0.01], [4.0, 4.0]))
    np.testing.assert_allclose(entering(*columns), [1.0, 0.0], atol=1e-12)


@given(
    x_m=st.floats(-500.0, 500.0),
    y_m=st.floats(-500.0, 500.0),
    yaw_rad=st.floats(-3.1, 3.1),
    vy_mps=st.floats(-2.0, 0.5),
    probability=st.sampled_from([0.1, 0.3, 0.5, 0.7, 0.9]),
)
def test_the_answer_is_the_same_in_every_frame_of_coordinates(
    x_m: float, y_m: float, yaw_rad: float, vy_mps: float, probability: float
) -> None:
    seen = motion(4.0, vy_mps, 0.37, vx_mps=1.0, place_m2=0.04, turn_rad2ps2=0.01)
    config = AdaptiveAreaConfig(probability)
    moved_ego = replace(EGO, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
    there = Alignment(EGO, moved_ego)
    area = LocalisedArea(AdaptiveArea(None, config).at(moved_ego, there.path(PATH)), there)
    answer = reaching(area, lambda: seen)
    assert answer is not None
    assert answer.tolist() == counted(seen, config).tolist()


@pytest.fixture(scope="module")
def street() -> RoadNetwork:
    """A straight street along x: lanes of 3.5 m to both sides of y = 0, sidewalks of 2.5 m beside them."""
    return load_map(shipped_map("urban_street"))


def probability(seen: UncertainMotion, lane_map: RoadNetwork | None) -> float:
    """The greatest setting with which the object counts, between 0.001 and 0.999."""
    low, high = 0.0, 1.0
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        ego = replace(EGO, y_m=-1.75)
        area = AdaptiveArea(lane_map, AdaptiveAreaConfig(middle)).at(
            ego, PlannedPath.through([[0.0, -1.75], [100.0, -1.75]])
        )
        answer = reaching(area, lambda: seen)
        assert answer is not None
        low, high = (middle, high) if answer[0] else (low, middle)
    return low


@pytest.mark.parametrize(("vy_mps", "sigma_mps"), [(0.6, 0.3), (0.7, 0.25), (0.8, 0.4)])
def test_a_kerb_is_evidence_by_the_odds_that_it_sets(
    street: RoadNetwork, vy_mps: float, sigma_mps: float
) -> None:
    """In the middle of the sidewalk: 3 m from the path, and so far from its borders that no error matters."""
    seen, last = motion(-4.75, vy_mps, sigma_mps), TIME_S[-1]
    reach = norm.cdf((vy_mps * last - (3.0 - EGO.width_m / 2 - 0.25)) / (sigma_mps * last))
    walks = norm.pdf(vy_mps, scale=math.hypot(sigma_mps, 1.34))
    stays = norm.pdf(vy_mps, scale=sigma_mps)
    for lane_map, odds in ((None, 1.0), (street, 0.1 / 0.9)):
        share = odds * walks / (odds * walks + stays)
        assert probability(seen, lane_map) == pytest.approx(reach * share, abs=1e-3)


def test_a_kerb_is_no_fence(street: RoadNetwork) -> None:
    """Who is seen to walk counts on either side of it; who stands does not, however near."""
    assert probability(motion(-4.75, 1.34, 0.15), street) > 0.99
    assert probability(motion(-3.6, 0.0, 0.15), street) < 0.01


def test_a_kerb_that_may_be_elsewhere_is_half_the_evidence(street: RoadNetwork) -> None:
    """On the border of the sidewalk the odds are those of even shares of both places."""
    for y_m, before in ((-4.2, 0.1), (-3.5, 0.3)):
        share = entering(*(np.array([x]) for x in (before, 0.9, 0.45, 1.34 * 3.0)))[0]
        free_m = abs(y_m + 1.75) - EGO.width_m / 2 - 0.25
        reach = norm.cdf((0.9 - free_m) / 0.45)
        assert probability(motion(y_m, 0.3, 0.15), street) == pytest.approx(reach * share, abs=1e-3)


def test_vehicles_in_lanes_of_their_own_are_taken_to_stay_there(street: RoadNetwork) -> None:
    """Oncoming on the other lane, with a turn rate that may be noise; the ego's own lane binds nobody."""
    seen = motion(1.75, -0.5, 0.3, vx_mps=-8.0, category="car")
    assert probability(seen, street) < probability(seen, None)
    in_the_way = motion(-1.75, 0.0, 0.3, category="car", place_m2=0.01)
    assert probability(in_the_way, street) == pytest.approx(probability(in_the_way, None))
    assert probability(in_the_way, street) > 0.99


@pytest.mark.parametrize(
    "wrong",
    [
        {"probability": 1.0},
        {"probability": -0.1},
        {"entering": 0.0},
        {"over_kerb": 1.5},
        {"map_sigma_m": 0.0},
    ],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        AdaptiveAreaConfig(**wrong)
