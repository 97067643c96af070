from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest

from opendrive import OpenDriveError, load_map, read_map, write_map
from opendrive.model import Deferred, MapModel

SHIPPED = sorted((Path(__file__).parents[3] / "scenarios" / "maps").glob("*.xodr"))


def assert_equal(got, expected, where="map"):
    """Compare records, however deep, and say where they differ."""
    if isinstance(expected, Deferred):
        assert_equal(got(), expected(), where)
    elif is_dataclass(expected):
        assert type(got) is type(expected), where
        for field in fields(expected):
            if field.name != "noted":
                name = f"{where}.{field.name}"
                assert_equal(getattr(got, field.name), getattr(expected, field.name), name)
    elif isinstance(expected, np.ndarray):
        np.testing.assert_array_equal(got, expected, err_msg=where)
    elif hasattr(expected, "keys"):
        assert list(got) == list(expected), where
        for key in expected:
            assert_equal(got[key], expected[key], f"{where}[{key!r}]")
    elif isinstance(expected, tuple):
        assert len(got) == len(expected), where
        for i, (one, other) in enumerate(zip(got, expected, strict=True)):
            assert_equal(one, other, f"{where}[{i}]")
    else:
        assert got == expected, where


def rewritten(model: MapModel, tmp_path: Path) -> MapModel:
    write_map(model, tmp_path / "written.xodr")
    return read_map(tmp_path / "written.xodr")


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_shipped_map_is_read_again_as_it_was(tmp_path, file):
    network = load_map(file)
    write_map(network, tmp_path / "written.xodr")
    assert_equal(read_map(tmp_path / "written.xodr"), network.model)


def test_a_reference_map_is_read_again_as_it_was(shared, tmp_path, map_name):
    model = read_map(shared / "maps" / f"{map_name}.xodr")
    again = rewritten(model, tmp_path)
    assert_equal(again, model)
    assert len(again.roads) > 0


def test_a_folder_cannot_be_written(tmp_path, text):
    file = tmp_path / "map.xodr"
    file.write_text(text.document(text.road()), encoding="utf-8")
    with pytest.raises(OpenDriveError, match="cannot be written"):
        write_map(load_map(file), tmp_path)
