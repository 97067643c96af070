import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.errors import DatasetError
from scenarios.recorded.clouds.bags import read_bag_clouds, write_bag_clouds
from scenarios.recorded.clouds.fields import NamedCloud
from scenarios.recorded.clouds.files import cloud_bytes, losses, read_cloud, read_clouds
from scenarios.recorded.clouds.pcd import ENCODINGS
from smartmot.pointcloud import PointCloud

SHARED = Path(__file__).parents[5] / "shared" / "lidar"


def random_cloud(seed: int, count: int = 40, dtype: type = np.float32) -> PointCloud:
    rng = np.random.default_rng(seed)
    return PointCloud(
        rng.normal(0, 50, (count, 3)).astype(dtype),
        rng.random(count).astype(np.float32),
        rng.integers(0, 64, count),
        rng.random(count).astype(dtype) * 0.1,
    )


def require_same(a: PointCloud, b: PointCloud, *columns: str) -> None:
    for name in columns or ("xyz_m", "intensity", "ring", "time_offset_s"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def written(folder: Path, content: bytes, name: str = "a.pcd") -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


@settings(max_examples=15, deadline=None)
@given(
    st.integers(0, 1000),
    st.integers(0, 60),
    st.sampled_from([np.float32, np.float64]),
    st.sampled_from(ENCODINGS),
)
def test_pcd_brings_every_number_back(
    tmp_path_factory: pytest.TempPathFactory, seed: int, count: int, dtype: type, encoding: str
) -> None:
    cloud = random_cloud(seed, count, dtype)
    path = written(tmp_path_factory.mktemp("pcd"), cloud_bytes(cloud, "pcd", encoding))
    named = read_cloud(path)
    require_same(named.cloud, cloud)
    assert named.cloud.xyz_m.dtype == dtype
    assert (named.dropped, named.notes) == (0, ())


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_npz_holds_all(tmp_path: Path, dtype: type) -> None:
    full = random_cloud(1, 9, dtype)
    cloud = PointCloud(full.xyz_m, full.intensity, full.ring, full.time_offset_s, "os", 12.5)
    named = read_cloud(written(tmp_path, cloud_bytes(cloud, "npz"), "b.npz"))
    require_same(named.cloud, cloud)
    assert (named.cloud.frame, named.cloud.stamp_s) == ("os", 12.5)
    assert losses(cloud, "npz") == []


@pytest.mark.parametrize(("form", "columns"), [("bin", ()), ("pcd.bin", ("ring",))])
def test_bin_holds_points_and_intensity(tmp_path: Path, form: str, columns: tuple[str, ...]) -> None:
    cloud = random_cloud(2)
    named = read_cloud(written(tmp_path, cloud_bytes(cloud, form), f"a.{form}"))
    assert named.name == "a"
    require_same(named.cloud, cloud, "xyz_m", "intensity", *columns)
    lost, *_ = losses(cloud, form)
    assert "time of each point" in lost
    assert ("ring" in lost) == (form == "bin")


def test_other_content_is_not_taken_for_float32(tmp_path: Path) -> None:
    """Doubles and text have a length that fits, but their coordinates are none."""
    points = np.random.default_rng(1).uniform(-50.0, 50.0, (500, 4))
    for name, data in (("doubles", points.tobytes()), ("text", b"1.25 2.5 -1.7 0.3\n" * 160)):
        path = written(tmp_path, data, f"{name}.bin")
        with pytest.raises(DatasetError, match=rf"{name}\.bin: \d+ of \d+ coordinates are no distances"):
            read_cloud(path)
    turned = points.astype(">f4")
    swapped = written(tmp_path, turned.tobytes(), "swapped.bin")
    rows = b"FIELDS x y z intensity\nPOINTS 500\nDATA binary\n" + turned.tobytes()
    for path in (swapped, written(tmp_path, rows, "swapped.pcd")):
        with pytest.raises(DatasetError, match=r"coordinates are no distances in metres; .*little endian"):
            read_cloud(path)
    assert len(read_cloud(written(tmp_path, np.zeros((5, 4), "<f4").tobytes(), "zeros.bin")).cloud) == 5


def test_made_up_and_rounded_numbers_are_said() -> None:
    bare = PointCloud(np.array([[0.1, 0.0, 0.0]]))
    assert losses(bare, "bin") == [
        "no intensity in the cloud: bin holds 0 for it", "points rounded to float32, by up to 1.5e-09 m",
    ]  # fmt: skip
    with pytest.raises(DatasetError, match="too great for float32"):
        cloud_bytes(PointCloud(np.array([[1e300, 0.0, 0.0]])), "bin")


HEADER = (
    "# comment\nVERSION 0.7\nFIELDS intensity _ z y x\nSIZE 1 1 4 8 4\nTYPE U U F F F\nCOUNT 1 3 1 1 1\n"
    "WIDTH {width}\nHEIGHT {height}\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA binary\n"
)
POINT = struct.Struct("<B3xfdf")


def test_fields_of_any_order_and_kind_with_padding(tmp_path: Path) -> None:
    header = HEADER.format(width=2, height=1, points=2).encode()
    body = POINT.pack(7, 3.0, 2.0, 1.0) + POINT.pack(255, 6.0, 5.0, 4.0)
    cloud = read_cloud(written(tmp_path, header + body)).cloud
    assert cloud.xyz_m.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert cloud.intensity is not None
    assert cloud.intensity.tolist() == [7, 255]


def test_points_counts_and_not_the_length_of_the_file(tmp_path: Path) -> None:
    body = POINT.pack(7, 3.0, 2.0, 1.0) * 3
    header = HEADER.format(width=2, height=1, points=2).encode()
    named = read_cloud(written(tmp_path, header + body))
    assert len(named.cloud) == 2
    assert named.notes == ("20 bytes after the last point ignored",)
    header = HEADER.format(width=7, height=5, points=3).encode()
    named = read_cloud(written(tmp_path, header + body))
    assert len(named.cloud) == 3
    assert named.notes == ("WIDTH x HEIGHT is 35, POINTS 3: the latter counts",)


def test_points_that_are_nowhere_are_counted(tmp_path: Path) -> None:
    text = "FIELDS x y z\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n1 2 3\nnan nan nan\n4 5 inf\n"
    named = read_cloud(written(tmp_path, text.encode()))
    assert named.cloud.xyz_m.tolist() == [[1, 2, 3]]
    assert named.dropped == 2


COMPRESSED = b"FIELDS x y z\nPOINTS 1\nDATA binary_compressed\n"
GOOD = cloud_bytes(random_cloud(3, 5), "pcd", "binary_compressed")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no line DATA"),
        (b"\xff\xfe\nDATA ascii\n", "no text"),
        (b"FIELDS x y z\nPOINTS -1\nDATA ascii\n", "POINTS"),
        (b"FIELDS x y z\nPOINTS 999999999999\nDATA ascii\n", "POINTS"),
        (b"FIELDS x y z\nWIDTH 400000000\nHEIGHT 400000000\nDATA ascii\n", "points: expected"),
        (b"FIELDS x y z\nSIZE 4 4\nPOINTS 1\nDATA ascii\n1 2 3\n", "2 values of SIZE for 3 fields"),
        (b"FIELDS x y z\nTYPE F F Q\nPOINTS 1\nDATA ascii\n1 2 3\n", "TYPE Q"),
        (b"FIELDS x y x\nPOINTS 1\nDATA ascii\n1 2 3\n", "twice"),
        (b"FIELDS x y\nPOINTS 1\nDATA ascii\n1 2\n", "no field z"),
        (b"FIELDS x y z\nPOINTS 2\nDATA ascii\n1 2 3\n", "cut off"),
        (b"FIELDS x y z\nPOINTS 1\nDATA ascii\n1 2 q\n", "points: "),
        (b"FIELDS x y z\nPOINTS 1\nDATA ascii\n1 2 3 4\n", "4 numbers per point, 3 expected"),
        (b"FIELDS x y z\nPOINTS 9\nDATA binary\n1234", "cut off"),
        (b"FIELDS x y z\nPOINTS 1\nDATA zip\n1234", "DATA 'zip'"),
        (
            b"FIELDS x y z\nPOINTS 1\nDATA binary_compressed\n"
            + struct.pack("<II", 3, 4_000_000_000)
            + b"abc",
            "hold",
        ),
        (GOOD[:-3], "cut off"),
        (GOOD.replace(b"POINTS 5", b"POINTS 6"), "cut off"),
    ],
)
def test_damaged_pcd_is_one_line(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(DatasetError, match=message) as caught:
        read_cloud(written(tmp_path, content))
    assert "\n" not in str(caught.value)
    assert "a.pcd" in str(caught.value)


@pytest.mark.parametrize("name", ["a.bin", "a.pcd.bin", "a.npz"])
def test_damaged_arrays_are_one_line(tmp_path: Path, name: str) -> None:
    with pytest.raises(DatasetError, match=name):
        read_cloud(written(tmp_path, b"1234567", name))


def test_an_archive_of_python_objects_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, xyz_m=np.array([{}], dtype=object))
    with pytest.raises(DatasetError, match=r"a\.npz"):
        read_cloud(path)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, len(GOOD) - 1), st.integers(0, 255))
