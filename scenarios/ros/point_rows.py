"""Points of sensor_msgs/PointCloud2 as rows with named fields, and the other way round.

Source: sensor_msgs/msg/PointCloud2.msg and PointField.msg (ros2/common_interfaces).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.reading import ReadError, shown

DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""NumPy's kinds of PointField's numbers."""

_MOST_COUNT = 100_000
"""Numbers of one field per point."""


@dataclass(frozen=True, slots=True, eq=False)
class CloudMessage:
    """Points of one message, not checked for NaN.

    Args:
        stamp_ns: time of the measurement; None: the header was empty.
        frame_id: frame of the points; "": the header did not name it.
        received_ns: when the message was received, which counts where there is no stamp.
        rows: (N,) structured array with the message's fields.
    """

    stamp_ns: int | None
    frame_id: str
    received_ns: int
    rows: NDArray[Any]

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def time_ns(self) -> int:
        """The stamp, or when the message was received."""
        return self.received_ns if self.stamp_ns is None else self.stamp_ns


def point_rows(message: Any) -> NDArray[Any]:
    """(N,) points of a PointCloud2, row after row of an organised one, without its padding.

    Raises:
        ReadError: fields lie outside a point, or there are fewer bytes than points.
    """
    dtype = _dtype(message)
    width, height, step = int(message.width), int(message.height), int(message.point_step)
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    if width == 0 or height == 0:
        return np.empty(0, dtype)
    row_step = int(message.row_step)
    if height == 1 and row_step == 0:  # some drivers leave it out
        row_step = width * step
    if row_step < width * step:
        raise ReadError(f"row_step {row_step} is less than {width} points of {step} bytes")
    needed = row_step * (height - 1) + width * step
    if len(data) < needed:
        raise ReadError(f"{len(data)} bytes of points, {needed} expected for {width} x {height}")
    if height == 1 or row_step == width * step:
        return np.frombuffer(data[: width * height * step].tobytes(), dtype)
    rows = [data[row * row_step : row * row_step + width * step] for row in range(height)]
    return np.frombuffer(np.concatenate(rows).tobytes(), dtype)


def _dtype(message: Any) -> np.dtype[Any]:
    """Layout of one point."""
    order = ">" if message.is_bigendian else "<"
    step = int(message.point_step)
    if step <= 0:
        raise ReadError(f"point_step {step}: expected at least 1 byte per point")
    names, formats, offsets = [], [], []
    for field in message.fields:
        name, kind, count = str(field.name), int(field.datatype), max(int(field.count), 1)
        if kind not in DATATYPES:
            raise ReadError(f"field {shown(name)}: datatype {kind} does not exist")
        if not name or name in names:
            raise ReadError(f"field {shown(name)}: no name, or the name of two fields")
        end = int(field.offset) + count * int(DATATYPES[kind][1])
        if count > _MOST_COUNT or end > step:
            raise ReadError(f"field {shown(name)} ends at byte {end}, point_step is {step}")
        names.append(name)
        formats.append((order + DATATYPES[kind], (count,)) if count > 1 else order + DATATYPES[kind])
        offsets.append(int(field.offset))
    layout: Any = {"names": names, "formats": formats, "offsets": offsets, "itemsize": step}
    dtype: np.dtype[Any] = np.dtype(layout)
    return dtype
