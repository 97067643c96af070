"""Every element of the standard that has a record, with values worked out by hand."""

# ruff: noqa: E501 (XML is easier to read unbroken)

import pickle

import numpy as np
import pytest

from opendrive import WarningKind, read_map, write_map
from opendrive.model import (
    Change,
    Connection,
    Control,
    CrossingRoad,
    CrossPath,
    JunctionController,
    JunctionPriority,
    LaneAccess,
    LaneMaterial,
    LaneRange,
    LaneRule,
    ObjectBorder,
    ParkingSpace,
    PlatformSegment,
    RoadLink,
    RoadMarkLine,
    SignalDependency,
    SignalLink,
    SignalPosition,
    Structure,
    Track,
)
from tests.opendrive.xml.test_writer import assert_equal


@pytest.fixture
def read(tmp_path, text):
    """Read a map from the text of its roads and junctions, and check that it is written as it was read."""

    def read_text(*content, kinds=()):
        file = tmp_path / "map.xodr"
        file.write_text(text.document(*content), encoding="utf-8")
        model = read_map(file)
        assert [warning.kind for warning in model.warnings] == list(kinds)
        write_map(model, tmp_path / "again.xodr")
        assert_equal(read_map(tmp_path / "again.xodr"), model)
        return model

    return read_text


@pytest.fixture
def lane(read, text):
    """Read one lane with the given content."""

    def read_lane(content, kinds=(), attributes=""):
        body = text.lane(-1, text.record("width", 3.0) + content).replace("<lane ", f"<lane {attributes} ", 1)
        return (
            read(text.road(sections=text.section(right=body)), kinds=kinds).roads["r"].sections[0].lanes[-1]
        )

    return read_lane


@pytest.mark.parametrize(
    ("limit", "unit", "mps"),
    [("36", "km/h", 10.0), ("100", "mph", 44.704), ("12", "m/s", 12.0), ("no limit", "km/h", None)],
)
def test_speeds_of_lanes_and_roads_in_their_units(lane, read, text, limit, unit, mps):
    speed = f'<speed sOffset="2" max="{limit}" unit="{unit}"/>'
    (record,) = lane(speed).speeds
    assert record.s_offset_m == 2.0
    assert record.speed_mps == (None if mps is None else pytest.approx(mps))
    (kind,) = read(text.road(extra=f'<type s="3" type="rural" country="SE">{speed}</type>')).roads["r"].types
    assert (kind.s_m, kind.type, kind.country) == (3.0, "rural", "SE")
    assert kind.speed_mps == record.speed_mps


def test_material_access_rule_height_and_flags_of_a_lane(lane):
    record = lane(
        '<material sOffset="1" surface="asphalt" friction="0.8" roughness="0.01"/>'
        '<access sOffset="2" rule="deny" restriction="trucks"/>'
        '<access sOffset="3" rule="allow"><restriction type="bus"/><restriction type="taxi"/></access>'
        '<rule sOffset="4" value="no stopping"/><height sOffset="5" inner="0.1" outer="0.2"/>',
        attributes='roadWorks="true" direction="reversed"',
    )
    assert record.materials == (LaneMaterial(1.0, "asphalt", 0.8, 0.01),)
    assert record.accesses == (
        LaneAccess(2.0, "deny", "trucks"),
        LaneAccess(3.0, "allow", "", ("bus", "taxi")),
    )
    assert record.rules == (LaneRule(4.0, "no stopping"),)
    np.testing.assert_array_equal(record.height, [[5.0, 0.1, 0.2]])
    assert record.flags == (("roadWorks", "true"),)
    assert record.direction == "reversed"


