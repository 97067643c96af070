"""Links whose sides do not meet or do not agree; each amount is known from how the map is made."""

import numpy as np
import pytest

from opendrive import WarningKind, load_map


def kinds(network):
    return sorted({warning.kind for warning in network.warnings})


def of_kind(network, kind):
    return [warning for warning in network.warnings if warning.kind is kind]


def test_linked_roads_that_are_apart(field_map):
    """Road 2 starts 10 m ahead of the end of road 1 and 8 m beside it."""
    network = field_map("linked_roads_apart")
    lane_gap = of_kind(network, WarningKind.LINK_GAP)[0]
    assert (lane_gap.road_id, lane_gap.lane_id, lane_gap.s_m, lane_gap.unit) == ("1", -1, 50.0, "m")
    assert lane_gap.amount == pytest.approx(np.hypot(10.0, 8.0))
    assert lane_gap.rule.startswith("asam.net:xodr:")
    assert kinds(network) == [WarningKind.LINK_GAP]


def test_lanes_that_link_crosswise(field_map):
    network = field_map("contradicting_lane_links")
    found = of_kind(network, WarningKind.CONTRADICTING_LINK)
    assert [(w.road_id, w.lane_id, w.s_m) for w in found] == [
        ("1", -1, 50.0),
        ("1", -2, 50.0),
        ("2", -1, 0.0),
        ("2", -2, 0.0),
    ]
    # Half of the links join lanes that lie 3.5 m apart.
    assert [w.amount for w in of_kind(network, WarningKind.LINK_GAP)] == pytest.approx([3.5, 3.5])


def test_a_junction_that_is_not_there(field_map):
    (warning,) = field_map("junction_not_there").warnings
    assert (warning.kind, warning.road_id, warning.s_m) == (WarningKind.LINK, "1", 100.0)
    assert "'99'" in warning.message


LINE = '<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="50"><line/></geometry>'


def lanes(text, lane_id, width, link=""):
    body = f"<link>{link}</link>" + text.record("width", *width)
    side = {"right" if lane_id < 0 else "left": text.lane(lane_id, body)}
    return text.section(**side)


@pytest.fixture
def two_roads(load, text):
    """Load two roads of 50 m, the first of which ends where the second starts, with one lane each."""

    def make(
        x=50.0, y=0.0, heading=0.0, width=(3.0,), answer='<predecessor id="-1"/>', extra="", link=None,
        back='<predecessor elementType="road" elementId="a" contactPoint="end"/>', offsets="", lane_id=-1,
    ):  # fmt: skip
        link = link or '<successor elementType="road" elementId="b" contactPoint="start"/>'
        first = text.road(
            LINE.format(x=0, y=0, heading=0),
            lanes(text, -1, (3.0,), f'<successor id="{lane_id}"/>'),
            road_id="a",
            length=50.0,
            link=link,
        )
        second = text.road(
            LINE.format(x=x, y=y, heading=heading),
            lanes(text, lane_id, width, answer),
            road_id="b",
            length=50.0,
            link=back,
            extra=extra,
            offsets=offsets,
        )
        return load(first, second)

    return make


def test_roads_that_meet_are_sound(two_roads):
    assert two_roads().findings == ()


def test_lane_offsets_may_make_up_for_reference_lines_that_are_apart(two_roads, text):
    network = two_roads(y=2.0, offsets=text.record("laneOffset", -2.0))
    assert network.warnings == ()


def test_roads_head_to_head_meet_with_lanes_of_opposite_sides(two_roads):
    """Road b runs towards the end of road a; its left lane goes on."""
    network = two_roads(
        x=100.0,
        heading=np.pi,
        lane_id=1,
        answer='<successor id="-1"/>',
        link='<successor elementType="road" elementId="b" contactPoint="end"/>',
        back='<successor elementType="road" elementId="a" contactPoint="end"/>',
    )
    assert network.warnings == ()
    assert network.successors(0) == (1,)


ELEVATED = '<elevationProfile><elevation s="0" a="0.4" b="0" c="0" d="0"/></elevationProfile>'


