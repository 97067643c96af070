"""Tables with columns of other data sets and tools; values worked out by hand."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from scenarios.errors import DatasetError
from scenarios.recorded.csv_files import read_csv
from scenarios.recorded.dataset import Dataset
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.tables.columns import Columns

IND = (
    "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity\n"
    "7,0,0,0,10.0,-20.0,90.0,1.8,4.4,0.0,5.0\n"
    "7,0,1,1,10.0,-19.8,90.0,1.8,4.4,0.0,5.0\n"
    "7,0,2,2,10.0,-19.6,270.0,1.8,4.4,0.0,5.0\n"
    "7,3,1,0,15.0,-25.0,180.0,0.0,0.0,-1.0,0.0\n"
    "7,3,2,1,14.96,-25.0,180.0,0.0,0.0,-1.0,0.0\n"
)
"""As inD: by track, then by frame; a pedestrian without extent."""
IND_META = (
    "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class\n"
    "7,0,0,2,3,1.8,4.4,truck_bus\n7,3,1,2,2,0,0,pedestrian\n"
)
IND_PAIRS = (
    "sequence=recordingId,track_id=trackId,x_m=xCenter,y_m=yCenter,yaw_deg=heading,length_m=length,"
    "width_m=width,vx_mps=xVelocity,vy_mps=yVelocity,category=07_tracksMeta.csv:class"
)
HIGHD = (
    "frame,id,x,y,width,height,xVelocity,yVelocity,laneId\n"
    "1,1,100.0,8.0,4.0,2.0,-30.0,0.0,2\n"
    "2,1,98.8,8.0,4.0,2.0,-30.0,0.0,2\n"
    "1,2,50.0,20.0,12.0,2.5,25.0,0.5,5\n"
)
"""As highD: upper left corner in image axes, width along the road, no heading."""
HIGHD_PAIRS = (
    "track_id=id,corner_x_m=x,corner_y_down_m=y,length_m=width,width_m=height,vx_mps=xVelocity,"
    "vy_down_mps=yVelocity"
)


def ind(folder: Path, pairs: str = IND_PAIRS, table: str = IND) -> Dataset:
    (folder / "07_tracks.csv").write_text(table)
    (folder / "07_tracksMeta.csv").write_text(IND_META)
    return read_dataset(folder / "07_tracks.csv", columns=Columns.parse(pairs, 25.0))


def assert_same(data: Dataset, other: Dataset) -> None:
    for one, two in zip(data.sequences, other.sequences, strict=True):
        assert one.name == two.name
        assert one.frame_name == two.frame_name
        np.testing.assert_allclose(one.stamp_s, two.stamp_s, rtol=0, atol=1e-12)
        assert one.labels is not None
        assert two.labels is not None
        for mine, theirs in ((one.detections, two.detections), (one.labels, two.labels)):
            for name in ("center_m", "size_m", "yaw_rad", "velocity_mps", "bottom_m", "height_m", "score"):
                np.testing.assert_allclose(
                    getattr(mine, name), getattr(theirs, name), rtol=0, atol=1e-12, err_msg=name
                )
            assert mine.frame.tolist() == theirs.frame.tolist()
            assert mine.category.tolist() == theirs.category.tolist()
        assert one.labels.object_id.tolist() == two.labels.object_id.tolist()


def test_ind_equals_the_same_data_in_our_layout(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    header = "sequence,stamp_s,track_id,category,x_m,y_m,yaw_rad,length_m,width_m,vx_mps,vy_mps\n"
    quarter, half = math.pi / 2, math.pi
    rows = (
        f"7,0.0,0,truck,10.0,-20.0,{quarter!r},4.4,1.8,0.0,5.0\n"
        f"7,0.04,0,truck,10.0,-19.8,{quarter!r},4.4,1.8,0.0,5.0\n"
        f"7,0.04,3,pedestrian,15.0,-25.0,{-half!r},0.6,0.5,-1.0,0.0\n"
        f"7,0.08,0,truck,10.0,-19.6,{-quarter!r},4.4,1.8,0.0,5.0\n"
        f"7,0.08,3,pedestrian,14.96,-25.0,{-half!r},0.6,0.5,-1.0,0.0\n"
    )
    for name in ("detections", "labels"):
        (own / f"{name}.csv").write_text(header + rows)
    data, ours = ind(tmp_path), read_csv(own)
    assert data.sequences[0].frame_name == ("0", "1", "2")
    assert data.sequences[0].detections.kind.tolist()[0] == "truck_bus"
    assert any("2 boxes without extent" in note for note in data.notes)
    named = [f"{t:.3f} s" for t in data.sequences[0].stamp_s]
    assert ours.sequences[0].frame_name == tuple(named)
    assert_same(Dataset("csv", (_renamed(data),)), Dataset("csv", (_renamed(ours),)))


def _renamed(data: Dataset):  # type: ignore[no-untyped-def]
    from dataclasses import replace

    return replace(data.sequences[0], frame_name=("a", "b", "c"))


def test_highd_corners_axes_and_headings(tmp_path: Path) -> None:
    """(100, 8) down with 4 x 2 m: the middle is 102, 9 down, so -9 up; it drives to the left."""
    (tmp_path / "01_tracks.csv").write_text(HIGHD)
    data = read_dataset(tmp_path / "01_tracks.csv", columns=Columns.parse(HIGHD_PAIRS, 25.0))
    [sequence] = data.sequences
    assert sequence.stamp_s == pytest.approx([0.04, 0.08], abs=1e-12)
    objects = sequence.detections
    assert objects.center_m == pytest.approx(np.array([[102, -9], [56, -21.25], [100.8, -9]]), abs=1e-12)
    assert objects.size_m.tolist() == [[4.0, 2.0], [12.0, 2.5], [4.0, 2.0]]
    assert np.cos(objects.yaw_rad) == pytest.approx([-1.0, math.cos(math.atan2(-0.5, 25.0)), -1.0])
    assert np.sin(objects.yaw_rad) == pytest.approx([0.0, math.sin(math.atan2(-0.5, 25.0)), 0.0], abs=1e-12)
    assert objects.velocity_mps.tolist() == [[-30.0, 0.0], [25.0, -0.5], [-30.0, 0.0]]
    assert sequence.labels is not None
    assert sequence.labels.object_id.tolist() == [1, 2, 1]
    assert any("heading: it is that of the velocity" in note for note in data.notes)


def test_a_box_across_the_x_axis_has_its_length_along_y(tmp_path: Path) -> None:
    text = "t,l,u,a,b,h\n0,10,20,4,2,90\n"
    (tmp_path / "d.csv").write_text(text)
    pairs = "stamp_s=t,corner_x_m=l,corner_y_m=u,length_m=a,width_m=b,yaw_deg=h"
    [sequence] = read_dataset(tmp_path / "d.csv", columns=Columns.parse(pairs)).sequences
    assert sequence.detections.center_m == pytest.approx(np.array([[11.0, 18.0]]), abs=1e-12)
    assert sequence.labels is None


@pytest.mark.parametrize(
    ("pair", "value", "yaw"),
    [
        ("yaw_deg", 30.0, math.radians(30)),
        ("yaw_down_deg", 30.0, -math.radians(30)),
        ("yaw_down_rad", 0.5, -0.5),
        ("course_deg", 90.0, 0.0),  # east
        ("course_deg", 0.0, math.pi / 2),  # north
        ("course_rad", math.pi / 4, math.pi / 4),
    ],
)
def test_headings(tmp_path: Path, pair: str, value: float, yaw: float) -> None:
    (tmp_path / "d.csv").write_text(f"stamp_s,x_m,y_m,length_m,width_m,h\n0,0,0,4,2,{value!r}\n")
    [sequence] = read_dataset(tmp_path / "d.csv", columns=Columns.parse(f"{pair}=h")).sequences
    assert sequence.detections.yaw_rad == pytest.approx([yaw], abs=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_times_and_constants(tmp_path: Path, unit: str, factor: float) -> None:
    rows = "".join(f"{round(t * factor)},{t},36\n" for t in (0.0, 0.1))
    (tmp_path / "d.csv").write_text("when,along,v\n" + rows)
    pairs = f"stamp_{unit}=when,x_m=along,y_m=0,length_m=4.5,width_m=2,vx_kmh=v,vy_mps=0"
    [sequence] = read_dataset(tmp_path / "d.csv", columns=Columns.parse(pairs)).sequences
    assert sequence.stamp_s == pytest.approx([0.0, 0.1])
    assert sequence.detections.size_m.tolist() == [[4.5, 2.0]] * 2
    assert sequence.detections.velocity_mps == pytest.approx(np.array([[10.0, 0.0]] * 2))


def test_who_stands_keeps_the_heading_of_its_track(tmp_path: Path) -> None:
    rows = "0,a,0,0\n1,a,0,5\n2,a,0,0.1\n1,b,3,0\n2,b,0,0\n"
    (tmp_path / "d.csv").write_text("stamp_s,who,vx_mps,vy_mps\n" + rows)
    pairs = "track_id=who,x_m=1,y_m=1,length_m=4,width_m=2"
    [sequence] = read_dataset(tmp_path / "d.csv", columns=Columns.parse(pairs)).sequences
    assert sequence.labels is not None
    assert sequence.labels.object_id.tolist() == [0, 0, 1, 0, 1]
    assert sequence.labels.yaw_rad == pytest.approx([math.pi / 2, math.pi / 2, 0.0, math.pi / 2, 0.0])


def test_a_track_can_be_the_vehicle(tmp_path: Path) -> None:
    """The pedestrian is there in frames 1 and 2, so that the truck's frame 0 is left out."""
    data = ind(tmp_path, f"{IND_PAIRS},ego_track=3")
    [sequence] = data.sequences
    assert sequence.stamp_s == pytest.approx([0.04, 0.08])
    assert sequence.ego_xy_yaw() == pytest.approx(np.array([[15, -25, -math.pi], [14.96, -25, -math.pi]]))
    assert sequence.labels is not None
    assert sequence.labels.object_id.tolist() == [0, 0]
    assert sequence.detections.center_m.tolist() == [[10.0, -19.8], [10.0, -19.6]]
    alone = "7,9,1,0,0,0,0,2,4,0,0\n7,9,3,0,1,0,0,2,4,0,0\n7,9,5,0,2,0,0,2,4,0,0\n"
    [sequence] = ind(tmp_path, f"{IND_PAIRS.rpartition(',category')[0]},ego_track=9", IND + alone).sequences
    assert sequence.stamp_s == pytest.approx([0.04, 0.08, 0.12, 0.2])  # 2 is a frame of the others
    assert [len(frame) for frame in sequence.frames()] == [1, 1, 0, 0]  # no category, no extent
    with pytest.raises(DatasetError, match="no track '5' for ego_track; there are: 0, 3"):
        ind(tmp_path, f"{IND_PAIRS},ego_track=5")
    with pytest.raises(DatasetError, match="ego_track=3 needs track_id="):
        ind(tmp_path, IND_PAIRS.replace("track_id=trackId,", "").rpartition(",category")[0] + ",ego_track=3")


