import numpy as np
import pytest

from smartmot.errors import ShapeError, SmartMotError
from smartmot.types import Boxes, Detections, Forecast, Threats, Tracks


def _boxes(n: int) -> Boxes:
    return Boxes(np.arange(2.0 * n).reshape(n, 2), np.ones((n, 2)), np.zeros(n))


def _tracks(n: int) -> Tracks:
    zeros, flags = np.zeros(n), np.ones(n, dtype=bool)
    return Tracks(
        0.0, np.arange(n), _boxes(n), np.array(["car"] * n), zeros, np.zeros((n, 9)), np.zeros((n, 9, 9)),
        np.zeros((n, 2)), zeros, zeros, zeros, flags, flags,
    )  # fmt: skip


def test_arrays_are_copied_and_read_only() -> None:
    source = np.zeros((3, 2))
    boxes = Boxes(source, np.ones((3, 2)), np.zeros(3))
    source[0] = 7.0
    assert boxes.center_m[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        boxes.center_m[0] = 1.0


@pytest.mark.parametrize(
    ("center", "size", "yaw", "message"),
    [
        ([[0.0]], [[1.0, 1.0]], [0.0], "center_m: expected shape"),
        ([[0.0, 0.0]], [[1.0, 1.0]] * 2, [0.0], "size_m: expected shape"),
        ([[0.0, 0.0]], [[1.0, 1.0]], [0.0, 1.0], "yaw_rad: expected shape"),
        ([[0.0, 0.0]], [[1.0, 0.0]], [0.0], "must be positive"),
        ([[0.0, np.nan]], [[1.0, 1.0]], [0.0], "finite"),
        ([["a", "b"]], [[1.0, 1.0]], [0.0], "expected numbers"),
    ],
)
def test_boxes_reject(center: object, size: object, yaw: object, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        Boxes(center, size, yaw)  # type: ignore[arg-type]


def test_named_errors_are_value_errors() -> None:
    assert issubclass(ShapeError, SmartMotError)
    assert issubclass(SmartMotError, ValueError)


def test_subsets_and_lengths() -> None:
    tracks = _tracks(4)
    assert len(tracks[np.array([True, False, True, False])]) == 2
    assert tracks[1:].track_id.tolist() == [1, 2, 3]
    detections = Detections(0.0, _boxes(3), np.ones(3), np.array(["car", "truck", "car"]))
    assert detections[np.array([2, 1])].category.tolist() == ["car", "truck"]
    assert len(Boxes.empty()) == len(Detections.empty(1.0)) == 0


@pytest.mark.parametrize("category", [["car"], ["car", "tram"]])
def test_detections_reject_wrong_categories(category: list[str]) -> None:
    with pytest.raises(ShapeError, match="category: expected 2 names"):
        Detections(0.0, _boxes(2), np.ones(2), np.array(category))


def test_forecast_and_threats_check_their_shapes() -> None:
    with pytest.raises(ShapeError, match="center_m"):
        Forecast(np.zeros(2), np.zeros((1, 3, 2)), np.zeros((1, 2)), np.ones((1, 2)), np.ones((1, 2)) > 0)
    with pytest.raises(ShapeError, match="gap_m"):
        Threats(np.array([1]), np.zeros(1), np.zeros(2), np.zeros(1))
    assert len(Threats(np.array([1]), np.zeros(1), np.zeros(1), np.zeros(1))) == 1
