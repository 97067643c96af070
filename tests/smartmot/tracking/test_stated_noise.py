"""Gates, costs and tracks by the noise that each detection states."""

from dataclasses import replace
from math import log

import numpy as np
import pytest

from smartmot import Boxes, Detections, ShapeError, Tracker, TrackerConfig, tracker_config
from smartmot.detection_input import detections_from_arrays, to_map
from smartmot.filters.motion_models import ConstantTurnRate
from smartmot.tracking.association import AssociationConfig
from smartmot.types import FloatArray

SIZE = (0.6, 0.6)


def _noise(*sigmas: tuple[float, float], correlation: float = 0.0) -> FloatArray:
    stated = np.full((len(sigmas), 3, 3), np.nan)
    for row, (x, y) in zip(stated, sigmas, strict=True):
        row[:2, :2] = [[x * x, correlation * x * y], [correlation * x * y, y * y]]
    return stated


def _step(
    tracker: Tracker, stamp_s: float, center: list[list[float]], noise: FloatArray | None = None
) -> list[int]:
    n = len(center)
    tracks = tracker.update_arrays(
        stamp_s, center, [SIZE] * n, [0.0] * n, [0.9] * n, ["pedestrian"] * n, pose_covariance=noise
    )
    return tracks.track_id.tolist()


def _gated(speed_change_mps: float = 0.0) -> TrackerConfig:
    """Only the chi-square gate: no sudden changes of speed, no cap, nothing found again otherwise."""
    config = tracker_config("default")
    association = AssociationConfig(speed_change_mps=speed_change_mps, widest_gate_m=100.0)
    return replace(config, association=association, merge_duplicates=False)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_the_gate_ends_where_chi_square_says(axis: int, share: float) -> None:
    """A new pedestrian (initial velocity 2 m/s, noise 0.2 m) and a detection with its own ellipse.

    S = P + R along the axis, with P = r0 + 4 dt2 + q dt3 / 3 + p dt; at its ends d2 is -2 ln(1 - 0.999).
    """
    tracker, dt = Tracker(_gated()), 0.1
    _step(tracker, 0.0, [[0.0, 0.0]])
    predicted = tracker._filter.predict(tracker.state.filtered, np.array([1]), dt)
    variance = tracker._filter.position_covariance(predicted)[axis][0]
    sigmas = (3.0, 0.5) if axis == 0 else (0.5, 3.0)
    reach_m = np.sqrt(-2.0 * log(1e-3) * (variance + 9.0))
    center = [0.0, 0.0]
    center[axis] = share * float(reach_m)
    assert _step(tracker, dt, [center], _noise(sigmas)) == ([1] if share < 1.0 else [1, 2])


def test_the_gate_is_an_ellipse() -> None:
    """As far as the sure axis allows and no farther, although the other axis would."""
    for center, expected in (([8.0, 0.0], [1]), ([0.0, 8.0], [1, 2])):
        tracker = Tracker(_gated())
        _step(tracker, 0.0, [[0.0, 0.0]])
        assert _step(tracker, 0.1, [center], _noise((3.0, 0.3))) == expected


