import copy

import numpy as np
import pytest
from lxml import etree

from opendrive import MapContentError, MapReadError, OpenDriveError, WarningKind, load_map, read_map
from opendrive.model import ParamPoly3, Spiral

BOMB = """<?xml version="1.0"?><!DOCTYPE OpenDRIVE [<!ENTITY a "aaaaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">
<!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;&c;"><!ENTITY e "&d;&d;&d;&d;&d;&d;&d;&d;&d;&d;">
<!ENTITY f "&e;&e;&e;&e;&e;&e;&e;&e;&e;&e;"><!ENTITY g "&f;&f;&f;&f;&f;&f;&f;&f;&f;&f;">]>
<OpenDRIVE><header name="&g;"/><road>&g;</road></OpenDRIVE>"""
OUTSIDE = '<!DOCTYPE OpenDRIVE [<!ENTITY x SYSTEM "file:///etc/hostname">]><OpenDRIVE><header>&x;</header></OpenDRIVE>'


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"  \n ",
        b"not xml at all",
        b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR",
        bytes(range(256)) * 10,
        b"<OpenDRIVE><header",
        b"<OpenDRIVE><header revMajor='1'/>",
        b"<OpenSCENARIO><FileHeader/></OpenSCENARIO>",
        b"<html><body/></html>",
        b"<OpenDRIVE/>",
        b"<OpenDRIVE><header/></OpenDRIVE>",
        BOMB.encode(),
        OUTSIDE.encode(),
        b"<a>" * 5000 + b"</a>" * 5000,
        b"<?xml version='1.0' encoding='no-such-encoding'?><OpenDRIVE/>",
    ],
)
def test_a_file_that_is_no_map_is_refused_by_name(tmp_path, content):
    file = tmp_path / "bad.xodr"
    file.write_bytes(content)
    with pytest.raises(MapReadError, match=r"bad\.xodr"):
        load_map(file)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(MapReadError, match="nowhere"):
        load_map(tmp_path / "nowhere.xodr")
    with pytest.raises(MapReadError, match="cannot be opened"):
        load_map(tmp_path)
    with pytest.raises(MapReadError, match="cannot be opened"):
        load_map("a\0b")


def test_every_truncation_of_a_map_is_refused(tmp_path, text):
    whole = text.document(text.road())
    file = tmp_path / "cut.xodr"
    for length in range(0, len(whole) - 1, 7):
        file.write_text(whole[:length], encoding="utf-8")
        with pytest.raises(MapReadError):
            load_map(file)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999", "", "x", "1,5", "0x10"])
@pytest.mark.parametrize(
    "attribute", ['hdg="0.3"', 'length="100"', 'x="10"', 'a="3.5"', 'b="0.0"', 'length="100.0"']
)
def test_a_bad_number_is_refused_with_road_element_and_line(load, text, attribute, value):
    name = attribute.split("=", maxsplit=1)[0]
    content = text.document(text.road(road_id="seven")).replace(attribute, f'{name}="{value}"', 1)
    with pytest.raises(MapContentError, match=rf"road 'seven', <\w+>, line \d+: attribute '{name}'"):
        load(content, whole=True)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<line/>", "", "has no shape"),
        ("<line/>", "<cubic/>", "has the shape <cubic>"),
        ("<line/>", '<arc curvature="1e9"/>', "turns by"),
        ("<line/>", "<arc/>", "'curvature' is missing"),
        ('length="100"', 'length="-1"', "expected 0 to"),
        ('id="r"', "", "'id' is missing"),
        ('id="1"', 'id="one"', "expected an integer"),
        ('id="1"', 'id="-2"', "wrong sign"),
        ("<laneSection", "<section", "not well-formed"),
    ],
)
def test_impossible_content_is_refused(load, text, old, new, message):
    content = text.document(text.road())
    assert old in content
    with pytest.raises(MapReadError, match=message):
        load(content.replace(old, new, 1), whole=True)


def test_missing_parts_are_refused(load, text):
    with pytest.raises(MapContentError, match="no <geometry>"):
        load(text.road(plan=""))
    with pytest.raises(MapContentError, match="no <laneSection>"):
        load(text.road(sections=""))
    with pytest.raises(MapContentError, match="no <road>"):
        load("")


def test_impossible_lanes_are_refused(load, text):
    width = text.record("width", 3.0, 1e5)
    with pytest.raises(
        MapContentError, match=r"map\.xodr: road 'r', lane -1 of section 0: lies .* check its width"
    ):
        load(text.road(sections=text.section(right=text.lane(-1, width))))
    rolled = f"<lateralProfile>{text.record('superelevation', 2.0)}</lateralProfile>"
    with pytest.raises(MapContentError, match="is rolled by 2 rad at s = 0 m"):
        load(text.road(extra=rolled))


