import dataclasses
import pickle

import numpy as np
import pytest

from opendrive import MapContentError, load_map, read_map
from opendrive.roads.geometry import NetworkGeometry
from opendrive.xml import columns
from opendrive.xml.document import parse
from opendrive.xml.roads import read_road
from opendrive.xml.values import Values

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
    assert_equal_tables(model.roads.geometry, by_records)


def test_only_odd_roads_are_read_by_their_records(tmp_path, text, monkeypatch):
    """Of three roads, one with two links: the others are read when they are asked for."""
    names = ("first", "odd", "last")
    roads = [text.road(road_id=name) for name in names]
    roads[1] = roads[1].replace("<planView>", "<link/><planView>", 1)
    file = tmp_path / "odd.xodr"
    file.write_text(text.document("".join(roads)), encoding="utf-8")
    read = []
    monkeypatch.setattr(
        columns, "read_road", lambda values, road: read.append(road.get("id")) or read_road(values, road)
    )
    network = load_map(file)
    assert read == ["odd"]
    assert_equal_tables(
        network.model.roads.geometry, NetworkGeometry.collect(tuple(network.model.roads.values()))
    )
    assert [(w.kind.value, w.road_id) for w in network.model.warnings] == [("ignored", "odd")]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<lanes>", f"<lanes>{OFFSET.format(s=9)}{OFFSET.format(s=0)}{OFFSET.format(s=4)}"),
        ("<lanes>", LATERAL.format(SHAPE.format(s=0, t=1) + SHAPE.format(s=0, t=-1))),
        ("<lanes>", LATERAL.format("".join(CROSSFALL.format(s=s, a=0, side="left") for s in (5, 0)))),
        (
            "</lane>",
            '<width sOffset="3" a="1" b="0" c="0" d="0"/><width sOffset="2" a="1" b="0" c="0" d="0"/></lane>',
        ),
    ],
)
def test_records_out_of_order_are_sorted_without_their_record(tmp_path, text, monkeypatch, old, new):
    """In every road, with the warning that the record's reader gives."""
    roads = [text.road(road_id=name).replace(old, new, 1) for name in ("first", "second")]
    file = tmp_path / "odd.xodr"
    file.write_text(text.document("".join(roads)), encoding="utf-8")
    with monkeypatch.context() as patched:
        patched.delattr(columns, "read_road")
        network = load_map(file)
    assert_equal_tables(
        network.model.roads.geometry, NetworkGeometry.collect(tuple(network.model.roads.values()))
    )
    values = Values(str(file))
    for element in parse(file, file.read_bytes()).iter("road"):
        read_road(values, element)
    assert [w.kind.value for w in values.warnings] == ["order", "order"]
    assert list(network.model.warnings) == values.warnings


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
    assert len(load(clean, whole=True).lanes) == 2
    assert old in clean
    with pytest.raises(MapContentError, match=r"road 'seven', <\w+>, line \d+: "):
        load(clean.replace(old, new, 1), whole=True)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('<lane id="-1"', '<lane id="-1"/><lane id="-1"'),
        ('<lane id="-1"', '<lane id="-45"'),
        ("</lane>", '<height sOffset="0" inner="0.1"/></lane>'),
        ("<lanes>", LATERAL.format(SHAPE.format(s=0, t=1) + SHAPE.format(s=0, t=-1))),
        ("<lanes>", f"<lanes>{OFFSET.format(s=9)}{OFFSET.format(s=0)}"),
        ("<laneSection", '<laneSection s="400"/><laneSection'),
        ("<planView>", "<link><successor elementType='road'/></link><planView>"),
        ("<planView>", "<link/><link/><planView>"),
    ],
)
def test_odd_roads_are_as_their_records_say(tmp_path, text, old, new):
    """Between two roads that are not odd."""
    odd = text.road().replace(old, new, 1)
    assert odd != text.road()
    file = tmp_path / "odd.xodr"
    file.write_text(
        text.document(text.road(road_id="first") + odd + text.road(road_id="last")), encoding="utf-8"
    )
    network = load_map(file)
    assert_equal_tables(
        network.model.roads.geometry, NetworkGeometry.collect(tuple(network.model.roads.values()))
    )
    assert {w.road_id for w in network.model.warnings} == {"r"}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<planView>", "<planView/><planView>", "no <geometry>"),
        ("<lanes>", LATERAL.format(CROSSFALL.format(s=0, a=0, side="up")), "'side' is 'up'"),
    ],
)
def test_what_cannot_be_meant_is_refused_by_the_record(tmp_path, text, old, new, message):
    file = tmp_path / "odd.xodr"
    file.write_text(text.document(text.road().replace(old, new, 1)), encoding="utf-8")
    with pytest.raises(MapContentError, match=message):
        load_map(file)


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
    assert_equal_tables(geometry, NetworkGeometry.collect(tuple(network.model.roads.values())))
    assert [warning.kind.value for warning in network.model.warnings] == kinds