def test_road_marks_with_every_field(lane):
    plain, painted = lane(
        '<roadMark sOffset="7" type="custom" weight="bold" color="yellow" material="paint" width="0.3"'
        ' laneChange="increase" height="0.005"><sway ds="0" a="0.1" b="0.2" c="0.3" d="0.4"/>'
        '<type name="double" width="0.36"><line length="3" space="6" tOffset="0.12" sOffset="1" rule="caution"'
        ' width="0.12" color="white"/></type><explicit><line length="2" tOffset="-0.1" sOffset="4"/></explicit>'
        '</roadMark><roadMark sOffset="0" type="solid"/>'
    ).road_marks
    assert (plain.s_offset_m, plain.type, plain.weight, plain.color) == (0.0, "solid", "standard", "standard")
    assert (plain.width_m, plain.lane_change, plain.lines) == (None, None, ())
    assert (painted.weight, painted.color, painted.material) == ("bold", "yellow", "paint")
    assert (painted.width_m, painted.height_m, painted.lane_change) == (0.3, 0.005, "increase")
    assert (painted.pattern, painted.pattern_width_m) == ("double", 0.36)
    assert painted.lines == (RoadMarkLine(1.0, 0.12, 3.0, 6.0, 0.12, "white", "caution"),)
    assert painted.explicit_lines == (RoadMarkLine(4.0, -0.1, 2.0, 0.0, None, "", ""),)
    assert painted.sway == ((0.0, 0.1, 0.2, 0.3, 0.4),)


def test_marks_alike_but_for_their_lines_stay_apart(lane):
    bare = '<roadMark sOffset="0" type="solid"/>'
    lined = '<roadMark sOffset="0" type="solid"><explicit><line length="2" tOffset="0" sOffset="0"/></explicit></roadMark>'
    assert [len(mark.explicit_lines) for mark in lane(bare + lined + bare).road_marks] == [0, 1, 0]


def test_a_border_is_kept_and_a_width_beside_it_wins(read, text):
    border = text.record("border", -3.0, -0.1)
    road = text.road(sections=text.section(right=text.lane(-1, border)))
    lane = read(road).roads["r"].sections[0].lanes[-1]
    np.testing.assert_array_equal(lane.border, [[0.0, -3.0, -0.1, 0.0, 0.0]])
    assert not len(lane.width)
    both = text.road(sections=text.section(right=text.lane(-1, border + text.record("width", 3.0))))
    assert len(read(both, kinds=[WarningKind.WIDTH_AND_BORDER]).roads["r"].sections[0].lanes[-1].width) == 1


def test_lanes_between_borders_are_as_wide_as_these_are_apart(load, text):
    right = text.lane(-1, text.record("border", -3.0, -0.01)) + text.lane(
        -2, text.record("border", -5.0, 0.01)
    )
    network = load(text.road(sections=text.section(right=right)))
    # At s = 50 m the borders are at t = -3.5 m and -4.5 m.
    np.testing.assert_allclose(network.lane_width(network.lane_index_of(("r", 0, -1)), [0, 50]), [3.0, 3.5])
    np.testing.assert_allclose(network.lane_width(network.lane_index_of(("r", 0, -2)), [0, 50]), [2.0, 1.0])


LATERAL = (
    '<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/>'
    '<crossfall side="left" s="0" a="0.02" b="0" c="0" d="0"/>'
    '<crossfall side="both" s="9" a="0.03" b="0" c="0" d="0"/>'
    '<shape s="0" t="0" a="0" b="0.1" c="0" d="0"/><shape s="0" t="-4" a="0.4" b="-0.1" c="0" d="0"/></lateralProfile>'
)


def test_lateral_profiles(read, text):
    road = read(text.road(extra=LATERAL), kinds=[WarningKind.ORDER]).roads["r"]
    np.testing.assert_array_equal(road.superelevation[:, :2], [[0.0, 0.1]])
    np.testing.assert_array_equal(road.crossfall_left[:, :2], [[0.0, 0.02], [9.0, 0.03]])
    np.testing.assert_array_equal(road.crossfall_right[:, :2], [[9.0, 0.03]])
    np.testing.assert_array_equal(road.shape[:, :3], [[0.0, -4.0, 0.4], [0.0, 0.0, 0.0]])