def test_parquet_as_csv(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    data = ind(tmp_path / "a")
    table = pd.read_csv(tmp_path / "a" / "07_tracks.csv")
    table["note"] = [[1, 2]] * len(table)
    table.to_parquet(tmp_path / "b" / "07_tracks.parquet")
    (tmp_path / "b" / "07_tracksMeta.csv").write_text(IND_META)
    file = tmp_path / "b" / "07_tracks.parquet"
    assert_same(data, read_dataset(file, columns=Columns.parse(IND_PAIRS, 25.0)))
    own = pd.DataFrame(
        {
            "stamp_s": pd.to_datetime([0, 100], unit="ms"),
            "x_m": np.float32([1, 2]),
            "y_m": [0, 0],
            "length_m": 4.0,
            "width_m": 2.0,
            "yaw_rad": 0.0,
            "category": pd.Categorical(["car", "car"]),
        }
    )
    own.to_parquet(tmp_path / "detections.parquet")
    own.assign(track_id=5).to_parquet(tmp_path / "labels.parquet")
    [sequence] = read_dataset(tmp_path).sequences
    assert sequence.stamp_s == pytest.approx([0.0, 0.1])
    assert sequence.detections.center_m[:, 0].tolist() == [1.0, 2.0]
    assert sequence.labels is not None
    assert sequence.labels.object_id.tolist() == [5, 5]


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ("x_m=xCentre", r"no column 'xCentre' for x_m; near: xCenter"),
        ("x_meter=xCenter", r"no column 'x_meter' of ours; near: x_m"),
        ("heading=heading", r"heading=heading: unit or axis is not known; write one of: yaw_rad, yaw_deg"),
        ("time=frame", r"write one of: stamp_s, stamp_ms, stamp_us, stamp_ns, frame"),
        ("x_m", r"expected pairs ours=theirs such as x_m=xCenter, got 'x_m'"),
        ("", r"got none"),
        ("y_m=yCenter,y_down_m=yCenter", r"y_m and y_down_m say the same; give one"),
        ("x_m=xCenter,x_m=yCenter", r"x_m is there twice"),
        ("category=nowhere.csv:class,track_id=trackId", r"needed|no file"),
    ],
)
def test_mistakes_are_one_line(tmp_path: Path, pairs: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message) as error:
        ind(tmp_path, pairs)
    assert "\n" not in str(error.value)


