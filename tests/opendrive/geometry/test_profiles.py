import numpy as np

from opendrive.geometry.profiles import CubicTable

PROFILES = [
    np.array([[0.0, 1.0, 2.0, 3.0, 4.0], [10.0, 7.0, 0.0, 0.0, 0.0]]),
    np.empty((0, 5)),
    np.array([[5.0, -1.0, 0.5, 0.0, 0.0]]),
]


def test_each_profile_is_evaluated_by_its_own_records():
    table = CubicTable.stack(PROFILES)
    value, slope = table.value_and_slope(np.array([0, 0, 2, 0]), np.array([2.0, 10.0, 7.0, 9.0]))
    np.testing.assert_allclose(value, [1 + 4 + 12 + 32, 7.0, 0.0, 1 + 18 + 243 + 2916])
    np.testing.assert_allclose(slope, [2 + 12 + 48, 0.0, 0.5, 2 + 54 + 972])


def test_a_profile_is_zero_before_its_first_record_and_without_records():
    table = CubicTable.stack(PROFILES)
    value, slope = table.value_and_slope(np.array([2, 1, 0]), np.array([4.9, 100.0, -1.0]))
    np.testing.assert_array_equal(value, 0.0)
    np.testing.assert_array_equal(slope, 0.0)


def test_origin_shifts_each_profile():
    table = CubicTable.stack(PROFILES, np.array([100.0, 0.0, 50.0]))
    np.testing.assert_allclose(table.value(np.array([0, 2]), np.array([101.0, 57.0])), [10.0, 0.0])
    np.testing.assert_allclose(table.start_m[:2], [100.0, 110.0])


def test_records_closer_than_a_micrometre_stay_apart():
    start = 123.456
    profile = np.array([[start, 1.0, 0, 0, 0], [np.nextafter(start, 1e9), 2.0, 0, 0, 0]])
    table = CubicTable.stack([profile])
    assert table.value(np.zeros(2, dtype=np.int64), profile[:, 0]).tolist() == [1.0, 2.0]


def test_a_table_without_records_is_zero_everywhere():
    table = CubicTable.stack([np.empty((0, 5))] * 2)
    np.testing.assert_array_equal(table.value(np.array([0, 1]), np.array([0.0, 9.0])), 0.0)