def test_a_changed_byte_gives_a_cloud_or_a_named_error(
    tmp_path_factory: pytest.TempPathFactory, place: int, value: int
) -> None:
    content = bytearray(GOOD)
    content[place] = value
    path = written(tmp_path_factory.getbasetemp(), bytes(content))
    try:
        assert len(read_cloud(path).cloud) <= 500_000_000
    except DatasetError as error:
        assert "\n" not in str(error)  # noqa: PT017


@pytest.mark.parametrize("name", ["drive.mcap", "drive.db3", "drive"])
def test_bags_bring_every_number_back(tmp_path: Path, name: str) -> None:
    pytest.importorskip("rosbags")
    clouds = [random_cloud(4), random_cloud(5, dtype=np.float64), PointCloud(np.zeros((0, 3)))]
    path = tmp_path / name
    assert write_bag_clouds(path, [NamedCloud(str(k), cloud) for k, cloud in enumerate(clouds)]) == 3
    back = list(read_bag_clouds(path))
    assert [named.name for named in back] == ["000000", "000001", "000002"]
    for named, cloud in zip(back[:2], clouds[:2], strict=True):
        require_same(named.cloud, cloud)
    assert [named.cloud.stamp_s for named in back[1:]] == pytest.approx([0.1, 0.2])
    assert len(back[2].cloud) == 0
    with pytest.raises(DatasetError, match="no topic /other with clouds; there are /points"):
        list(read_clouds(path, "/other"))