@pytest.mark.parametrize("seed", range(8))
def test_damaged_maps_load_or_are_refused(shared, tmp_path, seed):
    """Wrong values and missing or repeated elements never lead to any other error."""
    rng = np.random.default_rng(seed)
    names = (
        "esmini_fabriksgatan",
        "esut_lane_offset_intersection",
        "esmini_parking_demo",
        "esmini_soderleden",
    )
    source = (shared / "maps" / f"{names[seed % 4]}.xodr").read_bytes()
    values = ["0", "-1", "1e9", "-1e9", "1e-300", "nan", "", "x", "1e5", "3", "-3", "start", "end"]
    loaded, refused = 0, []
    for _ in range(12):
        root = etree.fromstring(source)
        elements = list(root.iter(etree.Element))
        for element in rng.choice(np.array(elements, dtype=object), size=2):
            parent = element.getparent()
            change = rng.random()
            if change < 0.7 and element.attrib:
                element.set(rng.choice(list(element.attrib)), rng.choice(values))
            elif parent is not None and change < 0.9:
                parent.remove(element)
            elif parent is not None:
                parent.append(copy.deepcopy(element))
        file = tmp_path / "damaged.xodr"
        file.write_bytes(etree.tostring(root))
        try:
            network = load_map(file)
            x_min, y_min, x_max, y_max = network.bounds
            points = rng.uniform((x_min, y_min), (x_max, y_max), (20, 2))
            near = network.nearest_lane(points)
            assert np.isfinite(near.distance_m).all()
            assert np.isfinite(network.locate(points).margin_m).all()
            assert all(isinstance(warning.message, str) for warning in network.warnings)
            loaded += 1
        except MapReadError as error:
            refused.append(str(error))
    assert loaded + len(refused) == 12
    assert all("damaged.xodr" in message for message in refused)


def test_of_two_roads_or_lanes_with_one_id_the_first_is_kept(load, text):
    width = text.record("width", 3.0)
    lanes = text.section(left=text.lane(1, width) + text.lane(1, text.record("width", 5.0)))
    network = load(text.road(length=50.0), text.road(sections=lanes), text.road(road_id="s", sections=lanes))
    assert network.model.roads["r"].length_m == 50.0
    assert [lane.id for lane in network.model.roads["s"].sections[0].lanes] == [1, 0]
    np.testing.assert_array_equal(network.model.roads["s"].sections[0].lanes[0].width[:, 1], 3.0)
    twice = [warning for warning in network.warnings if warning.kind == WarningKind.DUPLICATE_ID]
    assert sorted(warning.road_id for warning in twice) == ["r", "s"]


def test_errors_are_value_errors():
    assert issubclass(MapReadError, OpenDriveError)
    assert issubclass(OpenDriveError, ValueError)


def test_a_namespace_makes_no_difference(load, text):
    content = text.document(text.road()).replace(
        "<OpenDRIVE>", '<OpenDRIVE xmlns="http://example.org/opendrive">'
    )
    assert list(load(content, whole=True).roads) == ["r"]


def test_string_ids_and_names_are_kept(load, text):
    network = load(text.road(road_id="Rue de l'Été"))
    assert list(network.roads) == ["Rue de l'Été"]
    assert network.name == "made"


def test_records_are_read(load, text, tmp_path):
    plan = (
        '<geometry s="0" x="0" y="0" hdg="0" length="40"><spiral curvStart="0" curvEnd="0.01"/></geometry>'
        '<geometry s="40" x="40" y="0" hdg="0" length="60">'
        '<paramPoly3 aU="0" bU="60" cU="0" dU="0" aV="0" bV="0" cV="1" dV="0"/></geometry>'
    )
    mark = '<roadMark sOffset="5" type="solid" color="white" width="0.12" laneChange="none"/>'
    extra = '<type s="0" type="town"><speed max="50" unit="km/h"/></type>'
    road = text.road(
        plan,
        sections=text.section(right=text.lane(-1, text.record("width", 3.0) + mark)),
        extra=extra,
        attributes='rule="LHT"',
        junction="9",
    )
    load(road)
    model = read_map(tmp_path / "map.xodr")
    record = model.roads["r"]
    assert record.geometries[0].shape == Spiral(0.0, 0.01)
    assert record.geometries[1].shape == ParamPoly3(
        (0.0, 60.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), normalized=True
    )
    assert (record.rule, record.junction_id) == ("LHT", "9")
    assert record.types[0].speed_mps == pytest.approx(50 / 3.6)
    lane = record.sections[0].lanes[-1]
    assert (lane.id, lane.road_marks[0].lane_change, lane.road_marks[0].s_offset_m) == (-1, "none", 5.0)
    np.testing.assert_array_equal(lane.width, [[0.0, 3.0, 0.0, 0.0, 0.0]])
    assert not lane.width.flags.writeable


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("", "neither width nor border"),
        ('<width sOffset="50" a="3.5" b="0" c="0" d="0"/>', "50.0 m late"),
        (
            '<width sOffset="0" a="3" b="0" c="0" d="0"/><border sOffset="0" a="3" b="0" c="0" d="0"/>',
            "both width and border",
        ),
        (
            '<width sOffset="9" a="4" b="0" c="0" d="0"/><width sOffset="0" a="4" b="0" c="0" d="0"/>',
            "not in ascending sOffset",
        ),
        (
            '<width sOffset="0" a="3" b="0" c="0" d="0"/><roadMark laneChange="maybe"/>',
            "laneChange is 'maybe'",
        ),
        ('<width sOffset="0" a="3" b="0" c="0" d="0"/><speed max="-3"/>', "negative speed"),
    ],
)
def test_tolerable_defects_are_noted(load, text, body, message):
    network = load(text.road(sections=text.section(right=text.lane(-1, body))))
    (warning,) = network.warnings
    assert warning.road_id == "r"
    assert message in warning.message


