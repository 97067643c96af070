"""Numbers survive the way into the page within half a unit; what is packed means nothing in HTML."""

import math
import string

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.results.files import ResultsError
from evaluation.views.page.codec import deltas, pack, restored, restored_ring, ring, unpack

METRES = st.floats(-1e6, 1e6)


@given(st.lists(METRES, max_size=50))
def test_differences_come_back_within_half_a_centimetre(values: list[float]) -> None:
    back = restored(deltas(np.array(values), 100.0), 100.0)
    assert np.all(np.abs(back - values) <= 0.005 + 1e-9 * np.abs(values))


@given(st.lists(st.tuples(METRES, METRES), min_size=1, max_size=30), METRES)
def test_outlines_come_back_from_any_origin(points: list[tuple[float, float]], origin: float) -> None:
    corners, start = np.array(points), np.array([origin, -origin])
    back = restored_ring(ring(corners, start), start)
    assert np.all(np.abs(back - corners) <= 0.005 + 1e-8)


@pytest.mark.parametrize("far", [1e10, 1e30, math.nan])
def test_an_outline_beyond_everything_is_one_clear_error(far: float) -> None:
    with pytest.raises(ResultsError, match=r"an outline reaches further than 1e\+09 m"):
        ring(np.array([[0.0, far]]), np.zeros(2))


def test_what_stands_costs_nothing() -> None:
    assert deltas(np.array([12.34, 12.34, 12.34]), 100.0) == [1234, 0, 0]


@given(st.dictionaries(st.text(max_size=8), st.lists(st.integers(-9999, 9999)) | st.text(max_size=30)))
def test_packing_keeps_everything_in_harmless_letters(content: dict[str, object]) -> None:
    packed = pack(content)
    assert set(packed) <= set(string.ascii_letters + string.digits + "+/=")
    assert unpack(packed) == content
