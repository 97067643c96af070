"""Small recordings made by hand, and what makes a long session quick."""

import gc
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from scenarios.recorded.dataset import Camera, Objects, Sequence

collect_ignore = ["data"]
"""Files of users; tests/test_moved.py runs those that are tests."""

KITTI = Path(__file__).parents[1].parent / "shared" / "kitti"

Rows = list[tuple[int, int, float, float]]
MakeObjects = Callable[..., Objects]
MakeSequence = Callable[..., Sequence]


def pytest_collection_finish() -> None:
    """What has been collected stays: Python's collector of garbage need not look through it again."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _one_process() -> Iterator[None]:
    """Without `--workers`, work is done in this process: those of a pool import everything anew.

    Tests of several processes ask for them.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.sched_getaffinity", lambda _: {0}, raising=False)
        yield


@pytest.fixture
def kitti() -> Path:
    if not KITTI.is_dir():
        pytest.skip("KITTI data are not in ../shared/kitti")
    return KITTI


@pytest.fixture
def objects() -> MakeObjects:
    """Cars of 4 m x 2 m from rows of frame, identity, x and y; heading along x."""

    def make(rows: Rows, category: str = "car", **columns: object) -> Objects:
        table = np.array(rows, dtype=np.float64).reshape(-1, 4)
        count = len(table)
        given = {name: np.asarray(values) for name, values in columns.items()}
        return Objects.of(
            table[:, 0].astype(np.int64),
            table[:, 2:],
            **{
                "size_m": np.tile((4.0, 2.0), (count, 1)),
                "yaw_rad": np.zeros(count),
                "object_id": table[:, 1].astype(np.int64),
                "category": np.full(count, category),
                **given,
            },
        )

    return make


@pytest.fixture
def sequence(objects: MakeObjects) -> MakeSequence:
    """A sequence of some frames 0.1 s apart with labels."""

    def make(frames: int, labels: Objects | None, camera: Camera | None = None, **rest: object) -> Sequence:
        return Sequence(
            name="s",
            stamp_s=np.arange(frames) * 0.1,
            frame_name=tuple(map(str, range(frames))),
            detections=rest.pop("detections", Objects.empty()),  # type: ignore[arg-type]
            labels=labels,
            camera=camera,
            **rest,  # type: ignore[arg-type]
        )

    return make
