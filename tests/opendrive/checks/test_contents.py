"""Steps of profiles, places beyond the road, references to nothing; amounts are known from the map."""

import pytest

from opendrive import WarningKind


def only(network):
    (warning,) = network.warnings
    return warning


@pytest.mark.parametrize(
    ("name", "part", "amount", "unit"),
    [
        ("elevation", "elevationProfile", 0.3, "m"),
        ("superelevation", "lateralProfile", 0.02, "rad"),
    ],
)
def test_steps_of_profiles(load, text, name, part, amount, unit):
    """A slope of 1 % for 50 m, and a step after it."""
    records = text.record(name, 0.0, 0.001) + text.record(name, 0.05 + amount, s=50.0)
    warning = only(load(text.road(extra=f"<{part}>{records}</{part}>")))
    assert (warning.kind, warning.s_m, warning.unit) == (WarningKind.STEP, 50.0, unit)
    assert warning.amount == pytest.approx(amount)


def test_smooth_profiles_have_no_steps(load, text):
    records = text.record("elevation", 1.0, 0.01) + text.record("elevation", 1.5, s=50.0)
    assert load(text.road(extra=f"<elevationProfile>{records}</elevationProfile>")).warnings == ()


def test_steps_of_width_and_lane_offset(load, text):
    widths = text.record("width", 3.0) + text.record("width", 3.4, s=20.0)
    lanes = text.section(right=text.lane(-1, widths))
    offsets = text.record("laneOffset", 0.0) + text.record("laneOffset", 0.5, s=70.0)
    found = load(text.road(sections=lanes, offsets=offsets)).warnings
    assert [(w.kind, w.lane_id, w.s_m) for w in found] == [
        (WarningKind.STEP, None, 70.0),
        (WarningKind.STEP, -1, 20.0),
    ]
    assert [w.amount for w in found] == pytest.approx([0.5, 0.4])


def test_a_lane_offset_may_step_where_lanes_change(load, text):
    """The lane stays where it is: offset and id change together."""
    width = text.record("width", 3.0)
    before = text.section(right=text.lane(-1, f'<link><successor id="1"/></link>{width}'))
    after = text.section(50.0, left=text.lane(1, f'<link><predecessor id="-1"/></link>{width}'))
    offsets = text.record("laneOffset", 0.0) + text.record("laneOffset", -3.0, s=50.0)
    network = load(text.road(sections=before + after, offsets=offsets))
    assert [w for w in network.warnings if w.kind in (WarningKind.STEP, WarningKind.LINK_GAP)] == []


def test_records_that_start_late_or_never_hold(load, text):
    late = f"<elevationProfile>{text.record('elevation', 2.0, s=10.0)}</elevationProfile>"
    warning = only(load(text.road(extra=late)))
    assert (warning.kind, warning.s_m, warning.amount) == (WarningKind.LATE_RECORD, 10.0, 2.0)
    never = text.record("elevation", 0.0) + text.record("elevation", 0.0, s=130.0)
    warning = only(load(text.road(extra=f"<elevationProfile>{never}</elevationProfile>")))
    assert (warning.kind, warning.amount) == (WarningKind.BEYOND_ROAD, 30.0)


@pytest.mark.parametrize(
    ("extra", "element", "amount"),
    [
        ('<signals><signal id="1" s="104" t="0"/></signals>', "signal", 4.0),
        ('<signals><signal id="1" s="-2" t="0"/></signals>', "signal", 2.0),
        ('<objects><object id="1" s="105" t="0"/></objects>', "object", 5.0),
        (
            '<objects><object s="5" t="0"><repeat s="90" length="17" distance="1"/></object></objects>',
            "object/repeat",
            7.0,
        ),
        ('<objects><tunnel id="1" s="90" length="12"/></objects>', "tunnel", 2.0),
    ],
)
def test_places_beyond_the_road(load, text, extra, element, amount):
    warning = only(load(text.road(extra=extra)))
    assert (warning.kind, warning.element) == (WarningKind.BEYOND_ROAD, element)
    assert warning.amount == pytest.approx(amount)


@pytest.mark.parametrize(
    "extra",
    [
        '<signals><signalReference id="x" s="5" t="0"/></signals>',
        '<objects><objectReference id="x" s="5" t="0"/></objects>',
        '<signals><signal id="1" s="5" t="0"><dependency id="x"/></signal></signals>',
    ],
)
def test_references_to_nothing(load, text, extra):
    assert only(load(text.road(extra=extra))).kind is WarningKind.REFERENCE