@pytest.mark.parametrize(
    ("change", "kind", "amount"),
    [
        ({"y": 1.0}, WarningKind.LINK_GAP, 1.0),
        ({"width": (2.5,)}, WarningKind.LINK_WIDTH, 0.5),
        ({"heading": 0.1}, WarningKind.LINK_ANGLE, 0.1),
        ({"extra": ELEVATED}, WarningKind.LINK_HEIGHT, 0.4),
    ],
)
def test_steps_across_a_link_have_their_amount(two_roads, change, kind, amount):
    network = two_roads(**change)
    (warning,) = of_kind(network, kind)
    assert (warning.road_id, warning.lane_id, warning.s_m) == ("a", -1, 50.0)
    assert warning.amount == pytest.approx(amount, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"back": ""}, WarningKind.ONE_SIDED_LINK),
        ({"answer": ""}, WarningKind.ONE_SIDED_LINK),
        (
            {"back": '<predecessor elementType="road" elementId="b" contactPoint="end"/>'},
            WarningKind.CONTRADICTING_LINK,
        ),
        (
            {"back": '<predecessor elementType="road" elementId="a" contactPoint="start"/>'},
            WarningKind.CONTRADICTING_LINK,
        ),
    ],
)
def test_links_that_only_one_side_has(two_roads, change, expected):
    assert expected in kinds(two_roads(**change))


def test_a_wrong_contact_point_is_a_gap(two_roads):
    link = '<successor elementType="road" elementId="b" contactPoint="end"/>'
    (warning,) = of_kind(two_roads(link=link), WarningKind.LINK_GAP)
    assert warning.amount >= 50.0


def test_membership_of_junctions(load, text):
    width = text.record("width", 3.0)
    section = text.section(right=text.lane(-1, width))
    stray = text.road(sections=section, road_id="stray", junction="j")
    lost = text.road(sections=section, road_id="lost", junction="nowhere")
    outside = text.road(sections=section, road_id="outside")
    connection = '<connection id="0" incomingRoad="lost" connectingRoad="outside" contactPoint="start"/>'
    network = load(stray, lost, outside, f'<junction id="j" name="">{connection}</junction>')
    found = of_kind(network, WarningKind.JUNCTION)
    assert [(w.road_id, w.element) for w in found] == [
        ("stray", "road"),
        ("lost", "road"),
        ("j", "junction/connection"),
    ]


def test_two_lanes_may_become_one(load, text):
    """Before 1.8 the one can name only one of them."""
    width = text.record("width", 3.0)
    two = text.section(
        right=text.lane(-1, f'<link><successor id="-1"/></link>{width}')
        + text.lane(-2, f'<link><successor id="-1"/></link>{width}')
    )
    one = text.section(50.0, right=text.lane(-1, f'<link><predecessor id="-1"/></link>{width}'))
    network = load(text.road(sections=two + one))
    assert of_kind(network, WarningKind.CONTRADICTING_LINK) == []
    assert of_kind(network, WarningKind.ONE_SIDED_LINK) == []


LANE = '<lane id="{}" type="driving"><link>{}</link><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'


def section(s_m: float, link: str = "") -> str:
    centre = '<center><lane id="0" type="none"/></center>'
    return f'<laneSection s="{s_m}">{centre}<right>{LANE.format(-1, link)}</right></laneSection>'


