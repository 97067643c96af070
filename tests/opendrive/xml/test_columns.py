import dataclasses
import pickle

import numpy as np
import pytest

from opendrive import MapContentError, load_map, read_map
from opendrive.roads.geometry import NetworkGeometry

# Crossfall, lateral shape, constant spirals, arcs without curvature and the like are read record by record.
LEAST_SHARE = 0.7
OFFSET = '<laneOffset s="{s}" a="1" b="0" c="0" d="0"/>'


def leaves(value, name=""):
    """Yield every array and plain value of nested tables, with its name."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from leaves(getattr(value, field.name), f"{name}.{field.name}")
    elif hasattr(value, "_fields"):
        for field in value._fields:
            yield from leaves(getattr(value, field), f"{name}.{field}")
    else:
        yield name, value


def assert_equal_tables(first, second):
    for (name, one), (_, other) in zip(leaves(first), leaves(second), strict=True):
        if isinstance(one, np.ndarray):
            assert one.dtype == other.dtype, name
            np.testing.assert_array_equal(one, other, err_msg=name)
        else:
            assert one == other, name


def test_columns_equal_what_the_records_give(shared, map_name):
    model = read_map(shared / "maps" / f"{map_name}.xodr")
    by_records = NetworkGeometry.collect(tuple(model.roads.values()))
    if model.roads.geometry is not None:
        assert_equal_tables(model.roads.geometry, by_records)


def test_most_maps_are_read_in_columns(network_of, shared):
    names = [file.stem for file in (shared / "maps").glob("*.xodr")]
    in_columns = [name for name in names if network_of(name).model.roads.geometry is not None]
    assert len(in_columns) >= LEAST_SHARE * len(names)
    assert {"Town01", "Town03", "Town04"} <= set(in_columns)


def test_a_road_is_read_when_asked_for_and_once(network_of):
    roads = network_of("Town01").model.roads
    assert roads["0"] is roads["0"]
    assert list(roads) == list(network_of("Town01").roads)
    assert "no such road" not in roads


def test_a_pickled_network_is_the_same(network_of):
    network = network_of("esmini_fabriksgatan")
    assert_equal_tables(pickle.loads(pickle.dumps(network))._geometry, network._geometry)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('hdg="0.3"', 'hdg="up"'),
        ('length="100"', 'length="-1"'),
        ("<line/>", '<arc curvature="1e9"/>'),
        ('id="-1"', 'id="1"'),
        ('id="1" type', 'number="1" type'),
        ('a="3.5"', 'a="1e10"'),
        ('a="3.5"', ""),
        ('<laneSection s="0.0">', "<laneSection>"),
        ('<laneSection s="0.0">', '<laneSection s="900">'),
    ],
)
def test_what_is_wrong_in_a_clean_looking_map_is_named_at_once(load, text, old, new):
    clean = text.document(text.road(road_id="seven"))
    assert load(clean, whole=True).model.roads.geometry is not None
    assert old in clean
    with pytest.raises(MapContentError, match=r"road 'seven', <\w+>, line \d+: "):
        load(clean.replace(old, new, 1), whole=True)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<planView>", "<planView/><planView>"),
        ("<line/>", '<arc curvature="0"/>'),
        ('<lane id="-1"', '<lane id="-1"/><lane id="-1"'),
        ("<lanes>", '<lateralProfile><crossfall s="0" a="0" b="0" c="0" d="0"/></lateralProfile><lanes>'),
        ("<lanes>", f"<lanes>{OFFSET.format(s=9)}{OFFSET.format(s=0)}"),
    ],
)
def test_odd_maps_are_read_by_their_records(tmp_path, text, old, new):
    content = text.document(text.road())
    file = tmp_path / "odd.xodr"
    file.write_text(content.replace(old, new, 1), encoding="utf-8")
    if new.startswith("<planView/>"):
        with pytest.raises(MapContentError, match="no <geometry>"):
            load_map(file)
    else:
        network = load_map(file)
        assert network.model.roads.geometry is None
        assert len(network.lanes) == 2