@pytest.mark.parametrize("columns", [3, 5, 6, 7])
def test_rows_of_other_lengths_are_not_taken_for_points_of_four(tmp_path: Path, columns: int) -> None:
    """The length fits all of them; strengths of echoes are never below 0, which coordinates are."""
    rng = np.random.default_rng(columns)
    rows = np.column_stack((rng.normal(0.0, 9.0, (400, 3)), rng.random((400, 4))))[:, :columns]
    path = written(tmp_path, rows.astype("<f4").tobytes(), "points.bin")
    with pytest.raises(DatasetError, match=r"points\.bin: \d+ of \d+ strengths of echoes are negative"):
        read_cloud(path)
    path = written(tmp_path, rng.random((400, 4)).astype("<f4").tobytes(), "points.bin")
    assert len(read_cloud(path).cloud) == 400


def test_points_that_are_nowhere_go_from_archives_too(tmp_path: Path) -> None:
    cloud = random_cloud(6)
    xyz = cloud.xyz_m.copy()
    xyz[3, 1], xyz[7, 0] = np.nan, np.inf
    path = tmp_path / "a.npz"
    np.savez(path, xyz_m=xyz, ring=cloud.ring)
    named = read_cloud(path)
    assert (len(named.cloud), named.dropped) == (38, 2)
    assert cloud.ring is not None
    assert named.cloud.ring is not None
    assert named.cloud.ring.tolist() == np.delete(cloud.ring, (3, 7)).tolist()
    for wrong, message in (
        ({"xyz_m": xyz.astype(complex)}, "array xyz_m: expected numbers of points, got complex128"),
        ({"xyz_m": xyz.astype(str)}, "array xyz_m: expected numbers of points, got <U"),
        ({"xyz_m": xyz, "ring": cloud.ring[:9]}, "array ring: 9 rows for 40 points"),
    ):
        np.savez(path, **wrong)
        with pytest.raises(DatasetError, match=message):
            read_cloud(path)


def test_strengths_of_another_unit_are_said() -> None:
    bytes_ = PointCloud(np.ones((2, 3), np.float32), np.array([3.0, 200.0], np.float32))
    shares = PointCloud(np.ones((2, 3), np.float32), np.array([0.1, 0.9], np.float32))
    assert losses(bytes_, "bin") == ["intensities kept, some over 1: in bin they are from 0 to 1, as a rule"]
    assert "none over 1: in pcd.bin they are from 0 to 255" in " ".join(losses(shares, "pcd.bin"))
    assert "intensities" not in " ".join(losses(shares, "bin") + losses(bytes_, "pcd.bin"))


@pytest.mark.parametrize("count", [100, 400, 401])
def test_rows_of_five_numbers_are_not_taken_for_points_of_four(tmp_path: Path, count: int) -> None:
    """400 rows of five are 500 whole points of four: the length alone does not tell them apart."""
    rng = np.random.default_rng(count)
    rows = np.column_stack(
        (rng.normal(0.0, 9.0, (count, 3)), rng.integers(0, 256, count), np.arange(count) % 32)
    )
    path = tmp_path / "sweep.bin"
    path.write_bytes(rows.astype("<f4").tobytes())
    with pytest.raises(DatasetError, match=r"sweep\.bin: .*name (the file|nuScenes' sweeps) \.pcd\.bin"):
        read_cloud(path)
    renamed = path.rename(tmp_path / "sweep.pcd.bin")
    np.testing.assert_array_equal(read_cloud(renamed).cloud.ring, rows[:, 4])