PLACE = 's="1" t="2"'
IN, OUT = f'<object id="o" {PLACE}>', "</object>"
CORNERS = '<cornerLocal u="0" v="0" z="0"/><cornerLocal u="1" v="0" z="0"/>'


@pytest.mark.parametrize(
    ("content", "noted"),
    [
        (f'<objects><object id="o" {PLACE} height="2.5" hdg="0.1" name="a"/></objects>', 0),
        (f'<objects><object id="o" {PLACE} height="high"/></objects>', 1),
        (f'<objects><object id="o" {PLACE} hdg="nan"/></objects>', 1),
        ('<objects><object id="o" s="1"/></objects>', 1),
        (f'<objects><object id="o" {PLACE} orientation="left"/></objects>', 1),
        (f'<objects>{IN}<userData/><parkingSpace access="all"/>{OUT}</objects>', 0),
        (f'<objects>{IN}<parkingSpace/><parkingSpace/>{OUT}</objects>', 1),
        (f'<objects>{IN}<odd/>{OUT}</objects>', 1),
        (f'<objects>{IN}<outlines><outline>{CORNERS}</outline></outlines>{OUT}</objects>', 0),
        (f'<objects>{IN}<outline>{CORNERS}<cornerRoad s="1" t="1"/></outline>{OUT}</objects>', 1),
        (f'<objects>{IN}<outline><cornerLocal u="0" v="x"/></outline>{OUT}</objects>', 1),
        (f'<objects>{IN}<outlines><outline><odd/></outline></outlines>{OUT}</objects>', 1),
        (f'<objects>{IN}<repeat s="1" length="9" distance="3" tStart="1"/>{OUT}</objects>', 0),
        (f'<objects>{IN}<repeat s="1" length="9" distance="3" tStart="q"/>{OUT}</objects>', 1),
        (f'<objects>{IN}<repeat s="1" length="9"/>{OUT}</objects>', 1),
        (f'<objects><object id="o" {PLACE}/></objects><objects/>', 1),
        (f'<objects><object id="o" {PLACE}/><object id="o" {PLACE}/></objects>', 1),
        ('<objects><bridge id="b" s="1" length="-4"/></objects>', 1),
        (f'<signals><signal id="s" {PLACE} value="50"/></signals>', 0),
        (f'<signals><signal id="s" {PLACE} value=""/></signals>', 1),
        (f'<signals><signal {PLACE}/></signals>', 1),
        (f'<signals><signal id="s" {PLACE}><validity fromLane="-1" toLane="one"/></signal></signals>', 1),
        (f'<signals><signal id="s" {PLACE}><dependency/></signal></signals>', 1),
        (f'<signals><signal id="s" {PLACE}><positionInertial x="1" y="?"/></signal></signals>', 1),
        ('<signals><signalReference id="s" s="1" t="one"/></signals>', 1),
        ('<railroad><switch id="w"/></railroad>', 1),
    ],
)  # fmt: skip
def test_warnings_do_not_depend_on_whether_records_were_read_before(load, text, tmp_path, content, noted):
    road = text.road().replace("</road>", f"{content}</road>")
    noted_alone = load(road).model.warnings
    model = read_map(tmp_path / "map.xodr")
    for record in model.roads.values():
        assert record.objects is not None
    assert len(noted_alone) == noted
    assert model.warnings == noted_alone


def test_gaps_and_short_curves_are_noted(load, text):
    plan = (
        '<geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry>'
        '<geometry s="50" x="51" y="0" hdg="0" length="50">'
        '<paramPoly3 pRange="normalized" aU="0" bU="40" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>'
        "</geometry>"
    )
    messages = [warning.message for warning in load(text.road(plan)).warnings]
    assert len(messages) == 2
    assert "gap of 1 m" in messages[0]
    assert "10 m shorter" in messages[1]


def test_every_reference_map_loads(network_of, map_name):
    network = network_of(map_name)
    assert len(network.lanes) > 0
    x_min, y_min, x_max, y_max = network.bounds
    assert x_min < x_max
    assert y_min < y_max