def test_the_configured_noise_stated_changes_nothing() -> None:
    rng = np.random.default_rng(6)
    config = tracker_config("default")
    plain, stated = Tracker(config), Tracker(config)
    sigma = 0.2
    for k in range(40):
        center = (
            np.array([[0.14 * k, 0.0], [0.14 * k, 2.0], [9.0, 9.0]]) + rng.normal(0, 0.2, (3, 2))
        ).tolist()
        assert _step(plain, 0.1 * k, center) == _step(stated, 0.1 * k, center, _noise(*[(sigma, sigma)] * 3))
    np.testing.assert_allclose(stated.state.filtered, plain.state.filtered, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("motion", [None, ConstantTurnRate()], ids=["linear", "turn"])
def test_a_sure_detection_moves_a_track_and_an_unsure_one_hardly(motion: ConstantTurnRate | None) -> None:
    config = tracker_config("default")
    config = config if motion is None else replace(config, motion=motion)
    ends = {}
    for sigma in (0.01, 3.0):
        tracker = Tracker(config)
        for k in range(20):
            _step(tracker, 0.1 * k, [[0.0, 0.0]])
        _step(tracker, 2.0, [[0.5, 0.0]], _noise((sigma, sigma), correlation=0.3))
        ends[sigma] = float(tracker._filter.estimate(tracker.state.filtered).center_m[0, 0])
    assert ends[0.01] > 0.45
    assert abs(ends[3.0]) < 0.01


def test_mahalanobis_cost_takes_the_stated_noise() -> None:
    """Two detections of one track: the farther one is nearer in its own standard deviations."""
    association = AssociationConfig(cost="mahalanobis", speed_change_mps=0.0, widest_gate_m=100.0)
    config = replace(tracker_config("default"), association=association, merge_duplicates=False)
    tracker = Tracker(config)
    for k in range(30):
        _step(tracker, 0.1 * k, [[0.0, 0.0]])
    _step(tracker, 3.0, [[0.5, 0.0], [0.0, 0.9]], _noise((0.1, 0.1), (0.1, 3.0)))
    assert tracker.state.track_id.tolist() == [1, 2]
    center = tracker._filter.estimate(tracker.state.filtered).center_m
    np.testing.assert_allclose(center[1], [0.5, 0.0], atol=1e-9)  # the near one is the new track


def test_a_state_with_shared_noise_is_saved_and_goes_on(tmp_path: object) -> None:
    from pathlib import Path

    tracker = Tracker(tracker_config("default"))
    for k in range(5):
        _step(tracker, 0.1 * k, [[0.1 * k, 0.0]], _noise((0.3, 0.1), correlation=0.5) if k == 2 else None)
    path = Path(str(tmp_path)) / "state.npz"
    tracker.state.save(path)
    again = Tracker(tracker_config("default"))
    again.state = type(tracker.state).load(path)
    for each in (tracker, again):
        _step(each, 0.5, [[0.5, 0.0]])
    np.testing.assert_array_equal(tracker.state.filtered, again.state.filtered)
    assert tracker.state.filtered.shape[1] == 54  # five channels of nine, and 3 x 3 that x and y share


BOX = ([[0.0, 0.0]], [SIZE], [0.0])


@pytest.mark.parametrize(
    "covariance",
    [np.zeros((3, 3)), np.full((3, 3), np.nan), -np.eye(3), np.full((3, 3), 1.0), np.diag([1e-12, 1.0, 1.0])],
    ids=["zeros", "nan", "negative", "singular", "too small"],
)
def test_a_matrix_that_is_no_covariance_states_no_position(covariance: FloatArray) -> None:
    detections, dropped = detections_from_arrays(0.0, *BOX, pose_covariance=covariance[None])
    assert dropped == 0
    assert detections.pose_covariance is not None
    assert np.isnan(detections.pose_covariance[0, :2, :2]).all()
    assert np.isnan(detections.pose_covariance[0, 2, 2]) == (not covariance[2, 2] > 0.0)


def test_a_position_alone_may_be_stated() -> None:
    detections, _ = detections_from_arrays(0.0, *BOX, pose_covariance=[[[4.0, 1.0], [1.0, 2.0]]])
    stated = detections.pose_covariance
    assert stated is not None
    np.testing.assert_array_equal(stated[0], [[4.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, np.nan]])


def test_rows_of_another_shape_and_matrices_that_are_none_are_refused() -> None:
    with pytest.raises(ShapeError, match="pose_covariance"):
        detections_from_arrays(0.0, *BOX, pose_covariance=[[1.0, 1.0]])
    boxes = Boxes(np.zeros((1, 2)), np.ones((1, 2)), np.zeros(1))
    for wrong in (
        np.zeros((1, 3, 3)),
        np.full((1, 3, 3), np.inf),
        np.array([[[1.0, 2, 0], [2, 1, 0], [0, 0, 1]]]),
    ):
        with pytest.raises(ShapeError, match="positive definite"):
            Detections(0.0, boxes, np.ones(1), np.array(["car"]), pose_covariance=wrong)


def test_the_vehicle_turns_noise_with_the_boxes() -> None:
    """2 m ahead, 0.5 m to the left; the vehicle looks along 30 degrees."""
    detections, _ = detections_from_arrays(0.0, *BOX, pose_covariance=_noise((2.0, 0.5)))
    turned = to_map(detections, 1.0, 2.0, np.pi / 6).pose_covariance
    assert turned is not None
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    rotation = np.array([[c, -s], [s, c]])
    np.testing.assert_allclose(turned[0, :2, :2], rotation @ np.diag([4.0, 0.25]) @ rotation.T, rtol=1e-12)
    subset = detections[np.array([True])].pose_covariance
    assert subset is not None
    assert subset.shape == (1, 3, 3)


@pytest.mark.parametrize("entry", [(0, 0), (1, 1)])
def test_a_position_of_which_a_part_is_stated_is_not_stated(entry: tuple[int, int]) -> None:
    noise = np.diag([0.04, 0.04, 0.01])[None].copy()
    noise[0, entry[0], entry[1]] = np.nan
    box = Boxes(np.array([[10.0, 0.0]]), np.array([[4.0, 1.8]]), np.zeros(1))
    frame = Detections(0.0, box, np.ones(1), np.array(["car"]), pose_covariance=noise)
    assert frame.pose_covariance is not None
    assert np.isnan(frame.pose_covariance[0, :2, :2]).all()
    assert frame.pose_covariance[0, 2, 2] == 0.01
    tracker = Tracker(tracker_config("default"))
    for k in range(5):
        tracks = tracker.update(replace(frame, stamp_s=0.1 * k))
    assert tracks.track_id.tolist() == [1]
    assert np.isfinite(tracks.mean).all()
