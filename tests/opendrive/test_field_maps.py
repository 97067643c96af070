"""Maps of others: what is odd in them is warned about; only a place that cannot be meant refuses one."""

import numpy as np
import pytest

from opendrive import WarningKind, load_map, write_map

LINE = '<geometry s="0" x="10" y="5" hdg="0.3" length="100"><line/></geometry>'


def kinds(network):
    return [warning.kind for warning in network.warnings]


@pytest.mark.parametrize(
    ("revision", "known"),
    [
        ('revMajor="1" revMinor="8"', True),
        ('revMajor="1" revMinor="1"', True),
        ('revMajor="1" revMinor="9"', False),
        ('revMajor="1" revMinor="99"', False),
        ('revMajor="2" revMinor="0"', False),
        ('revMajor="0" revMinor="0"', False),
        ('revMajor="1" revMinor="-1"', False),
    ],
)
def test_revisions_that_are_not_read_are_warned_about(load, text, revision, known):
    content = text.document(text.road()).replace('revMajor="1" revMinor="8"', revision)
    assert kinds(load(content, whole=True)) == [WarningKind.REVISION] * (not known)


def test_only_links_of_the_layer_that_is_read_are_followed(field_map):
    network = field_map("lane_layers_1_9")
    first, second = (network.lane_index_of(("1", section, -1)) for section in (0, 1))
    assert network.successors(first) == (second,)
    assert list(network.lanes.lane_type) == ["driving"] * 4
    assert kinds(network) == [WarningKind.LAYER, WarningKind.REVISION]


def test_another_layer_can_be_chosen(field_map, tmp_path):
    """The road works shut lane -1 from s = 50 m on and lead it to lane -2."""
    path = tmp_path / "permanent.xodr"
    write_map(field_map("lane_layers_1_9"), path)
    permanent = load_map(path)
    assert list(permanent.lanes.key) == list(field_map("lane_layers_1_9").lanes.key)
    network = field_map("lane_layers_1_9", layer="temporary")
    key = network.lane_index_of
    assert network.lanes.lane_type[key(("1", 1, -1))] == "shoulder"
    assert network.successors(key(("1", 0, -1))) == (key(("1", 1, -2)),)
    assert network.successors(key(("1", 0, -2))) == ()
    # The lanes of these road works do lie beside the permanent ones that lead to them.
    assert kinds(network) == [WarningKind.REVISION, WarningKind.LINK_GAP]


def test_a_layer_that_is_not_there_is_said(load, text, tmp_path):
    load(text.road())
    network = load_map(tmp_path / "map.xodr", layer="temporary")
    assert kinds(network) == [WarningKind.LAYER]
    assert len(network.lanes) == 2


@pytest.mark.parametrize(
    ("old", "new", "kind"),
    [
        ("<planView>", f"<planView>{LINE}</planView><planView>", WarningKind.IGNORED),
        ("<lanes>", f"<planView>{LINE}</planView><lanes>", WarningKind.IGNORED),
        ("<line/>", '<line/><arc curvature="0.1"/>', WarningKind.IGNORED),
        ("</lanes>", "</lanes><lanes/>", WarningKind.IGNORED),
        ("<planView>", "<elevationProfile/><elevationProfile/><planView>", WarningKind.IGNORED),
        ("</lanes>", "</lanes><signals/><signals/>", WarningKind.IGNORED),
        ("<link>", '<link><successor elementType="road" contactPoint="start"/>', WarningKind.LINK),
        ("<link>", '<link><successor elementType="road" elementId=""/>', WarningKind.LINK),
        ("<link>", '<link><successor elementType="train" elementId="r"/>', WarningKind.LINK),
        ("<planView>", '<type s="x"/><planView>', WarningKind.LEFT_OUT),
        (
            "<planView>",
            '<type s="0"><speed max="50" unit="kmh"/></type><planView>',
            WarningKind.UNKNOWN_VALUE,
        ),
        ("<planView>", '<type s="0"><speed max="fast"/></type><planView>', WarningKind.UNKNOWN_VALUE),
        ("<width", "<link><successor/></link><width", WarningKind.LINK),
        ("<width", '<link><predecessor id="none"/></link><width', WarningKind.LINK),
        ('junction="-1"', 'junction="-1" rule="none"', WarningKind.UNKNOWN_VALUE),
        ('version="1"', 'version="1" north="top"', WarningKind.UNKNOWN_VALUE),
        ('revMinor="8"', 'revMinor="eight"', WarningKind.REVISION),
        ("</OpenDRIVE>", "<junction/></OpenDRIVE>", WarningKind.LEFT_OUT),
        ("</OpenDRIVE>", "<controller/></OpenDRIVE>", WarningKind.LEFT_OUT),
        ("</OpenDRIVE>", '<junction id="j"><controller/></junction></OpenDRIVE>', WarningKind.LEFT_OUT),
    ],
)
def test_what_does_not_say_where_a_lane_lies_refuses_no_map(load, text, old, new, kind):
    content = text.document(text.road())
    assert old in content
    network = load(content.replace(old, new, 1), whole=True)
    assert set(kinds(network)) == {kind}
    assert len(network.lanes) == 2
    x, y, _, _ = network.center_line(0, 100.0)
    along, left = np.array([np.cos(0.3), np.sin(0.3)]), np.array([-np.sin(0.3), np.cos(0.3)])
    assert (x, y) == pytest.approx(tuple([10.0, 5.0] + 100.0 * along + 1.75 * left))


