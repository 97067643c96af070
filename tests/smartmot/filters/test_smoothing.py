"""Rauch-Tung-Striebel smoothing against filterpy, and its laws."""

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from smartmot.filters.channels import ChannelFilter
from smartmot.filters.kalman import BevFilterConfig
from smartmot.filters.motion_models import ConstantAcceleration, ConstantVelocity, DecayingAcceleration
from smartmot.filters.smoothing import Smoother
from smartmot.types import FloatArray

MOTIONS = [ConstantVelocity(), ConstantAcceleration(), DecayingAcceleration()]
CAR = np.zeros(1, dtype=np.int64)


def _filtered(
    motion: Any, stamp_s: FloatArray, seed: int, flips: bool = False, stated: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Measurements (K, 5), and what the filter says after each: (K, D), (K, D, D)."""
    rng = np.random.default_rng(seed)
    filter_ = ChannelFilter(motion, BevFilterConfig())
    t = stamp_s - stamp_s[0]
    z = np.column_stack((5.0 * t, 2.0 * np.sin(t), np.full_like(t, 8.0), np.full_like(t, 2.5), 0.1 * t))
    z += rng.normal(0.0, 0.1, z.shape)
    if flips:
        z[1::2, 4] += np.pi
    means, spreads = [], []
    state = filter_.born(z[:1], None, CAR, stated)
    for k in range(len(t)):
        if k:
            state = filter_.predict(state, CAR, float(stamp_s[k] - stamp_s[k - 1]))
            state = filter_.update(state, z[k : k + 1], None, CAR, stated)
        mean, spread = filter_.moments(state)
        means.append(mean[0])
        spreads.append(spread[0])
    return z, np.array(means), np.array(spreads)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: type(motion).__name__)
@pytest.mark.parametrize("together", [False, True], ids=["independent", "shared noise"])
def test_equals_filterpys_smoother(motion: Any, together: bool) -> None:
    """With irregular times, and with noise that x and y share from the first measurement on."""
    stamp_s = np.cumsum(np.random.default_rng(0).uniform(0.05, 0.4, 30))
    stated = None
    if together:
        stated = np.zeros((1, 3, 3))
        stated[0] = [[0.2, 0.1, 0.0], [0.1, 0.3, 0.0], [0.0, 0.0, 0.01]]
    _, mean, covariance = _filtered(motion, stamp_s, 1, stated=stated)
    smoother = Smoother(motion, 0)
    smooth, spread = smoother.smoothed(stamp_s, mean, covariance, stamp_s)
    steps = [smoother.step(float(dt)) for dt in np.diff(stamp_s, prepend=stamp_s[0])]
    # filterpy carries k to k + 1 by what stands at k + 1
    expected, expected_spread, _, _ = KalmanFilter(dim_x=smoother.size, dim_z=2).rts_smoother(
        mean, covariance, Fs=[f for f, _ in steps], Qs=[q for _, q in steps]
    )
    np.testing.assert_allclose(smooth, expected, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(spread, expected_spread, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: type(motion).__name__)
def test_the_step_is_the_filters(motion: Any) -> None:
    """What the filter predicts from a state is what the smoother takes it for."""
    _, mean, covariance = _filtered(motion, np.arange(5) * 0.2, 2)
    filter_, smoother = ChannelFilter(motion, BevFilterConfig()), Smoother(motion, 0)
    state = filter_.born(np.array([[1.0, 2.0, 8.0, 2.0, 0.3]]), np.array([[3.0, 1.0]]), CAR)
    before, spread = filter_.moments(state)
    after, wider = filter_.moments(filter_.predict(state, CAR, 0.37))
    change, noise = smoother.step(0.37)
    np.testing.assert_allclose(change @ before[0], after[0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(change @ spread[0] @ change.T + noise, wider[0], rtol=1e-9, atol=1e-12)
    assert mean.shape[1] == smoother.size == covariance.shape[2]


def test_hindsight_is_never_less_sure_and_the_end_stays() -> None:
    stamp_s = np.arange(40) * 0.1
    _, mean, covariance = _filtered(ConstantVelocity(), stamp_s, 3)
    smooth, spread = Smoother(ConstantVelocity(), 0).smoothed(stamp_s, mean, covariance, stamp_s)
    variances = np.diagonal(spread, axis1=1, axis2=2)
    assert (variances <= np.diagonal(covariance, axis1=1, axis2=2) + 1e-12).all()
    np.testing.assert_array_equal(smooth[-1], mean[-1])
    true = np.column_stack((5.0 * stamp_s, 2.0 * np.sin(stamp_s)))
    errors = [np.linalg.norm(each[5:, :2] - true[5:], axis=1).mean() for each in (mean, smooth)]
    assert errors[1] < 0.8 * errors[0]


def test_a_gap_is_filled_by_both_ends() -> None:
    """Exact detections of a straight drive, 2 s of them missing: the smoothed track is the drive itself."""
    at_s = np.arange(60) * 0.1
    seen = (at_s < 2.0) | (at_s > 4.0)
    filter_ = ChannelFilter(ConstantVelocity(), BevFilterConfig())
    means, spreads, last = [], [], None
    state = np.zeros((1, 25))
    for t in at_s[seen].tolist():
        z = np.array([[8.0 * t, 3.0, 8.0, 2.5, 0.0]])
        if last is None:
            state = filter_.born(z, np.array([[8.0, 0.0]]), CAR)
        else:
            state = filter_.update(filter_.predict(state, CAR, t - last), z, None, CAR)
        last = t
        mean, spread = filter_.moments(state)
        means.append(mean[0])
        spreads.append(spread[0])
    smooth, spread = Smoother(ConstantVelocity(), 0).smoothed(
        at_s[seen], np.array(means), np.array(spreads), at_s
    )
    np.testing.assert_allclose(smooth[:, 0], 8.0 * at_s, atol=0.02)
    np.testing.assert_allclose(smooth[:, 1], 3.0, atol=1e-9)
    # surest at the ends of the gap, least sure in its middle
    variance = spread[20:41, 0, 0]
    assert 8 <= int(variance.argmax()) <= 12


def test_headings_follow_the_last_one() -> None:
    """Front and rear are confused in every second detection; the last state decides for the whole track."""
    stamp_s = np.arange(21) * 0.1
    _, mean, covariance = _filtered(ConstantVelocity(), stamp_s, 4, flips=True)
    turned = mean.copy()
    turned[::3, 4] += np.pi  # a state that faced the other way for a frame
    smooth, _ = Smoother(ConstantVelocity(), 0).smoothed(stamp_s, mean, covariance, stamp_s)
    same, _ = Smoother(ConstantVelocity(), 0).smoothed(stamp_s, turned, covariance, stamp_s)
    assert (np.cos(smooth[:, 4] - smooth[-1, 4]) > 0.9).all()
    np.testing.assert_allclose(
        np.cos(same[:, 4] - same[-1, 4]), np.cos(smooth[:, 4] - smooth[-1, 4]), atol=1e-9
    )
