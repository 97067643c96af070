"""What a kept run is known by: every file that reading its scenario touches."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.runs.fingerprint import file_digest, fingerprint
from scenarios.catalogue.library import DEFINITIONS
from scenarios.errors import ScenarioError
from scenarios.settings import PARAMETERS
from scenarios.spec import RunSpec
from smartmot.errors import ConfigError
from smartmot.lidar.learned import Decoder, PillarGrid
from tests.networks import upright_network


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The shipped scenarios and maps, to be changed."""
    shutil.copytree(DEFINITIONS.parent / "maps", tmp_path / "maps")
    shutil.copytree(DEFINITIONS, tmp_path / "definitions")
    return tmp_path


@pytest.fixture
def spec(folder: Path) -> RunSpec:
    file = str(folder / "definitions" / "crossing.xosc")
    return RunSpec("x", file, (("Ego_speed_kmh", 50.0),), "map", "physical", "dry", 50.0)


def touched(path: Path) -> None:
    path.write_text(path.read_text() + "<!-- -->")


def test_the_map_that_a_scenario_names_itself_belongs_to_the_run(folder: Path, spec: RunSpec) -> None:
    before = fingerprint(spec)
    street = folder / "maps" / "urban_street.xodr"
    street.write_text(street.read_text().replace('a="3.5"', 'a="3.0"'))
    assert fingerprint(spec) != before


def test_the_map_of_perception_belongs_to_the_run(folder: Path, spec: RunSpec) -> None:
    street = folder / "maps" / "bend_30.xodr"
    shutil.copy(folder / "maps" / "urban_street.xodr", street)
    spec = replace(spec, map_name=str(street))
    before = fingerprint(spec)
    touched(street)
    assert fingerprint(spec) != before


@pytest.mark.parametrize(
    "change",
    [
        lambda catalogs: touched(catalogs / "vehicles" / "vehicles.xosc"),
        lambda catalogs: touched(catalogs / "pedestrians" / "pedestrians.xosc"),
        lambda catalogs: shutil.copy(
            catalogs / "vehicles" / "vehicles.xosc", catalogs / "vehicles" / "a_first.xosc"
        ),
    ],
)
def test_catalogs_belong_to_the_run(folder: Path, spec: RunSpec, change: Callable[[Path], object]) -> None:
    before = fingerprint(spec)
    change(folder / "definitions" / "catalogs")
    assert fingerprint(spec) != before


def test_where_the_files_lie_is_no_matter(folder: Path, spec: RunSpec, tmp_path: Path) -> None:
    shutil.copytree(folder / "maps", tmp_path / "other" / "maps")
    shutil.copytree(folder / "definitions", tmp_path / "other" / "definitions")
    moved = str(tmp_path / "other" / "definitions" / "crossing.xosc")
    assert fingerprint(replace(spec, file=moved)) == fingerprint(spec)


def test_a_network_is_its_content_whatever_its_file_is_called(spec: RunSpec, tmp_path: Path) -> None:
    def key(path: Path, pinned: bool = False, after: str = "") -> str:
        name = f"{path}{after}"
        name = PARAMETERS["perception"].known_as(name) if pinned else name
        return fingerprint(replace(spec, settings=(("sensor", "mid70"), ("perception", name))))

    decoder = Decoder(PillarGrid(), ("car", "pedestrian", "cyclist"))
    first, second = tmp_path / "a.onnx", tmp_path / "b.onnx"
    first.write_bytes(upright_network(decoder))
    shutil.copy(first, second)
    before = key(first)
    assert key(second) == key(first, pinned=True) == before
    assert key(first, after="_monitored") != before
    pinned = PARAMETERS["perception"].known_as(str(first))
    first.write_bytes(upright_network(decoder, slope=3.0))
    assert key(first) != before
    assert key(first, pinned=True) == key(first)
    assert key(second) == before
    with pytest.raises(ConfigError, match="it has changed since it was named"):
        fingerprint(replace(spec, settings=(("sensor", "mid70"), ("perception", pinned))))


def test_a_file_of_the_same_length_and_another_time_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("one")
    before = file_digest(path)
    # SHA-256 of "one", by sha256sum
    assert before == "7692c3ad3540bb803c020b3aee66cd8887123234ea0c6e7143c0add73ff431ed"
    path.write_text("two")
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1))
    assert file_digest(path) != before


def test_a_file_that_is_gone_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"gone: No such file or directory$"):
        file_digest(tmp_path / "gone")