def test_what_is_missing_is_asked_for_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(IND)
    with pytest.raises(DatasetError) as error:
        read_dataset(tmp_path / "t.csv", columns=Columns.parse("x_m=xCenter"))
    text = str(error.value)
    for asked in ("y_down_m=", "length_m= and width_m=", "yaw_deg=", "--frame-rate", "xVelocity"):
        assert asked in text
    with pytest.raises(DatasetError, match="--frame-rate: must be positive"):
        Columns.parse("x_m=a", 0.0)
    (tmp_path / "detections").mkdir()
    with pytest.raises(DatasetError, match=r"are for tables \(csv\), not for kitti"):
        read_dataset(tmp_path, columns=Columns(frame_rate_hz=20.0))


def test_names_without_unit_are_metres_and_said(tmp_path: Path) -> None:
    data = ind(tmp_path, IND_PAIRS.replace("x_m=", "x=").replace("y_m=", "y="))
    assert any(note.startswith("x, y: taken for x_m, y_m (SI units,") for note in data.notes)
    assert_same(data, ind(tmp_path))


def test_damaged_tables(tmp_path: Path) -> None:
    file = tmp_path / "d.parquet"
    file.write_bytes(b"PAR1 nothing PAR1")
    for columns in (None, Columns.parse("x_m=x")):
        with pytest.raises(DatasetError, match=r"d\.parquet: not a readable Parquet file"):
            read_dataset(file, columns=columns)
    pd.DataFrame({"x_m": ["a"], "y_m": [1.0]}).to_parquet(file)
    with pytest.raises(DatasetError, match="columns missing: length_m, width_m, yaw_rad"):
        read_dataset(file)
    pairs = "stamp_s=y_m,length_m=4,width_m=2,yaw_rad=0"
    with pytest.raises(DatasetError, match="column 'x_m' holds no numbers"):
        read_dataset(file, columns=Columns.parse(pairs))
    with pytest.raises(DatasetError, match=r"07_tracks\.csv:3: field 'xCenter' is no number: 'abc'"):
        ind(tmp_path, table=IND.replace("1,1,10.0", "1,1,abc"))
    with pytest.raises(DatasetError, match=r"field 'trackId' must be a track of .*07_tracksMeta\.csv"):
        ind(tmp_path, table=IND.replace("7,3,", "7,4,"))