def chained(tmp_path, first: str, second: str, extra: str = "", length_m: float = 50.0):
    """Two straight roads that link to each other and meet, with lane sections and what else is in them."""
    line = '<planView><geometry s="0" x="{}" y="0" hdg="0" length="{}"><line/></geometry></planView>'
    road = '<road id="{}" length="{}" junction="-1"><link>{}</link>{}<lanes>{}</lanes>{}</road>'
    link = '<{} elementType="road" elementId="{}" contactPoint="{}"/>'
    roads = (
        road.format(
            "1", length_m, link.format("successor", "2", "start"), line.format(0, length_m), first, extra
        ),
        road.format("2", 50, link.format("predecessor", "1", "end"), line.format(length_m, 50), second, ""),
    )
    path = tmp_path / "chained.xodr"
    path.write_text(f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{"".join(roads)}</OpenDRIVE>')
    return load_map(path)


NEXT, BEFORE = '<successor id="-1"/>', '<predecessor id="-1"/>'


def test_linked_roads_without_lane_links(tmp_path):
    assert chained(tmp_path, section(0, NEXT), section(0, BEFORE)).findings == ()
    (finding,) = chained(tmp_path, section(0), section(0)).findings
    assert finding.kind is WarningKind.ONE_SIDED_LINK
    assert (finding.road_id, finding.lane_id, finding.s_m) == ("1", None, 50.0)
    assert "road '2'" in finding.message
    assert finding.rule


def test_lane_sections_without_lane_links(tmp_path):
    first = section(0, "") + section(20, NEXT)
    (finding,) = chained(tmp_path, first, section(0, BEFORE)).findings
    assert (finding.kind, finding.road_id, finding.s_m) == (WarningKind.ONE_SIDED_LINK, "1", 20.0)


def test_a_first_lane_section_that_starts_late(tmp_path):
    (finding,) = chained(tmp_path, section(5, NEXT), section(0, BEFORE)).findings
    assert (finding.kind, finding.road_id, finding.s_m, finding.amount, finding.unit) == (
        WarningKind.LATE_RECORD, "1", 5.0, 5.0, "m",
    )  # fmt: skip


def test_a_road_without_length(tmp_path):
    network = chained(tmp_path, section(0, NEXT), section(0, BEFORE), length_m=0.0)
    assert WarningKind.ROAD_LENGTH in kinds(network)


@pytest.mark.parametrize(("low", "high", "count"), [(-1, -1, 0), (-4, -2, 1), (-4, 0, 0), (1, 2, 1)])
def test_signals_for_lanes_that_are_not_there(tmp_path, low, high, count):
    signal = (
        '<signals><signal id="7" s="10" t="-4" name="" dynamic="no" orientation="+" zOffset="0" type="274" '
        f'subtype="50" value="50"><validity fromLane="{low}" toLane="{high}"/></signal></signals>'
    )
    network = chained(tmp_path, section(0, NEXT), section(0, BEFORE), signal)
    assert [(w.kind, w.road_id, w.s_m) for w in network.findings] == [
        (WarningKind.REFERENCE, "1", 10.0)
    ] * count


TWO_LANES = "<right>{}{}</right>"


def two_lanes(s_m: float, first: str, second: str) -> str:
    """A lane section with two lanes, each with its links."""
    centre = '<center><lane id="0" type="none"/></center>'
    lanes = TWO_LANES.format(LANE.format(-1, first), LANE.format(-2, second))
    return f'<laneSection s="{s_m}">{centre}{lanes}</laneSection>'


SECOND, SECOND_BEFORE = '<successor id="-2"/>', '<predecessor id="-2"/>'


@pytest.mark.parametrize("within", ["a road", "two roads"])
def test_a_lane_that_goes_on_without_a_link(tmp_path, within):
    """Lanes -1 are linked, lanes -2 meet with both borders."""
    if within == "a road":
        first = two_lanes(0, NEXT, "") + two_lanes(20, BEFORE + NEXT, SECOND)
        network = chained(tmp_path, first, two_lanes(0, BEFORE, SECOND_BEFORE))
    else:
        network = chained(tmp_path, two_lanes(0, NEXT, ""), two_lanes(0, BEFORE, ""))
    (finding,) = network.findings
    assert (finding.kind, finding.lane_id) == (WarningKind.ONE_SIDED_LINK, -2)
    assert (finding.road_id, finding.s_m) == ("1", 20.0 if within == "a road" else 50.0)


def test_a_lane_that_ends_needs_no_link(tmp_path):
    assert chained(tmp_path, two_lanes(0, NEXT, ""), section(0, BEFORE)).findings == ()


@pytest.mark.parametrize("revision", ["1.4", "1.8", "1.9"])
def test_links_to_another_layer_are_not_followed_in_any_revision(load, text, revision):
    width = text.record("width", 3.0)
    links = '<link><successor id="-1"/><successor id="-2" layer="temporary"/></link>'
    before = text.section(right=text.lane(-1, links + width) + text.lane(-2, width, "shoulder"))
    back = f'<link><predecessor id="-1"/></link>{width}'
    after = text.section(50.0, right=text.lane(-1, back) + text.lane(-2, width, "shoulder"))
    content = text.document(text.road(sections=before + after))
    network = load(content.replace('revMinor="8"', f'revMinor="{revision[-1]}"'), whole=True)
    assert network.successors(0) == (network.lane_index_of(("r", 1, -1)),)
