"""Tables of fields: what they read, what they write, and that both are the same."""

import gc
import weakref

import pytest
from lxml import etree

from opendrive import MapContentError, load_map, read_map, write_map
from opendrive.model import Change, LaneRange, Signal, Switch, Track
from opendrive.xml.fields import flag, integer, number, row, text
from opendrive.xml.roads import SWITCH
from opendrive.xml.signals import SIGNAL
from opendrive.xml.tables import Table
from opendrive.xml.values import Values
from tests.opendrive.xml.test_writer import assert_equal


def element(xml):
    return etree.fromstring(xml)


def written(table, record, tag="x"):
    root = etree.Element(tag)
    table.write(root, record)
    return etree.tostring(root, encoding="unicode")


def test_a_table_names_every_field_of_its_record():
    with pytest.raises(AssertionError, match="to_lane"):
        Table(LaneRange, from_lane=integer("fromLane"))


def test_a_field_is_written_in_the_order_of_the_table_and_read_in_that_of_the_record():
    table = Table(LaneRange, to_lane=integer("toLane"), from_lane=integer("fromLane"))
    assert written(table, LaneRange(1, 2)) == '<x toLane="2" fromLane="1"/>'
    with pytest.raises(MapContentError, match="'fromLane' is 'a'"):
        table.read(Values("map"), element('<x toLane="b" fromLane="a"/>'))


def test_what_means_the_same_when_absent_is_not_written():
    table = Table(Change, start_m=number("a", None), end_m=number("b", 0.0))
    assert written(table, Change(None, 0.0)) == '<x b="0.0"/>'
    assert table.read(Values("map"), element("<x/>")) == Change(None, 0.0)


@pytest.mark.parametrize(("value", "yes_no"), [(True, ' f="yes"'), (False, "")])
def test_a_flag_that_is_false_may_be_left_out(value, yes_no):
    root = etree.Element("x")
    flag("f", yes="yes").write(root, value)
    assert etree.tostring(root, encoding="unicode") == f"<x{yes_no}/>"


def test_a_row_is_written_in_its_own_order():
    pair = row(integer("from"), integer("to"), order=(1, 0))
    root = etree.Element("x")
    pair.write(root, (1, 2))
    assert etree.tostring(root, encoding="unicode") == '<x to="2" from="1"/>'
    assert pair.read(Values("map"), root) == (1, 2)


def test_an_empty_text_is_kept_where_it_differs_from_an_absent_one():
    assert text("t", "none").read(Values("map"), element("<x/>")) == "none"
    root = etree.Element("x")
    text("t", "none").write(root, "")
    assert text("t", "none").read(Values("map"), root) == ""


def test_attributes_and_children_without_field_are_kept():
    xml = '<signal s="1" t="2" id="a" own="3"><semantics/><validity fromLane="-1" toLane="1"/></signal>'
    signal = SIGNAL.read(Values("map"), element(xml))
    assert isinstance(signal, Signal)
    assert signal.attributes == (("own", "3"),)
    assert signal.extra == ("<semantics/>",)
    assert SIGNAL.read(Values("map"), element(written(SIGNAL, signal))) == signal


def test_a_part_without_content_is_not_written():
    track = Track("r", 1.0, "+")
    switch = Switch("a", "", "dynamic", track, track, "", "")
    assert "partner" not in written(SWITCH, switch)
    with pytest.raises(MapContentError, match="<sideTrack> is missing"):
        SWITCH.read(Values("map"), element('<switch id="a"><mainTrack id="r" s="1"/></switch>'))


def test_empty_ids_are_read_again_as_they_were(tmp_path, text):
    more = (
        '<controller id=""><control signalId=""/></controller>'
        '<junctionGroup id=""><junctionReference junction=""/></junctionGroup>'
    )
    file = tmp_path / "map.xodr"
    file.write_text(text.document(text.road(), more), encoding="utf-8")
    model = read_map(file)
    assert model.controllers[""].controls[0].signal_id == ""
    write_map(model, tmp_path / "again.xodr")
    assert_equal(read_map(tmp_path / "again.xodr"), model)


def test_a_network_is_freed_without_the_garbage_collector(tmp_path, text):
    file = tmp_path / "map.xodr"
    file.write_text(text.document(text.road()), encoding="utf-8")
    network = load_map(file)
    assert network.warnings == ()
    model = weakref.ref(network.model.roads)
    gc.disable()
    try:
        del network
        assert model() is None
    finally:
        gc.enable()