OBJECT = """<objects><object id="p" name="bay" type="parkingSpace" subtype="openSpace" s="10" t="-4" zOffset="0.1"
 hdg="1.5" pitch="0.2" roll="0.3" orientation="+" length="5" width="2.5" height="0.2" dynamic="yes"
 perpToRoad="true" validLength="6">
<repeat s="10" length="30" distance="3" tStart="-4" tEnd="-5" widthStart="2.5" widthEnd="2" zOffsetStart="0"
 zOffsetEnd="0" heightStart="1" heightEnd="2"/>
<outlines><outline id="0" closed="false" fillType="grass" outer="true"><cornerRoad id="0" s="10" t="-3" dz="0.1"
 height="0.5"/><cornerRoad id="1" s="15" t="-3" dz="0.2" height="0.6"/></outline>
<outline id="1"><cornerLocal u="1" v="2" z="3" height="4"/></outline></outlines>
<material surface="cobble" friction="0.7"/><validity fromLane="-2" toLane="-1"/>
<parkingSpace access="handicapped" restrictions="2 h"/>
<markings><marking side="left" color="white" width="0.1" zOffset="0.005" lineLength="2" spaceLength="1"
 startOffset="0.1" stopOffset="0.2" weight="bold"><cornerReference id="0"/><cornerReference id="1"/></marking></markings>
<borders><border outlineId="0" type="curb" width="0.15" useCompleteOutline="true"/></borders>
<userData code="a" value="b"/></object>
<objectReference id="q" s="1" t="2" zOffset="3" validLength="4" orientation="-"><validity fromLane="1" toLane="2"/>
</objectReference><tunnel id="t" name="T" type="standard" s="20" length="30" lighting="0.4" daylight="0.1"/>
<bridge id="b" name="B" type="steel" s="60" length="20"><validity fromLane="-1" toLane="1"/></bridge></objects>"""


def test_objects_with_every_field(read, text):
    road = read(text.road(extra=OBJECT)).roads["r"]
    (item,) = road.objects
    assert (item.id, item.name, item.type, item.subtype) == ("p", "bay", "parkingSpace", "openSpace")
    assert (item.s_m, item.t_m, item.z_offset_m, item.heading_rad) == (10.0, -4.0, 0.1, 1.5)
    assert (item.pitch_rad, item.roll_rad, item.orientation) == (0.2, 0.3, "+")
    assert (item.length_m, item.width_m, item.height_m, item.radius_m) == (5.0, 2.5, 0.2, None)
    assert (item.dynamic, item.perpendicular_to_road, item.valid_length_m) == (True, True, 6.0)
    (repeat,) = item.repeats
    assert (repeat.s_m, repeat.length_m, repeat.distance_m) == (10.0, 30.0, 3.0)
    assert (repeat.t, repeat.width, repeat.height) == (Change(-4.0, -5.0), Change(2.5, 2.0), Change(1.0, 2.0))
    assert (repeat.length, repeat.radius, repeat.detached) == (Change(None, None), Change(None, None), False)
    on_road, local = item.outlines
    assert (on_road.id, on_road.in_road_frame, on_road.closed) == ("0", True, False)
    assert on_road.attributes == (("fillType", "grass"), ("outer", "true"))
    np.testing.assert_array_equal(on_road.corners, [[10.0, -3.0, 0.1], [15.0, -3.0, 0.2]])
    np.testing.assert_array_equal(on_road.heights_m, [0.5, 0.6])
    assert on_road.corner_ids == ("0", "1")
    assert (local.in_road_frame, local.closed, local.corner_ids) == (False, True, ())
    np.testing.assert_array_equal(local.corners, [[1.0, 2.0, 3.0]])
    assert item.materials == (LaneMaterial(0.0, "cobble", 0.7, None),)
    assert item.validity == (LaneRange(-2, -1),)
    assert item.parking_space == ParkingSpace("handicapped", "2 h")
    (marking,) = item.markings
    assert (marking.side, marking.color, marking.weight, marking.width_m) == ("left", "white", "bold", 0.1)
    assert (marking.line_length_m, marking.space_length_m, marking.z_offset_m) == (2.0, 1.0, 0.005)
    assert (marking.start_offset_m, marking.stop_offset_m, marking.corner_ids) == (0.1, 0.2, ("0", "1"))
    assert item.borders == (ObjectBorder("0", "curb", 0.15, True, ()),)
    assert item.extra == ('<userData code="a" value="b"/>',)


