"""Options of a LiDAR: what is typed, and what does not go together."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from evaluation.cli.options import parse_lidar, parse_vary
from evaluation.errors import ArgumentError
from evaluation.runs.specs import UPPER_BOUND, lidar_notes
from evaluation.studies.compare.grid import Point
from evaluation.studies.compare.study import SceneStudy
from scenarios.presets import PHYSICAL
from scenarios.settings import preset_with
from smartmot.errors import ConfigError
from smartmot.lidar.learned import Decoder, PillarGrid
from tests.networks import upright_network


def test_what_is_typed_is_set() -> None:
    assert parse_lidar("truth", None, None, None, None) == ()
    typed = parse_lidar("hdl32", "cutout", "furnished", 4.0, 3)
    assert dict(typed) == {
        "sensor": "hdl32", "perception": "cutout", "street": "furnished", "street_density": 4.0,
        "street_seed": 3.0,
    }  # fmt: skip
    assert parse_lidar("mid70", "my_detector:Clouds", None, None, None)[1] == (
        "perception",
        "my_detector:Clouds",
    )


def test_a_network_is_set_with_its_hash(tmp_path: Path) -> None:
    file = tmp_path / "net.onnx"
    file.write_bytes(upright_network(Decoder(PillarGrid(), ("car", "pedestrian"))))
    known = f"{file}@{hashlib.sha256(file.read_bytes()).hexdigest()[:12]}"
    typed = parse_lidar("hdl64", str(file), None, None, None)
    assert typed == (("sensor", "hdl64"), ("perception", known))
    varied = parse_vary([f"perception=classical,{file},{file}_monitored"])
    assert varied == {"perception": ("classical", known, known.replace("@", "_monitored@"))}
    (line, bound) = lidar_notes(preset_with(PHYSICAL, typed))
    assert f"detections by {known}: it knows car, pedestrian from 0 to 44.8 m ahead" in line
    assert bound == UPPER_BOUND
    preset = preset_with(PHYSICAL, typed)
    file.unlink()
    assert lidar_notes(preset) == [line, bound]
    with pytest.raises(ConfigError, match=r"net.onnx: cannot be read: No such file"):
        parse_lidar("hdl64", str(file), None, None, None)


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        (("hdl16", None, None, None, None), "--sensor: unknown 'hdl16' .*; use one of: truth, hdl32"),
        (("truth", "cutout", None, None, None), "--perception: for a LiDAR; add --sensor hdl32"),
        (("truth", None, "furnished", None, None), "--street: for a LiDAR"),
        (("hdl32", "nets", None, None, None), "--perception: unknown 'nets'.*, FILE.onnx or package.module"),
        (("hdl32", None, None, None, 3), "--street-seed: add --street furnished"),
        (("hdl32", None, "bare", 8.0, None), "--street-density: add --street furnished"),
    ],
)
def test_mistakes_are_named(typed: tuple[str, str, str, float, int], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        parse_lidar(*typed)


def test_what_is_varied_is_not_given_a_second_time() -> None:
    with pytest.raises(ArgumentError, match="--sensor: --vary sensor gives its values"):
        parse_lidar("hdl32", None, None, None, None, ("sensor",))
    varied = parse_lidar("truth", "cutout", None, None, None, ("sensor",))
    assert varied == (("perception", "cutout"),)


def test_the_truth_is_one_point_whatever_is_varied_of_a_lidar() -> None:
    vary = {"sensor": ("truth", "mid70"), "perception": ("cutout", "labels"), "street": ("bare", "furnished")}
    points = SceneStudy(("map",), "physical", vary=vary).points
    sensors = [dict(point.settings)["sensor"] for point in points]
    assert sorted(sensors) == ["mid70"] * 4 + ["truth"]
    common = (("sensor", "mid70"), ("street", "furnished"))
    points = SceneStudy(("map",), "physical", vary={"perception": ("cutout",)}, common=common).points
    assert [dict(point.settings).get("sensor") for point in points] == [None]
    assert Point("map", points[0].settings).text.startswith("perception=cutout")


def test_a_perception_is_varied_of_a_lidar_alone() -> None:
    with pytest.raises(ArgumentError, match="--vary perception=cutout: perception is for a LiDAR"):
        _ = SceneStudy(("map",), "physical", vary={"perception": ("cutout",)}).points


def test_the_reader_is_given_rate_range_street_and_the_bound() -> None:
    settings = (("sensor", "hdl64"), ("perception", "cutout"), ("street", "furnished"), ("street_seed", 7.0))
    first, bound = lidar_notes(preset_with(PHYSICAL, settings))
    for part in ("hdl64: 10 clouds", "up to 70 m", "8 pieces", "seed 7", "detections by cutout"):
        assert part in first
    assert bound == UPPER_BOUND
    assert lidar_notes(PHYSICAL) == []
