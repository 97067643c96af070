"""Labels and detections of many frames, and which of them are in the same one."""

from __future__ import annotations

import numpy as np

from smartmot.types import FloatArray, IntArray, StrArray


def frame_pairs(a_frame: StrArray, b_frame: StrArray) -> tuple[IntArray, IntArray]:
    """Every pair of a row of a and a row of b in the same frame.

    Args:
        a_frame: (N,) frames.
        b_frame: (M,) frames.

    Returns:
        (P,) indices into a and (P,) into b, sorted by the first, then by the second.
    """
    order = np.argsort(b_frame, kind="stable")
    ordered = b_frame[order]
    first = np.searchsorted(ordered, a_frame, side="left")
    count = np.searchsorted(ordered, a_frame, side="right") - first
    i = np.repeat(np.arange(len(a_frame)), count)
    start = np.cumsum(count) - count
    j = order[np.arange(len(i)) - np.repeat(start - first, count)]
    return i, j


def image_overlap(a_px: FloatArray, b_px: FloatArray, of_b: bool = False) -> FloatArray:
    """(P,) common area of aligned pairs of image boxes over that of both, or of b alone.

    Args:
        a_px: (P, 4) left, top, right, bottom.
        b_px: (P, 4) likewise.
        of_b: over the area of b.
    """
    low, high = np.maximum(a_px[:, :2], b_px[:, :2]), np.minimum(a_px[:, 2:], b_px[:, 2:])
    common = np.maximum(high - low, 0.0).prod(axis=1)
    area_a, area_b = ((box[:, 2:] - box[:, :2]).prod(axis=1) for box in (a_px, b_px))
    total = area_b if of_b else area_a + area_b - common
    share: FloatArray = np.divide(common, total, out=np.zeros(len(common)), where=total > 0.0)
    return share