def test_points_of_four_numbers_are_never_taken_for_rows_of_five(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack((rng.normal(0.0, 9.0, (500, 3)), np.zeros(500)))
    whole = np.column_stack((np.arange(500), np.arange(500) % 7, np.zeros(500), np.zeros(500)))
    for name, rows in (("drawn", points), ("whole", whole)):
        path = tmp_path / f"{name}.bin"
        path.write_bytes(rows.astype("<f4").tobytes())
        assert len(read_cloud(path).cloud) == 500


def longer_rows(kind: str, count: int = 400) -> np.ndarray[Any, np.dtype[Any]]:
    """Points of a ring around the sensor, and what other tools write behind them."""
    rng = np.random.default_rng(7)
    xyz = np.column_stack((rng.normal(0.0, 15.0, (count, 2)), rng.normal(-1.0, 1.0, count)))
    point = np.column_stack((xyz, rng.random(count)))
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    time, ring = rng.random((count, 1)) * 0.1, rng.integers(0, 32, (count, 1))
    more = {
        "normals": np.column_stack((normal, rng.random(count))),
        "colours": rng.integers(0, 256, (count, 4)),
        "time and ring": np.column_stack((time, ring, np.zeros((count, 2)))),
        "padding": np.zeros((count, 4)),
        "labels of twelve": np.column_stack((np.abs(normal), time, ring, ring, time, time)),
        "of sixteen": np.column_stack((np.zeros((count, 4)), rng.random((count, 4)), np.ones((count, 4)))),
    }[kind]
    return np.column_stack((point, more)).astype("<f4")


@pytest.mark.parametrize(
    ("kind", "length"),
    [("normals", 8), ("colours", 8), ("time and ring", 8), ("padding", 8), ("labels of twelve", 12),
     ("of sixteen", 16)],
)  # fmt: skip
def test_rows_whose_length_fits_points_of_four_are_not_taken_for_them(
    tmp_path: Path, kind: str, length: int
) -> None:
    rows = longer_rows(kind)
    assert rows.shape[1] == length
    path = written(tmp_path, rows.tobytes(), "points.bin")
    with pytest.raises(DatasetError, match=r"points\.bin: .*rows of (\d+) numbers.*--columns") as error:
        read_cloud(path)
    assert "\n" not in str(error.value)
    assert length % int(re.findall(r"rows of (\d+)", str(error.value))[0]) == 0
    cloud = read_cloud(path, ("x", "y", "z", "intensity", *"_" * (length - 4))).cloud
    np.testing.assert_array_equal(cloud.xyz_m, rows[:, :3])
    np.testing.assert_array_equal(cloud.intensity, rows[:, 3])


def test_clouds_of_two_lasers_in_turns_and_of_flat_streets_stay_points_of_four(tmp_path: Path) -> None:
    """Upper and lower half of a sensor alternate in some files; streets may have whole heights."""
    rng = np.random.default_rng(3)
    upper = np.column_stack((rng.normal(0, 30, (600, 2)), rng.normal(-0.5, 0.5, 600), rng.random(600)))
    lower = np.column_stack((rng.normal(0, 5, (600, 2)), np.full(600, -2.0), rng.random(600)))
    for name, rows in (
        ("halves", np.stack((upper, lower), axis=1) + np.array([0, 0, 0.01, 0])),
        ("flat", lower),
        ("whole", np.round(upper)),
    ):
        path = written(tmp_path, np.ascontiguousarray(rows, dtype="<f4").tobytes(), f"{name}.bin")
        assert len(read_cloud(path).cloud) == rows.size // 4


def test_no_real_cloud_is_taken_for_rows_of_another_length() -> None:
    paths = sorted(SHARED.glob("kitti_*/**/velodyne/*.bin")) if SHARED.is_dir() else []
    if not paths:
        pytest.skip(f"{SHARED}: not there")
    assert len(paths) >= 20
    for path in paths:
        assert len(read_cloud(path).cloud) > 10_000


def test_columns_are_named_of_files_that_do_not_name_them(tmp_path: Path) -> None:
    path = written(tmp_path, longer_rows("padding").tobytes(), "points.bin")
    with pytest.raises(DatasetError, match="each once, got x,y,z,x"):
        read_cloud(path, ("x", "y", "z", "x"))
    with pytest.raises(DatasetError, match="no whole number of points of 28 bytes"):
        read_cloud(path, ("x", "y", "z", *"____"))
    archive = written(tmp_path, cloud_bytes(random_cloud(3, 5), "npz"), "points.npz")
    with pytest.raises(DatasetError, match=r"points\.npz: the file names its columns itself"):
        read_cloud(archive, ("x", "y", "z"))