def test_feet_are_metres(tmp_path: Path) -> None:
    """US-101 of NGSIM is in feet: 14.3 ft are 4.35864 m."""
    (tmp_path / "t.csv").write_text("id,f,cx,cy,l,w,vx\n1,10,100,20,14.3,6.4,50\n1,11,105,20,14.3,6.4,50\n")
    pairs = "track_id=id,frame=f,x_ft=cx,y_down_ft=cy,length_ft=l,width_ft=w,vx_fps=vx,vy_mps=0,yaw_rad=0"
    boxes = read_dataset(tmp_path / "t.csv", columns=Columns.parse(pairs, 10.0)).sequences[0].detections
    assert boxes.center_m == pytest.approx(np.array([(30.48, -6.096), (32.004, -6.096)]))
    assert boxes.size_m[0] == pytest.approx((4.35864, 1.95072))
    assert boxes.velocity_mps[0] == pytest.approx((15.24, 0.0))
    with pytest.raises(DatasetError, match="x_m and x_ft say the same"):
        Columns.parse("x_m=a,x_ft=b")


def test_headings_that_nothing_shows_are_counted(tmp_path: Path) -> None:
    """Two rows of a car that stands all the time; the other stands after it has moved."""
    rows = "1,1,0,0,4,2,0.0,0.1\n2,1,0,0,4,2,0.0,0.1\n1,2,9,9,4,2,0.0,5.0\n2,2,9,9,4,2,0.1,0.0\n"
    (tmp_path / "t.csv").write_text("frame,id,x_m,y_m,length_m,width_m,vx_mps,vy_mps\n" + rows)
    data = read_dataset(tmp_path / "t.csv", columns=Columns.parse("track_id=id", 25.0))
    [note] = [note for note in data.notes if "never move" in note]
    assert note.startswith("2 rows are of objects that never move at 0.5 m/s or more")
    labels = data.sequences[0].labels
    assert labels is not None
    assert labels.yaw_rad[labels.object_id == 2] == pytest.approx([math.pi / 2] * 2)
