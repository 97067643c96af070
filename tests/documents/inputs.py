"""Small inputs for the examples of the documentation, under the names that these use."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import pytest
from rosbags.rosbag2 import Writer

from opendrive import load_map, write_map
from scenarios.catalogue.maps import shipped_map
from scenarios.ros.definitions import ODOMETRY, PREDICTION_ARRAY, ros2_types
from scenarios.ros.making import rosbags_make
from tests.documents.blocks import ROOT, blocks, python_of

DEFINITIONS = ROOT / "scenarios" / "definitions"
FRAMES = 60


def write_inputs(folder: Path) -> None:
    """Write maps, recordings and objects of a user's own into a folder."""
    write_scenario(folder)
    write_map(load_map(shipped_map("urban_intersection")).model, folder / "Town01.xodr")
    write_map(load_map(shipped_map("urban_intersection")).model, folder / "Town10HD.xodr")
    (folder / "docs").symlink_to(ROOT / "docs")
    (folder / "my_tracker.py").write_text(python_of("docs/howto/tracking.md")[1], encoding="utf-8")
    modules = zip(("my_sensor", "", "my_area", "my_rule"), python_of("docs/plugins.md"), strict=False)
    for module, code in modules:
        if module:
            (folder / f"{module}.py").write_text(code, encoding="utf-8")
    # a distribution over a scenario of ours, in place of one of Euro NCAP's
    variation = (DEFINITIONS / "cpna.xosc").read_text(encoding="utf-8")
    variation = variation.replace('"crossing.xosc"', f'"{DEFINITIONS / "crossing.xosc"}"')
    variation = variation.replace('lowerLimit="10"', 'lowerLimit="60"')
    (folder / "NCAP_AEB_VRU_CPNA-25_Variation_2023.xosc").write_text(variation, encoding="utf-8")
    shutil.copytree(ROOT / "tests" / "data" / "simbev", folder / "data")
    _write_kitti(folder / "kitti" / "training")
    _write_table(folder / "my_csv_folder")
    for name in ("recording", "my_drive", "my_bag"):
        _write_bag(folder / name)


def write_scenario(folder: Path) -> None:
    """The scenario of the page on one's own, and its map, whose road is number 12."""
    street = shipped_map("urban_street").read_text(encoding="utf-8")
    (folder / "town.xodr").write_text(re.sub(r'(<road [^>]*\bid=)"1"', r'\1"12"', street), encoding="utf-8")
    (scenario,) = (block.code for block in blocks("docs/howto/scenario.md") if block.language == "xml")
    (folder / "child.xosc").write_text(scenario, encoding="utf-8")


def run_command(patch: pytest.MonkeyPatch, words: list[str]) -> int:
    """Exit status of `smartmot-eval` with some words, in this process."""
    from evaluation.cli import main

    patch.setattr(sys, "argv", ["smartmot-eval", *words])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def _write_kitti(folder: Path) -> None:
    """Two sequences: a car 20 m ahead at the ego's 5 m/s, and a pedestrian beside the road."""
    for part in ("label_02", "detections", "ego_pose"):
        (folder / part).mkdir(parents=True)
    for sequence in ("0001", "0014"):
        labels, detections, poses = [], [], []
        for frame in range(FRAMES):
            # camera: x right, y down, z ahead; boxes as height, width, length
            for number, kind, size, x_m, z_m in (
                (0, "Car", "1.5 1.8 4.4", 0.0, 20.0),
                (1, "Pedestrian", "1.7 0.6 0.6", 4.0, 40.0 - 0.5 * frame),
            ):
                box = f"{kind} 0 0 -1.5 500 150 600 250 {size} {x_m} 1.6 {z_m} -1.57"
                labels.append(f"{frame} {number} {box}")
                detections.append(f"{frame} -1 {box} 0.9")
            poses.append(f"1 0 0 0 0 1 0 0 0 0 1 {0.5 * frame}")
        for part, lines in (("label_02", labels), ("detections", detections), ("ego_pose", poses)):
            (folder / part / f"{sequence}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_table(folder: Path) -> None:
    """A car at 10 m/s, detected, labelled, and the ego behind it."""
    folder.mkdir()
    times = [k / 10 for k in range(FRAMES)]
    tables = {
        "detections.csv": ["sequence,stamp_s,x_m,y_m,length_m,width_m,yaw_rad,score,category"]
        + [f"0001,{t},{40 + 10 * t},-1.75,4.5,1.8,0,0.9,car" for t in times],
        "labels.csv": ["sequence,stamp_s,track_id,x_m,y_m,length_m,width_m,yaw_rad,category"]
        + [f"0001,{t},1,{40 + 10 * t},-1.75,4.5,1.8,0,car" for t in times],
        "ego.csv": ["sequence,stamp_s,x_m,y_m,yaw_rad"] + [f"0001,{t},{10 + 10 * t},-1.75,0" for t in times],
    }
    for name, lines in tables.items():
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_bag(folder: Path) -> None:
    """A vehicle at 10 m/s, and a pedestrian who walks into its way."""
    types = ros2_types()
    make = rosbags_make(types)
    with Writer(folder, version=9) as bag:
        poses, boxes = (
            bag.add_connection(topic, kind, typestore=types)
            for topic, kind in (("/localization/pose", ODOMETRY), ("/bevfusion_detections", PREDICTION_ARRAY))
        )
        for k in range(FRAMES):
            stamp = make("builtin_interfaces/msg/Time", sec=1 + k // 20, nanosec=k % 20 * 50_000_000)
            header = make("std_msgs/msg/Header", stamp=stamp)
            pose = make(ODOMETRY, header=header, child_frame_id="base_link")
            pose.pose.pose.position = make("geometry_msgs/msg/Point", x=10.0 + 0.5 * k, y=-1.75)
            pose.pose.pose.orientation = make("geometry_msgs/msg/Quaternion", w=1.0)
            pose.twist.twist.linear = make("geometry_msgs/msg/Vector3", x=10.0)
            walker = make("bevfusion_msgs/msg/Prediction", class_name="pedestrian", score=0.9)
            walker.position = make("geometry_msgs/msg/Point", x=30.0 - 0.5 * k, y=0.07 * k - 4.2)
            walker.size = make("geometry_msgs/msg/Vector3", x=0.5, y=0.5, z=1.7)
            seen = make(PREDICTION_ARRAY, header=header, predictions=[walker])
            for topic, message in ((poses, pose), (boxes, seen)):
                bag.write(topic, 1_000_000_000 + 50_000_000 * k, types.serialize_cdr(message, topic.msgtype))