def test_references_bridges_and_tunnels(read, text):
    road = read(text.road(extra=OBJECT)).roads["r"]
    (reference,) = road.object_references
    assert (reference.object_id, reference.s_m, reference.t_m, reference.z_offset_m) == ("q", 1.0, 2.0, 3.0)
    assert (reference.valid_length_m, reference.orientation) == (4.0, "-")
    assert reference.validity == (LaneRange(1, 2),)
    assert road.tunnels == (Structure("t", "T", "standard", 20.0, 30.0, 0.4, 0.1, ()),)
    assert road.bridges == (Structure("b", "B", "steel", 60.0, 20.0, None, None, (LaneRange(-1, 1),)),)


def test_signals_with_every_field(read, text):
    extra = (
        '<signals><signal id="1" s="5" t="-4" zOffset="2" hOffset="0.1" pitch="0.2" roll="0.3" orientation="-"'
        ' dynamic="yes" name="n" country="DE" countryRevision="2017" type="274" subtype="-1" value="50" unit="km/h"'
        ' text="T" height="0.6" width="0.5" length="0.1"><validity fromLane="-2" toLane="-1"/>'
        '<dependency id="2" type="limitline"/><reference elementType="object" elementId="p" type="pole"/>'
        '<positionRoad roadId="7" s="1" t="2" zOffset="3" hOffset="0.4" pitch="0.5" roll="0.6"/></signal>'
        '<signal id="2" s="6" t="0"><positionInertial x="1" y="2" z="3" hdg="0.4"/></signal></signals>'
    )
    first, second = read(text.road(extra=extra)).roads["r"].signals
    assert (first.pitch_rad, first.roll_rad, first.length_m, first.country_revision) == (
        0.2,
        0.3,
        0.1,
        "2017",
    )
    assert first.dependencies == (SignalDependency("2", "limitline"),)
    assert first.links == (SignalLink("object", "p", "pole"),)
    assert first.position == SignalPosition("7", (1.0, 2.0, 3.0), 0.4, 0.5, 0.6)
    assert second.position == SignalPosition("", (1.0, 2.0, 3.0), 0.4, 0.0, 0.0)
    assert (second.value, second.dynamic, second.validity) == (None, False, ())


def test_railroads_stations_controllers_and_groups(read, text):
    extra = (
        '<railroad><switch id="s" name="S" position="straight"><mainTrack id="1" s="2" dir="+"/>'
        '<sideTrack id="3" s="4" dir="-"/><partner name="P" id="p"/></switch></railroad>'
    )
    model = read(
        text.road(extra=extra),
        '<controller id="c" name="C" sequence="3"><control signalId="9" type="t"/></controller>',
        '<junctionGroup id="g" name="G" type="roundabout"><junctionReference junction="5"/></junctionGroup>',
        '<station id="st" name="St" type="small"><platform id="pl" name="Pl">'
        '<segment roadId="r" sStart="1" sEnd="9" side="left"/></platform></station>',
    )
    (switch,) = model.roads["r"].switches
    assert (switch.id, switch.position, switch.partner_id) == ("s", "straight", "p")
    assert (switch.main_track, switch.side_track) == (Track("1", 2.0, "+"), Track("3", 4.0, "-"))
    assert model.controllers["c"].controls == (Control("9", "t"),)
    assert model.controllers["c"].sequence == 3
    assert [(g.id, g.type, g.junction_ids) for g in model.junction_groups] == [("g", "roundabout", ("5",))]
    (station,) = model.stations
    assert (station.id, station.type) == ("st", "small")
    assert station.platforms[0].segments == (PlatformSegment("r", 1.0, 9.0, "left"),)


