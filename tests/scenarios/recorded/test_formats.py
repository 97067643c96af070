"""Which format a folder has."""

import shutil
from pathlib import Path

import pytest

from scenarios.errors import DatasetError
from scenarios.recorded.formats import FORMATS, read_dataset
from tests.scenarios.recorded import argoverse_log
from tests.scenarios.ros import bags_made

HEADER = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad\n"


def test_the_files_show_the_format(tmp_path: Path) -> None:
    folders = {name: tmp_path / name for name in FORMATS}
    for folder in folders.values():
        folder.mkdir()
    (folders["kitti"] / "detections").mkdir()
    (folders["kitti"] / "detections" / "0000.txt").write_text("")
    (folders["csv"] / "detections.csv").write_text(f"{HEADER}0,1,0,4,2,0\n")
    (folders["nuscenes"] / "found.json").write_text('{"results": {"a": []}}')
    (folders["simbev"] / "infos").mkdir()
    (folders["simbev"] / "infos" / "simbev_infos_val.json").write_text('{"data": {}}')
    argoverse_log.log(folders["argoverse"])
    shutil.copytree(bags_made.MCAP, folders["bag"], dirs_exist_ok=True)
    assert {name: read_dataset(folder).kind for name, folder in folders.items()} == {
        name: name for name in FORMATS
    }
    for file in (folders["csv"] / "detections.csv", folders["nuscenes"] / "found.json"):
        assert read_dataset(file).kind == file.parent.name


def test_the_user_s_word_goes_before_what_the_files_show(tmp_path: Path) -> None:
    (tmp_path / "detections").mkdir()
    (tmp_path / "detections.csv").write_text(f"{HEADER}0,1,0,4,2,0\n")
    assert read_dataset(tmp_path, "csv").kind == "csv"


def test_a_folder_that_is_nothing_of_that_kind(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"no detections/ \(kitti\), detections.csv \(csv\)"):
        read_dataset(tmp_path)
    with pytest.raises(DatasetError, match="nowhere: no such folder or file"):
        read_dataset(tmp_path / "nowhere")
