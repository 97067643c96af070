"""Scenarios of the Motion Forecasting Dataset: tracks as labels, the vehicle's as poses, damaged files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from scenarios.errors import DatasetError
from scenarios.recorded.argoverse.forecasting import CATEGORY_OF_TYPE, SIZE_OF_TYPE, scenario_files
from scenarios.recorded.dataset import LEFT_OUT
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.maps.drive_map import load_drive_map
from scenarios.recorded.motion import motion_of
from smartmot.types import CATEGORIES
from tests.scenarios.recorded import argoverse_log as made

SHARED = Path(__file__).parents[4].parent / "shared" / "argoverse2" / "scenario"

# av2 0.3.6, datasets/motion_forecasting/data_schema.py
AV2_TYPES = [
    *("background", "bus", "construction", "cyclist", "motorcyclist", "pedestrian"),
    *("riderless_bicycle", "static", "unknown", "vehicle"),
]


def track(name: str, kind: str, steps: range, x_m: float, y_m: float, speed_mps: float) -> pd.DataFrame:
    """A road user that moves along x."""
    step = np.array(steps)
    return pd.DataFrame(
        {
            "observed": step < 5,
            "track_id": name,
            "object_type": kind,
            "object_category": 1,
            "timestep": step,
            "position_x": x_m + 0.1 * speed_mps * step,
            "position_y": y_m,
            "heading": 0.0 if speed_mps >= 0.0 else np.pi,
            "velocity_x": speed_mps,
            "velocity_y": 0.0,
            "scenario_id": "made",
            "start_timestamp": 3.15986559e17,
        }
    )


def tracks() -> pd.DataFrame:
    """The vehicle, a car ahead that comes later, a pedestrian that stands, a cone; rows by track."""
    return pd.concat(
        [
            track("1001", "vehicle", range(3, 11), 30.0, -1.75, 8.0),
            track("AV", "vehicle", range(11), 20.0, -1.75, 10.0),
            track("7", "pedestrian", range(11), 50.0, -5.2, 0.0),
            track("8", "construction", range(11), 40.0, 3.0, 0.0),
        ],
        ignore_index=True,
    )


def write(folder: Path, table: pd.DataFrame, name: str = "made") -> Path:
    path = folder / f"scenario_{name}.parquet"
    table.to_parquet(path)
    made.write_map(folder / f"log_map_archive_{name}.json", made.street())
    return path


def test_tracks_are_labels_and_av_is_the_vehicle(tmp_path: Path) -> None:
    path = write(tmp_path, tracks())
    for place in (tmp_path, path):
        data = read_dataset(place)
        assert data.kind == "argoverse"
        [sequence] = data.sequences
        assert sequence.name == "made"
        assert sequence.stamp_s == pytest.approx(0.1 * np.arange(11))
        assert sequence.map_path == tmp_path / "log_map_archive_made.json"
        # at 1 s it has driven 10 m
        assert sequence.ego_xy_yaw()[[0, 10]] == pytest.approx(np.array([(20.0, -1.75, 0), (30.0, -1.75, 0)]))
        labels = sequence.labels
        assert labels is not None
        assert len(labels) == 8 + 11
        car = labels[labels.kind == "vehicle"]
        assert set(car.object_id.tolist()) == {1001}
        assert car.frame.tolist() == list(range(3, 11))
        assert car.center_m[0] == pytest.approx((30.0 + 0.3 * 8.0, -1.75))
        assert car.velocity_mps == pytest.approx(np.tile((8.0, 0.0), (8, 1)))
        assert car.size_m[0] == pytest.approx(SIZE_OF_TYPE["vehicle"][:2])
        assert data.notes == (
            "sizes are not recorded: the usual one of each type of object is taken",
            "labels left out, for they are no road users: 11 construction",
        )


def test_all_types_have_a_category_and_those_of_road_users_a_size() -> None:
    assert sorted(CATEGORY_OF_TYPE) == AV2_TYPES
    assert set(CATEGORY_OF_TYPE.values()) <= {*CATEGORIES, LEFT_OUT}
    users = {kind for kind, category in CATEGORY_OF_TYPE.items() if category not in (LEFT_OUT, "unknown")}
    assert set(SIZE_OF_TYPE) == users


def test_user_s_classes_overrule(tmp_path: Path) -> None:
    write(tmp_path, tracks())
    (tmp_path / "classes.csv").write_text("class,category\nconstruction,unknown\nvehicle,\n")
    labels = read_dataset(tmp_path).sequences[0].labels
    assert labels is not None
    assert set(labels.kind.tolist()) == {"pedestrian", "construction"}


def test_gaps_in_the_vehicle_s_track_are_bridged_and_long_ones_refused(tmp_path: Path) -> None:
    table = tracks()
    short = table[(table["track_id"] != "AV") | ~table["timestep"].isin([4, 5])]
    write(tmp_path, short)
    assert read_dataset(tmp_path).sequences[0].ego_xy_yaw()[5, 0] == pytest.approx(25.0)
    write(tmp_path, table[(table["track_id"] != "AV") | ~table["timestep"].between(2, 8)])
    with pytest.raises(DatasetError, match=r"do not cover the boxes: none within 0\.5 s"):
        read_dataset(tmp_path)
    write(tmp_path, table[(table["track_id"] != "AV") | (table["timestep"] < 9)])
    with pytest.raises(DatasetError, match="do not cover the boxes"):
        read_dataset(tmp_path)


def test_headings_turn_the_short_way_between_states(tmp_path: Path) -> None:
    table = tracks()
    own = table["track_id"] == "AV"
    table.loc[own, "heading"] = np.where(table.loc[own, "timestep"] % 2 == 0, 3.1, -3.1)
    write(tmp_path, table[~own | (table["timestep"] != 4)])
    yaw = read_dataset(tmp_path).sequences[0].ego_xy_yaw()[4, 2]
    assert abs(yaw) == pytest.approx(3.1, abs=1e-9)  # between two of -3.1, not 0


def test_a_vehicle_that_moves_otherwise_than_its_velocity_says_is_named(tmp_path: Path) -> None:
    table = tracks()
    last = (table["track_id"] == "AV") & (table["timestep"] == 10)
    table.loc[last, "position_x"] -= 0.5  # 5 m/s less over the last 0.1 s
    write(tmp_path, table)
    write(tmp_path, tracks(), "other")
    [note] = [note for note in read_dataset(tmp_path).notes if "recorded velocities" in note]
    assert note.startswith("in 1 of 2 scenarios")
    assert "up to 5.0 m/s off in made (1 of 10 steps)" in note


def test_every_scenario_of_a_folder_has_its_own_map(tmp_path: Path) -> None:
    for name in ("b", "a"):
        write(tmp_path, tracks(), name)
    sequences = read_dataset(tmp_path).sequences
    assert [s.name for s in sequences] == ["a", "b"]
    assert [s.map_path for s in sequences] == [tmp_path / f"log_map_archive_{k}.json" for k in "ab"]
    assert scenario_files(tmp_path / "log_map_archive_a.json") == []
    with pytest.raises(DatasetError, match="2 maps in it"):
        load_drive_map(tmp_path)


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda t: t.drop(columns="heading"), "columns missing: heading"),
        (lambda t: t[t["track_id"] != "AV"], "no track 'AV', the vehicle that recorded"),
        (lambda t: t[:0], "no rows"),
        (lambda t: t.assign(object_type="hovercraft"), "field 'object_type' must be one of Argoverse 2"),
        (lambda t: t.assign(timestep=t["timestep"] + 0.5), "field 'timestep' must be a whole number"),
        (lambda t: t.assign(timestep=-1.0), "field 'timestep' must be 0 to"),
        (lambda t: t.assign(timestep=1e12), "field 'timestep' must be 0 to"),
        (lambda t: t.assign(timestep=np.nan), "field 'timestep' must be 0 to"),
        (lambda t: pd.concat([t, t]), "field 'timestep' must be there once for track AV"),
        (lambda t: t.assign(position_x=np.inf), "field 'position_x' must be finite"),
        (lambda t: t.assign(position_y="north"), "column 'position_y' holds no numbers"),
    ],
)
def test_faults_are_one_line(
    tmp_path: Path, spoil: Callable[[pd.DataFrame], pd.DataFrame], complaint: str
) -> None:
    path = write(tmp_path, spoil(tracks()))
    with pytest.raises(DatasetError, match=complaint) as fault:
        read_dataset(tmp_path)
    assert str(path) in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_file_that_is_none(tmp_path: Path) -> None:
    path = tmp_path / "scenario_x.parquet"
    path.write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match="not a readable Parquet file"):
        read_dataset(path)


def test_a_published_scenario() -> None:
    if not SHARED.is_dir():
        pytest.skip("the scenario of Argoverse 2 is not in ../shared/argoverse2")
    data = read_dataset(SHARED)
    [sequence] = data.sequences
    # rows of the file without 110 of AV, 22 of background and 167 of static
    assert (len(sequence), len(sequence.labels or ())) == (110, 2434 - 110 - 22 - 167)
    assert sequence.map_path is not None
    network = load_drive_map(sequence.map_path)
    assert network.nearest_lane(sequence.ego_xy_yaw()[:, :2]).distance_m.max() == 0.0
    # 5.18 m/s on average over 10.9 s by the recorded velocities, less where the ends are smoothed
    assert motion_of(sequence, 4.9, 2.0).ego.driven_m == pytest.approx(5.18 * 10.9, rel=0.05)
    assert [note for note in data.notes if "4.3 m/s off" in note]
