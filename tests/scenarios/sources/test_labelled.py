"""Labels that stand in for detections: with the sensor's errors, after its latency."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.errors import DatasetError, ScenarioError
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.poses import rigid, turned_about
from scenarios.sensors.boxes import SensorConfig
from scenarios.sensors.sensor import box_chain
from scenarios.sources import Frame, frames
from scenarios.sources.labelled import LabelledSource
from scenarios.sources.recorded import END_OF_RECORDING, RecordedSource

EXACT = SensorConfig(range_m=50.0, position_sigma_m=0.0, rate_hz=10.0)


def recording(count: int, interval_s: float = 0.1) -> Sequence:
    """An ego at 10 m/s along x; object 5 is labelled from frame 1 on, object 9 is out of range."""
    time_s = interval_s * np.arange(count)
    place = np.column_stack((10.0 * time_s, np.zeros((count, 2))))
    frame = np.repeat(np.arange(1, count), 2)
    labels = Objects.of(
        frame,
        np.tile([(30.0, 2.0), (500.0, 0.0)], (count - 1, 1)),
        object_id=np.tile([5, 9], count - 1),
        size_m=np.tile((0.6, 0.5), (len(frame), 1)),
        yaw_rad=np.zeros(len(frame)),
        category=np.full(len(frame), "pedestrian"),
    )
    names = tuple(map(str, range(count)))
    poses = rigid(turned_about(2, np.zeros(count)), place)
    return Sequence("s", time_s, names, Objects.empty(), labels, poses)


def seen(sequence: Sequence, sensor: SensorConfig, seed: int = 0) -> list[Frame]:
    source = LabelledSource(sequence, [box_chain(sensor, seed)], RecordedSource(sequence, hindsight_s=2.0))
    return list(frames(source))


def test_an_exact_sensor_sees_the_labels_in_its_range() -> None:
    shown = seen(recording(5), EXACT)
    assert [len(frame.detections) for frame in shown] == [0, 1, 1, 1, 1]
    for frame in shown:
        assert frame.detections.stamp_s == frame.stamp_s == frame.ego.stamp_s
        assert frame.path is shown[0].path
    assert shown[1].detections.boxes.center_m == pytest.approx(np.array([[30.0, 2.0]]))
    assert shown[1].detections.category.tolist() == ["pedestrian"]


@pytest.mark.parametrize(("latency_s", "left"), [(0.1, 4), (0.2, 3), (0.05, 4), (0.5, 0)])
def test_detections_arrive_after_the_latency(latency_s: float, left: int) -> None:
    shown = seen(recording(5), replace(EXACT, latency_s=latency_s))
    assert len(shown) == left
    for k, frame in enumerate(shown):
        assert frame.detections.stamp_s == pytest.approx(0.1 * k)
        assert frame.ego.stamp_s == frame.stamp_s == pytest.approx(0.1 * k + latency_s)
        assert frame.ego.x_m == pytest.approx(10.0 * frame.stamp_s)
        assert frame.ego.speed_mps == pytest.approx(10.0)


def test_errors_are_those_of_the_seed() -> None:
    noisy = replace(EXACT, position_sigma_m=0.2)
    of_seed = [seen(recording(5), noisy, seed)[3].detections.boxes.center_m for seed in (1, 1, 2)]
    assert np.array_equal(of_seed[0], of_seed[1])
    assert not np.array_equal(of_seed[0], of_seed[2])
    assert 0.0 < np.abs(of_seed[0] - (30.0, 2.0)).max() < 2.0


def test_the_end_and_what_is_refused() -> None:
    sequence = recording(3)
    source = LabelledSource(sequence, [box_chain(EXACT, 0)], RecordedSource(sequence))
    with pytest.raises(ScenarioError, match="not started"):
        source.step(None)
    result = source.start()
    with pytest.raises(ScenarioError, match="already started"):
        source.start()
    while result.frame is not None:
        result = source.step(None)
    assert result.end_reason == END_OF_RECORDING
    with pytest.raises(ScenarioError, match="at its end"):
        source.step(None)
    with pytest.raises(DatasetError, match="sequence s has no labels"):
        LabelledSource(replace(sequence, labels=None), [box_chain(EXACT, 0)], RecordedSource(sequence))