def test_controllers_and_groups_that_refer_to_nothing(load, text):
    controller = '<controller id="c"><control signalId="x"/></controller>'
    junction = '<junction id="j"><controller id="y"/></junction>'
    group = '<junctionGroup id="g"><junctionReference junction="z"/></junctionGroup>'
    network = load(text.road(), controller, junction, group)
    assert [w.kind for w in network.warnings] == [WarningKind.REFERENCE] * 3


def test_a_section_without_centre_lane(load, text):
    lanes = text.section(right=text.lane(-1, text.record("width", 3.0)))
    centre = lanes[lanes.index("<center>") : lanes.index("</center>") + len("</center>")]
    warning = only(load(text.road(sections=lanes.replace(centre, ""))))
    assert (warning.kind, warning.s_m) == (WarningKind.MISSING, 0.0)


@pytest.mark.parametrize(
    ("reference", "sound"),
    [
        ("+proj=tmerc +lat_0=49 +lon_0=8 +ellps=WGS84", True),
        ("+lat_0=49 +lon_0=8", True),
        ("EPSG:32632", True),
        ("+proj=nonsense", False),
        ("somewhere in Bavaria", False),
        ("EPSG:4326", False),
        ("+lat_0=49", False),
    ],
)
def test_a_geo_reference_that_cannot_be_read(load, text, reference, sound):
    content = text.document(text.road()).replace(
        'version="1"/>', f'version="1"><geoReference>{reference}</geoReference></header>'
    )
    kinds = [warning.kind for warning in load(content, whole=True).warnings]
    assert kinds == ([] if sound else [WarningKind.GEO_REFERENCE])


def test_a_border_that_crosses_the_lanes_further_in(load, text):
    """The outer border comes 0.5 m further in than the inner lane's at the end."""
    lanes = text.section(
        right=text.lane(-1, text.record("border", -3.0)) + text.lane(-2, text.record("border", -6.0, 0.035))
    )
    warning = only(load(text.road(sections=lanes)))
    assert (warning.kind, warning.lane_id) == (WarningKind.NEGATIVE_WIDTH, -2)
    assert warning.amount == pytest.approx(0.5)


CORNER = '<cornerRoad s="{}" t="{}" dz="0" height="1"/>'


def outlined(*corners, more=""):
    ring = "".join(CORNER.format(s, t) for s, t in corners)
    outline = f'<outlines><outline id="0">{ring}</outline></outlines>'
    return f'<objects><object id="1" type="crosswalk" s="5" t="0">{outline}{more}</object></objects>'


MARKING = '<markings><marking side="front" width="0.1"><cornerReference id="9"/></marking></markings>'
BORDER = '<borders><border outlineId="4" type="curb" width="0.1"/></borders>'
TRIANGLE = (5, 0), (7, 0), (7, 2)


@pytest.mark.parametrize(
    ("extra", "kind", "element", "amount"),
    [
        (
            '<signals><signal id="1" s="5" t="0"><positionRoad roadId="r" s="120" t="0"/></signal></signals>',
            WarningKind.BEYOND_ROAD,
            "signal/positionRoad",
            20.0,
        ),
        (
            '<signals><signal id="1" s="5" t="0"><positionRoad roadId="x" s="5" t="0"/></signal></signals>',
            WarningKind.REFERENCE,
            "signal/positionRoad",
            None,
        ),
        (
            '<signals><signal id="1" s="5" t="-5000"/></signals>',
            WarningKind.BEYOND_ROAD,
            "signal",
            5000.0,
        ),
        (
            '<objects><object id="1" s="5" t="0"><validity fromLane="-9" toLane="-8"/></object></objects>',
            WarningKind.REFERENCE,
            "validity",
            None,
        ),
        (outlined((90, 0), (130, 0), (130, 2)), WarningKind.BEYOND_ROAD, "object/outline", 30.0),
        (outlined((5, 0), (7, 0)), WarningKind.MISSING, "object/outline", None),
        (outlined(*TRIANGLE, more=MARKING), WarningKind.REFERENCE, "object/marking", None),
        (outlined(*TRIANGLE, more=BORDER), WarningKind.REFERENCE, "object/border", None),
        (
            '<objects><object s="5" t="0"><repeat s="20" length="60" distance="-1"/></object></objects>',
            WarningKind.UNKNOWN_VALUE,
            "object/repeat",
            None,
        ),
    ],
)
def test_parts_of_signals_and_objects(load, text, extra, kind, element, amount):
    warning = only(load(text.road(extra=extra)))
    assert (warning.kind, warning.element, warning.road_id) == (kind, element, "r")
    assert warning.amount == (None if amount is None else pytest.approx(amount))


def test_sound_outlines_and_repeats_are_not_reported(load, text):
    assert load(text.road(extra=outlined(*TRIANGLE))).warnings == ()
    repeat = '<repeat s="20" length="60" distance="0"/><validity fromLane="-1" toLane="1"/>'
    objects = f'<objects><object s="5" t="0" id="1">{repeat}</object></objects>'
    assert load(text.road(extra=objects)).warnings == ()


