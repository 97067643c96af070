from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from scenarios.reading import ReadError
from scenarios.recorded.clouds.fields import cloud_from_rows
from scenarios.ros.point_rows import point_rows


def message(rows: np.ndarray[Any, Any], height: int = 1, padding: int = 0, **changes: Any) -> SimpleNamespace:
    codes = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
    fields = [
        SimpleNamespace(name=name, offset=offset, datatype=codes[kind.str[1:]], count=1)
        for name, (kind, offset, *_) in rows.dtype.fields.items()  # type: ignore[union-attr]
    ]
    width, step = len(rows) // height, rows.dtype.itemsize
    lines = [rows[k * width : (k + 1) * width].tobytes() + bytes(padding) for k in range(height)]
    values = {
        "fields": fields, "width": width, "height": height, "point_step": step,
        "row_step": width * step + padding,
        "is_bigendian": rows.dtype[0].str[0] == ">", "data": b"".join(lines),
    }  # fmt: skip
    return SimpleNamespace(**{**values, **changes})


def velodyne(order: str = "<", count: int = 6) -> np.ndarray[Any, Any]:
    layout = {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": [f"{order}{kind}" for kind in ("f4", "f4", "f4", "f4", "u2", "f4")],
        "offsets": [0, 4, 8, 16, 20, 24],
        "itemsize": 32,
    }
    rows = np.zeros(count, dtype=np.dtype(layout))  # type: ignore[call-overload]
    for k, name in enumerate(layout["names"]):
        rows[name] = np.arange(count) + 10 * k
    return rows


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize(("height", "padding"), [(1, 0), (2, 0), (3, 8)])
def test_any_byte_order_and_layout_is_read(order: str, height: int, padding: int) -> None:
    cloud = cloud_from_rows(point_rows(message(velodyne(order), height, padding)), "a").cloud
    assert cloud.xyz_m.tolist() == [[k, 10.0 + k, 20.0 + k] for k in range(6)]
    assert cloud.xyz_m.dtype == np.float32
    assert cloud.ring is not None
    assert cloud.ring.tolist() == [40, 41, 42, 43, 44, 45]
    assert cloud.time_offset_s is not None
    assert cloud.time_offset_s.tolist() == [50, 51, 52, 53, 54, 55]


def test_organised_clouds_lose_their_empty_cells_and_say_so() -> None:
    rows = velodyne()
    rows["x"][2] = np.nan
    named = cloud_from_rows(point_rows(message(rows, height=2)), "a")
    assert len(named.cloud) == 5
    assert named.dropped == 1


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"data": b"123"}, "3 bytes of points"),
        ({"row_step": 5}, "row_step 5"),
        ({"point_step": 0}, "point_step 0"),
        ({"point_step": 20}, "ends at byte"),
        ({"fields": [SimpleNamespace(name="x", offset=0, datatype=9, count=1)]}, "datatype 9"),
        ({"fields": [SimpleNamespace(name="x", offset=2**31, datatype=7, count=1)]}, "ends at byte"),
        ({"fields": [SimpleNamespace(name="x", offset=0, datatype=7, count=2**31)]}, "ends at byte"),
        ({"fields": [SimpleNamespace(name="x", offset=0, datatype=7, count=1)] * 2}, "two fields"),
    ],
)
def test_damaged_messages_are_refused(changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ReadError, match=reason):
        point_rows(message(velodyne(), **changes))


def test_times_of_drivers_become_offsets() -> None:
    def offsets(kind: str, values: list[float], name: str) -> tuple[list[float], float | None]:
        rows = np.zeros(2, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4"), (name, kind)])
        rows[name] = values
        cloud = cloud_from_rows(rows, "a").cloud
        assert cloud.time_offset_s is not None
        return cloud.time_offset_s.tolist(), cloud.stamp_s

    assert offsets("u4", [0, 50_000_000], "t") == ([0.0, 0.05], None)  # Ouster, ns
    assert offsets("f8", [1.6e9, 1.6e9 + 0.5], "timestamp") == ([0.0, 0.5], 1.6e9)  # Hesai, s
    assert offsets("f8", [1.6e18, 1.6e18 + 2**28], "timestamp") == ([0.0, 2**28 * 1e-9], 1.6e9)  # Livox, ns
