"""What travels with an item, and where its paths lead when it has arrived."""

from __future__ import annotations

import hashlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.errors import WorkerError
from evaluation.runs.cluster.on_worker import _with_moved_references
from evaluation.runs.cluster.parcel import (
    DISTRIBUTION,
    PLUGIN,
    content,
    pack,
    pack_result,
    state,
    unpack,
)
from evaluation.runs.cluster.surroundings import ARITHMETIC, SHIPPED, differences, surroundings
from scenarios.catalogue.library import DEFINITIONS
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import ScenarioError
from scenarios.spec import RunSpec
from smartmot import plugins
from smartmot.errors import PluginError
from smartmot.lidar.learned import shipped_path

WEIGHTS = shipped_path("pillars")


def spec(file: str, **changes: object) -> RunSpec:
    values = {"parameters": (), "strategy": "map", "preset": "physical", "weather": "dry", "v_test_kmh": 50.0}
    return RunSpec("run", file, **(values | changes))  # type: ignore[arg-type]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A user's folder: scenarios, catalogs, a map, a tracker with a helper, a package, a network."""
    own = tmp_path / "own"
    shutil.copytree(DEFINITIONS, own / "scenarios")
    (own / "maps").mkdir()
    shutil.copy(shipped_map("urban_street"), own / "maps" / "street.xodr")
    shutil.copy(WEIGHTS, own / "net.onnx")
    (own / "tracker_p.py").write_text("import helper_p\n\ndef make():\n    return helper_p\n")
    (own / "helper_p.py").write_text("VALUE = 1\n")
    (own / "package_p").mkdir()
    (own / "package_p" / "__init__.py").write_text("def make():\n    return None\n")
    (own / "package_p" / "weights.bin").write_bytes(b"\0\1")
    monkeypatch.chdir(own)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield own
    for name in ("tracker_p", "helper_p", "package_p"):
        sys.modules.pop(name, None)


def test_a_shipped_run_takes_nothing_along() -> None:
    run = spec("cpna_paper", parameters=(("Map", "../maps/urban_street.xodr"),), map_name="urban_street")
    parcel = pack(run)
    assert (parcel.files, parcel.needs) == ({}, {})
    assert unpack(parcel.packed) == run


def test_an_object_of_this_process_is_refused() -> None:
    class Own:
        def update(self, detections: object) -> None: ...

    with pytest.raises(PluginError, match=r"object:Own.*does not travel"):
        pack(spec("crossing", settings=(("tracker", plugins.name_for(Own, "update")),)))


@pytest.mark.parametrize("absolute", [False, True])
def test_own_scenario_catalogs_maps_and_network_travel(folder: Path, absolute: bool) -> None:
    pytest.importorskip("onnxruntime")
    at = (lambda text: str(folder / text)) if absolute else str
    run = spec(
        at("scenarios/cpna_paper.xosc"),
        parameters=(("Map", "../maps/street.xodr"),),
        map_name=at("maps/street.xodr"),
        settings=(("sensor", "hdl32"), ("perception", at("net.onnx") + "_monitored")),
    )
    parcel = pack(run)
    names = {Path(path).relative_to(folder).as_posix() for path in parcel.files}
    assert {"scenarios/cpna_paper.xosc", "maps/street.xodr", "net.onnx"} < names
    assert any(name.startswith("scenarios/catalogs/") for name in names)
    for path, digest in parcel.files.items():
        assert digest == hashlib.sha256(Path(path).read_bytes()).hexdigest()
    moved = unpack(parcel.packed, "/root", parcel.files)
    before = "/root" if absolute else ""
    assert moved.file == before + run.file
    assert moved.map_name == before + str(run.map_name)
    assert moved.settings == (("sensor", "hdl32"), ("perception", before + str(run.settings[1][1])))
    assert unpack(pack_result(moved, "/root")) == run