def test_junctions_of_all_four_types(read, text):
    model = read(
        text.road(),
        '<junction id="1" name="common"><connection id="0" incomingRoad="a" connectingRoad="b" contactPoint="end">'
        '<laneLink from="-1" to="1"/></connection><priority high="b" low="c"/>'
        '<controller id="k" type="t" sequence="2"/><crossPath id="x" crossingRoad="f" roadAtStart="a" roadAtEnd="b">'
        '<startLaneLink s="1" from="-1" to="2"/><endLaneLink s="3" from="-1" to="4"/></crossPath></junction>',
        '<junction id="2" name="" type="direct"><connection id="0" incomingRoad="a" linkedRoad="b" contactPoint="start">'
        '<laneLink from="-1" to="-2" overlapZone="1.5"/><laneLink from="-2" to="-3"/></connection></junction>',
        '<junction id="3" name="" type="virtual" mainRoad="r" sStart="10" sEnd="20" orientation="+">'
        '<connection id="0" incomingRoad="a" connectingRoad="b" contactPoint="start" type="virtual">'
        '<predecessor elementType="road" elementId="r" elementS="12" elementDir="+"/></connection></junction>',
        '<junction id="4" name="" type="crossing"><roadSection id="0" roadId="r" sStart="1" sEnd="2"/></junction>',
    )
    common, direct, virtual, crossing = model.junctions.values()
    assert common.connections == (Connection("0", "a", "b", "end", ((-1, 1),)),)
    assert common.priorities == (JunctionPriority("b", "c"),)
    assert common.controllers == (JunctionController("k", "t", 2),)
    assert common.cross_paths == (CrossPath("x", "f", "a", "b", (1.0, -1, 2), (3.0, -1, 4)),)
    (connection,) = direct.connections
    assert (direct.type, connection.is_linked, connection.connecting_road) == ("direct", True, "b")
    assert connection.overlap_zones_m == (1.5, 0.0)
    assert (virtual.main_road, virtual.orientation, virtual.s_start_m, virtual.s_end_m) == (
        "r",
        "+",
        10.0,
        20.0,
    )
    assert virtual.connections[0].predecessor == RoadLink("road", "r", None, 12.0, "+")
    assert crossing.crossing_roads == (CrossingRoad("0", "r", 1.0, 2.0),)


def test_header_offset_reference_and_links(read, text):
    link = (
        '<predecessor elementType="junction" elementId="5"/>'
        '<successor elementType="road" elementId="8" elementS="7" elementDir="-"/>'
    )
    model = read(text.road(link=link), text.road(road_id="l", attributes='rule="LHT"', junction="5"))
    assert model.roads["r"].predecessor == RoadLink("junction", "5", None)
    assert model.roads["r"].successor == RoadLink("road", "8", None, 7.0, "-")
    assert (model.roads["l"].rule, model.roads["l"].junction_id) == ("LHT", "5")


def test_user_data_and_unknown_elements_are_kept_as_they_are(read, text):
    note = '<userData code="n"><note lang="en">a &lt; b<br/></note></userData>'
    model = read(note, text.road(extra=note + "<novelty><a/></novelty>"), kinds=[WarningKind.UNKNOWN_ELEMENT])
    assert model.extra == (note,)
    assert model.roads["r"].extra == (note, "<novelty><a/></novelty>")


def test_a_map_pickles_with_everything_in_it(read, text):
    model = read(text.road(extra=OBJECT))
    assert_equal(pickle.loads(pickle.dumps(model)), model)


def test_attributes_of_no_known_name_are_kept(read, text, tmp_path):
    beside = (
        '<signals><signal id="1" s="5" t="0" temporary="true"/></signals>'
        '<objects><object id="2" type="pole" s="5" t="0" mass="12 kg"/></objects>'
    )
    model = read(text.road(extra=beside, attributes='surveyed="2024"'))
    write_map(model, tmp_path / "again.xodr")
    for road in (model.roads["r"], read_map(tmp_path / "again.xodr").roads["r"]):
        assert road.attributes == (("surveyed", "2024"),)
        assert road.signals[0].attributes == (("temporary", "true"),)
        assert road.objects[0].attributes == (("mass", "12 kg"),)
