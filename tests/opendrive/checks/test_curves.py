import pytest

from opendrive import MapContentError, WarningKind, load_map
from opendrive.checks import warning_table


def kinds(network):
    return [warning.kind for warning in network.warnings]


def line(s, x, y, heading, length):
    return f'<geometry s="{s}" x="{x}" y="{y}" hdg="{heading}" length="{length}"><line/></geometry>'


@pytest.mark.parametrize(
    ("plan", "expected", "s_m"),
    [
        (line(0, 0, 0, 0, 60) + line(60, 60, 0, 0, 40), [], None),
        (line(0, 0, 0, 0, 60) + line(60, 60, 0.04, 0.01, 40), [], None),
        (line(0, 0, 0, 0, 60) + line(60, 60, 0.06, 0, 40), [WarningKind.GAP], 60.0),
        (line(0, 0, 0, 0, 60) + line(60, 60, 0, 0.03, 40), [WarningKind.HEADING_GAP], 60.0),
        (line(0, 0, 0, 6.25, 60) + line(60, 59.967, -1.991, -0.0331853, 40), [], None),
        (line(0, 0, 0, 0, 60) + line(50, 60, 0, 0, 50), [WarningKind.CURVE_LENGTH], 0.0),
        (line(0, 0, 0, 0, 90), [WarningKind.ROAD_LENGTH], 0.0),
        (
            line(0, 0, 0, 0, 100).replace("<line/>", '<arc curvature="0"/>'),
            [WarningKind.ARC_WITHOUT_CURVATURE],
            0.0,
        ),
        (
            line(0, 0, 0, 0, 100).replace("<line/>", '<spiral curvStart="0.01" curvEnd="0.01"/>'),
            [WarningKind.CONSTANT_SPIRAL],
            0.0,
        ),
    ],
)  # fmt: skip
def test_defects_of_reference_lines(load, text, plan, expected, s_m):
    network = load(text.road(plan))
    assert kinds(network) == expected
    assert [warning.s_m for warning in network.warnings] == ([] if s_m is None else [s_m])


@pytest.mark.parametrize(
    ("coefficients", "negative"),
    [
        ((3.0, 0.0, 0.0, 0.0), False),
        ((-0.01, 0.0, 0.0, 0.0), True),
        ((3.0, -0.03, 0.0, 0.0), False),
        ((3.0, -0.031, 0.0, 0.0), True),
        # (s - 50)^2 / 1000 - 0.1 dips below 0 only around s = 50 m.
        ((2.4, -0.1, 0.001, 0.0), True),
        ((2.6, -0.1, 0.001, 0.0), False),
        # Turning points of 1 - 0.12 s + 0.003 s^2 - 0.00002 s^3 at s = 27.6 and 72.4 m; 0 < 0.46 there.
        ((2.0, -0.12, 0.003, -0.00002), False),
        ((1.4, -0.12, 0.003, -0.00002), True),
    ],
)
def test_negative_widths(load, text, coefficients, negative):
    lanes = text.section(right=text.lane(-1, text.record("width", *coefficients)))
    network = load(text.road(sections=lanes))
    assert kinds(network) == [WarningKind.NEGATIVE_WIDTH] * negative


def test_lane_ids_types_and_sections(load, text):
    width = text.record("width", 3.0)
    lanes = text.section(right=text.lane(-1, width, "slipLane") + text.lane(-3, width, "hyperloop"))
    beyond = text.section(101.5, right=text.lane(-1, width))
    network = load(text.road(sections=lanes + beyond))
    assert kinds(network) == [
        WarningKind.LANE_IDS,
        WarningKind.UNKNOWN_LANE_TYPE,
        WarningKind.LEFT_OUT,
    ]
    assert network.warnings[2].s_m == 101.5
    assert len(network.model.roads["r"].sections) == 1
    with pytest.raises(MapContentError, match="no lane section starts on the road"):
        load(text.road(sections=beyond))


def test_ids_of_signals_and_objects_used_twice(load, text):
    extra = '<signals><signal id="1" s="5" t="0"/><signal id="1" s="6" t="0"/></signals>'
    objects = '<objects><object id="1" type="pole" s="5" t="0"/></objects>'
    network = load(text.road(extra=extra + objects))
    assert kinds(network) == [WarningKind.DUPLICATE_ID]
    assert network.warnings[0].s_m == 6.0


def test_strict_names_the_first_defect_and_their_number(load, text, tmp_path):
    plan = line(0, 0, 0, 0, 60) + line(60, 60, 2, 0.5, 30)
    network = load(text.road(plan))
    assert kinds(network) == [WarningKind.GAP, WarningKind.HEADING_GAP, WarningKind.ROAD_LENGTH]
    with pytest.raises(
        MapContentError, match=r"map\.xodr: road 'r', <planView/geometry>: gap: .*\(and 2 more\)"
    ):
        load_map(tmp_path / "map.xodr", strict=True)
    table = warning_table(network.warnings)
    assert len(table) == 5
    assert table[-1] == "3 defects"
    assert "heading gap" in table[2]
    assert "60.00" in table[2]


@pytest.mark.parametrize("shape", ['<arc curvature="0"/>', '<spiral curvStart="0.01" curvEnd="0.01"/>'])
def test_what_is_read_exactly_is_no_defect(load, text, tmp_path, shape):
    """The standard asks for none; junctions that other tools write have them."""
    network = load(text.road(line(0, 0, 0, 0, 100).replace("<line/>", shape)))
    assert warning_table(network.warnings)[-1] == "0 defects, 1 broken rules of the standard"
    assert len(load_map(tmp_path / "map.xodr", strict=True).lanes) == 2


def test_strict_passes_a_sound_map(load, text, tmp_path):
    assert warning_table(load(text.road()).warnings) == ["0 defects"]
    assert len(load_map(tmp_path / "map.xodr", strict=True).lanes) == 2


def test_a_reference_line_that_starts_late(load, text):
    plan = '<geometry s="10" x="10" y="0" hdg="0" length="90"><line/></geometry>'
    (warning,) = load(text.road(plan)).warnings
    assert (warning.kind, warning.s_m, warning.amount) == (WarningKind.LATE_RECORD, 10.0, 10.0)


def test_gaps_and_kinks_have_their_amount(load, text):
    """The second piece starts 3 m and 4 m away from the end of the first, turned by 0.2 rad."""
    plan = (
        '<geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry>'
        '<geometry s="50" x="53" y="4" hdg="0.2" length="49"><line/></geometry>'
    )
    found = {w.kind: w for w in load(text.road(plan)).warnings}
    amounts = {kind: (w.amount, w.unit) for kind, w in found.items()}
    assert amounts == {
        WarningKind.GAP: (pytest.approx(5.0), "m"),
        WarningKind.HEADING_GAP: (pytest.approx(0.2), "rad"),
        WarningKind.ROAD_LENGTH: (pytest.approx(1.0), "m"),
    }
