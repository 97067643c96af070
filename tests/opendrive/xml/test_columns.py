import dataclasses
import pickle

import numpy as np
import pytest

from opendrive import MapContentError, load_map, read_map
from opendrive.roads.geometry import NetworkGeometry

# What is out of order is read record by record.
LEAST_SHARE = 0.9
CROSSFALL = '<crossfall s="{s}" a="{a}" b="0" c="0" d="0" side="{side}"/>'
SHAPE = '<shape s="{s}" t="{t}" a="0.1" b="0.01" c="0" d="0"/>'
LATERAL = "<lateralProfile>{}</lateralProfile><lanes>"
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
        ('<lane id="-1"', '<lane id="-1"/><lane id="-1"'),
        ("<lanes>", LATERAL.format(CROSSFALL.format(s=0, a=0, side="up"))),
        ("<lanes>", LATERAL.format(SHAPE.format(s=0, t=1) + SHAPE.format(s=0, t=-1))),
        ("<lanes>", f"<lanes>{OFFSET.format(s=9)}{OFFSET.format(s=0)}"),
    ],
)
def test_odd_maps_are_read_by_their_records(tmp_path, text, old, new):
    content = text.document(text.road())
    file = tmp_path / "odd.xodr"
    file.write_text(content.replace(old, new, 1), encoding="utf-8")
    if new.startswith("<planView/>") or 'side="up"' in new:
        with pytest.raises(MapContentError, match=r"no <geometry>|'side' is 'up'"):
            load_map(file)
    else:
        network = load_map(file)
        assert network.model.roads.geometry is None
        assert len(network.lanes) == 2


@pytest.mark.parametrize(
    ("old", "new", "kinds"),
    [
        ("<line/>", '<arc curvature="0"/>', ["arc without curvature"]),
        ("<line/>", '<spiral curvStart="0.01" curvEnd="0.01"/>', ["constant spiral"]),
        (
            "<lanes>",
            LATERAL.format(
                CROSSFALL.format(s=0, a=0.01, side="left")
                + CROSSFALL.format(s=0, a=0.02, side="right")
                + CROSSFALL.format(s=50, a=0.03, side="both")
            ),
            [],
        ),
        (
            "<lanes>",
            LATERAL.format("".join(SHAPE.format(s=s, t=t) for s in (0, 60) for t in (-4, 0, 3))),
            [],
        ),
    ],
)
def test_crossfall_shapes_and_what_is_tolerated_are_read_in_columns(tmp_path, text, old, new, kinds):
    """With two roads of which one has it; the warnings are those of the records, once each."""
    plain = text.road(road_id="plain")
    file = tmp_path / "odd.xodr"
    file.write_text(text.document(plain + text.road().replace(old, new, 1)), encoding="utf-8")
    network = load_map(file)
    geometry = network.model.roads.geometry
    assert geometry is not None
    assert_equal_tables(geometry, NetworkGeometry.collect(tuple(network.model.roads.values())))
    assert [warning.kind.value for warning in network.model.warnings] == kinds