def test_a_plug_in_brings_what_was_loaded_beside_it_and_a_package_all_its_files(folder: Path) -> None:
    parcel = pack([spec("crossing", settings=(("tracker", "tracker_p:make"),)), "package_p:make"])
    names = {Path(path).relative_to(folder).as_posix() for path in parcel.files}
    assert names == {"tracker_p.py", "helper_p.py", "package_p/__init__.py", "package_p/weights.bin"}
    assert set(parcel.folders) == {str(folder)}
    assert {name for kind, name in parcel.needs if kind == PLUGIN} == {"tracker_p:make", "package_p:make"}
    assert all(state(need) == value for need, value in parcel.needs.items())


def test_a_changed_plug_in_is_another(folder: Path) -> None:
    ((need, digest),) = pack("package_p:make").needs.items()
    assert state(need) == digest
    (folder / "package_p" / "weights.bin").write_bytes(b"\0\2")
    plugins._digest.cache_clear()  # as in the next process
    assert state(need) not in ("", digest)


def test_texts_that_only_look_like_plug_ins_stay_texts() -> None:
    parcel = pack(["not_installed_q:name", "12:30", "a: b", "smartmot.tracking:Tracker"])
    assert (parcel.files, parcel.needs) == ({}, {})


def test_what_is_missing_is_an_error_here(folder: Path) -> None:
    with pytest.raises(ScenarioError):
        pack(spec("missing.xosc"))
    (digest,) = {pack(Path("net.onnx")).files[str(folder / "net.onnx")]}
    (folder / "net.onnx").write_bytes(b"other")
    with pytest.raises(WorkerError, match=r"net\.onnx: was changed while"):
        content(str(folder / "net.onnx"), digest)
    (folder / "net.onnx").unlink()
    with pytest.raises(WorkerError, match=r"net\.onnx: cannot be read any more"):
        content(str(folder / "net.onnx"), digest)


def test_needs_that_a_worker_has_not_are_empty() -> None:
    assert state((DISTRIBUTION, "not-installed-q")) == ""
    assert state((PLUGIN, "not_installed_q:x")) == ""


VALUES = st.text() | st.integers() | st.floats(allow_nan=False)


@given(st.recursive(VALUES, lambda part: st.lists(part) | st.tuples(part)))
def test_a_value_arrives_as_it_was_sent(value: object) -> None:
    parcel = pack(value)
    assert unpack(parcel.packed, "/root", parcel.files) == value
    assert unpack(pack_result(value, "\0/root")) == value


def test_errors_come_back_with_paths_as_they_are_at_the_caller() -> None:
    error = unpack(
        pack_result(ScenarioError("/tmp/m/17/home/u/a.xosc: bad; see /tmp/m/17/home/u/b"), "/tmp/m/17")
    )
    assert type(error) is ScenarioError
    assert str(error) == "/home/u/a.xosc: bad; see /home/u/b"


def test_absolute_references_of_a_scenario_lead_into_the_mirror() -> None:
    text = b'<a file="/home/u&amp;v/m.xodr"/><b file="/home/u/m.xodr2"/><c file="m.xodr"/>'
    moved = _with_moved_references(text, {"/home/u&v/m.xodr": "", "/home/u/m.xodr": ""}, "/r")
    assert moved == b'<a file="/r/home/u&amp;v/m.xodr"/><b file="/home/u/m.xodr2"/><c file="m.xodr"/>'


def test_another_surrounding_is_told_by_name_and_both_values() -> None:
    here = surroundings()
    assert differences(here, surroundings()) == ""
    python = "CPython {}.{}".format(*sys.version_info[:2])
    assert here["Python"] == python
    told = differences(here, here | {"numpy": "0.9", "Python": "PyPy 3.11"})
    assert told == f"Python PyPy 3.11, here {python}; numpy 0.9, here {here['numpy']}"
    assert "networks are others there" in differences(here, here | {SHIPPED: "0"})
    assert "last digits" in differences(here, here | {ARITHMETIC: "0"})
    assert differences({"smartmot": "1+a"}, {}) == "smartmot none, here 1+a"