def test_empty_links_are_not_followed(field_map):
    network = field_map("empty_link_elements")
    assert kinds(network) == [WarningKind.LINK] * 6
    assert network.successors(0) == ()


def test_a_poly3_cannot_be_too_long(field_map):
    """s = 20 m is where its arc length is 20 m: u = 18.44 m."""
    network = field_map("poly3_valid")
    assert network.warnings == ()
    u = np.linspace(0.0, 18.44, 100_001)
    length = np.trapezoid(np.hypot(1.0, 0.04 * u), u)
    assert length == pytest.approx(20.0, abs=0.01)
    end = network.road_point("1", 20.0, 0.0)
    assert (float(end.x_m), float(end.y_m)) == pytest.approx((18.44, 0.02 * 18.44**2), abs=0.01)


@pytest.mark.parametrize(
    "attributes",
    [
        'value=""', 'value="STOP"', 'value="50 km/h"', 'value="nan"', 'value="-1e400"', 'height="tall"',
        'width=""', 'zOffset="" pitch="?"', 'hOffset=""',
    ],
)  # fmt: skip
def test_signals_keep_type_and_place_whatever_their_value(load, text, attributes):
    sign = f'<signals><signal s="50" t="-2" id="7" type="205" orientation="+" {attributes}/></signals>'
    network = load(text.road(extra=sign))
    (signal,) = network.signals_of("r")
    assert (signal.type, signal.s_m, signal.t_m, signal.value) == ("205", 50.0, -2.0, None)
    assert set(kinds(network)) == {WarningKind.UNKNOWN_VALUE}


@pytest.mark.parametrize(("word", "read"), [("+", "+"), ("-", "-"), ("none", "none"), ("both", "none")])
def test_an_unknown_orientation_is_that_of_both_directions(load, text, word, read):
    sign = f'<signals><signal s="50" t="-2" id="7" type="205" orientation="{word}"/></signals>'
    thing = f'<objects><object s="50" t="-2" id="8" orientation="{word}"/></objects>'
    network = load(text.road(extra=sign + thing))
    (signal,), (item,) = network.signals_of("r"), network.model.roads["r"].objects
    assert (signal.orientation, item.orientation) == (read, read)
    assert [(w.kind, w.s_m) for w in network.warnings] == [(WarningKind.UNKNOWN_VALUE, 50.0)] * 2 * (
        word != read
    )


def test_a_bad_part_of_a_signal_leaves_out_the_part(load, text):
    parts = "<validity/><dependency/><reference/>"
    sign = f'<signals><signal s="5" t="0" id="7" type="205">{parts}</signal></signals>'
    network = load(text.road(extra=sign))
    assert [signal.type for signal in network.signals_of("r")] == ["205"]
    assert kinds(network) == [WarningKind.LEFT_OUT] * 3


def test_what_is_kept_as_text_is_written(load, text, tmp_path):
    content = text.document(text.road()).replace("</lanes>", f"</lanes><planView>{LINE}</planView>")
    write_map(load(content, whole=True), tmp_path / "again.xodr")
    again = load_map(tmp_path / "again.xodr")
    assert kinds(again) == [WarningKind.IGNORED]
    assert (tmp_path / "again.xodr").read_text(encoding="utf-8").count("<planView>") == 2