@pytest.mark.parametrize(
    "content",
    [
        '<junction id="j"><priority high="x" low="r"/></junction>',
        '<junction id="j" type="virtual" mainRoad="x" sStart="0" sEnd="9" orientation="+"/>',
        '<station id="s"><platform id="p"><segment roadId="x" sStart="0" sEnd="5"/></platform></station>',
    ],
)
def test_references_to_roads_that_are_not_there(load, text, content):
    assert only(load(text.road(), content)).kind is WarningKind.REFERENCE


def test_switches_on_roads_that_are_not_there(load, text):
    tracks = '<mainTrack id="x" s="0" dir="+"/><sideTrack id="y" s="0" dir="+"/>'
    railroad = f'<railroad><switch name="" id="1" position="dynamic">{tracks}</switch></railroad>'
    network = load(text.road(extra=railroad))
    assert [w.kind for w in network.warnings] == [WarningKind.REFERENCE] * 2


def test_a_lane_offset_steps_where_lane_sections_are_not_linked(load, text):
    """Sidewalks need no links; nothing else makes up for the step."""
    walk = text.lane(-1, text.record("width", 2.0), "sidewalk")
    sections = text.section(right=walk) + text.section(50.0, right=walk)
    offsets = text.record("laneOffset", 0.0) + text.record("laneOffset", 0.5, s=50.0)
    warning = only(load(text.road(sections=sections, offsets=offsets)))
    assert (warning.kind, warning.s_m, warning.amount) == (WarningKind.STEP, 50.0, pytest.approx(0.5))


SHAPE = '<shape s="{}" t="{}" a="{}" b="0" c="0" d="0"/>'


@pytest.mark.parametrize(
    ("shapes", "kind", "s_m", "amount"),
    [
        (SHAPE.format(0, 0, 0) + SHAPE.format(0, 2, 0.5), WarningKind.STEP, 0.0, 0.5),
        (SHAPE.format(40, 0, 0.5), WarningKind.LATE_RECORD, 40.0, 40.0),
        (SHAPE.format(0, 0, 0) + SHAPE.format(130, 0, 0), WarningKind.BEYOND_ROAD, 130.0, 30.0),
    ],
)
def test_lateral_shapes_that_step_start_late_or_lie_off_the_road(load, text, shapes, kind, s_m, amount):
    warning = only(load(text.road(extra=f"<lateralProfile>{shapes}</lateralProfile>")))
    assert (warning.kind, warning.s_m, warning.unit) == (kind, s_m, "m")
    assert warning.amount == pytest.approx(amount)


@pytest.mark.parametrize(
    ("name", "s", "kind", "amount"),
    [("elevation", -30.0, WarningKind.BEYOND_ROAD, 30.0), ("width", -2.0, WarningKind.BEYOND_ROAD, 2.0)],
)
def test_records_that_start_before_what_they_shape(load, text, name, s, kind, amount):
    if name == "width":
        network = load(text.road(sections=text.section(right=text.lane(-1, text.record(name, 3.0, s=s)))))
    else:
        record = text.record(name, 3.0, s=s)
        network = load(text.road(extra=f"<elevationProfile>{record}</elevationProfile>"))
    warning = only(network)
    assert (warning.kind, warning.s_m, warning.amount) == (kind, s, pytest.approx(amount))


def test_lane_sections_before_the_road_and_without_length(load, text):
    lane = text.lane(-1, text.record("width", 3.0))
    early = only(load(text.road(sections=text.section(-0.5, right=lane))))
    assert (early.kind, early.amount) == (WarningKind.BEYOND_ROAD, 0.5)
    walk = text.lane(-1, text.record("width", 3.0), "sidewalk")
    sections = text.section(right=walk) + text.section(100.0, right=walk)
    bare = only(load(text.road(sections=sections)))
    assert (bare.kind, bare.s_m) == (WarningKind.SECTION_LENGTH, 100.0)


def test_where_a_defect_of_a_lane_lies(load, text):
    """A section at s = 40 m; the mark 7 m into it has no type of lane change that is known."""
    mark = '<roadMark sOffset="7" type="solid" laneChange="maybe"/>'
    link = '<link><successor id="-1"/></link>'
    first = text.section(right=text.lane(-1, link + text.record("width", 3.0)))
    body = '<link><predecessor id="-1"/></link>' + text.record("width", 3.0) + mark
    warning = only(load(text.road(sections=first + text.section(40.0, right=text.lane(-1, body)))))
    assert (warning.kind, warning.lane_id, warning.s_m) == (WarningKind.UNKNOWN_VALUE, -1, 47.0)
