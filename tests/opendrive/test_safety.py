"""Files made to hurt: each is refused by name, or read, quickly and in little memory."""

import time
import tracemalloc

import numpy as np
import pytest

from opendrive import MapContentError, MapReadError, WarningKind, load_map, read_map
from opendrive.xml.document import MAX_TAGS

BILLION = """<?xml version="1.0"?><!DOCTYPE OpenDRIVE [<!ENTITY a "aaaaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">
<!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;&c;"><!ENTITY e "&d;&d;&d;&d;&d;&d;&d;&d;&d;&d;">
<!ENTITY f "&e;&e;&e;&e;&e;&e;&e;&e;&e;&e;"><!ENTITY g "&f;&f;&f;&f;&f;&f;&f;&f;&f;&f;">
<!ENTITY h "&g;&g;&g;&g;&g;&g;&g;&g;&g;&g;"><!ENTITY i "&h;&h;&h;&h;&h;&h;&h;&h;&h;&h;">]>
<OpenDRIVE><header name="&i;"/></OpenDRIVE>"""
QUADRATIC = f'<!DOCTYPE OpenDRIVE [<!ENTITY a "{"a" * 50_000}">]><OpenDRIVE>{"&a;" * 5_000}</OpenDRIVE>'
OUTSIDE = '<!DOCTYPE OpenDRIVE SYSTEM "file:///etc/hostname"><OpenDRIVE/>'
PARAMETER = '<!DOCTYPE OpenDRIVE [<!ENTITY % p SYSTEM "http://127.0.0.1:9/x">%p;]><OpenDRIVE/>'


def refused(tmp_path, content: bytes, match: str, seconds: float = 5.0) -> None:
    file = tmp_path / "bad.xodr"
    file.write_bytes(content)
    start = time.process_time()
    with pytest.raises(MapReadError, match=match) as caught:
        load_map(file)
    assert time.process_time() - start < seconds
    message = str(caught.value)
    assert "bad.xodr" in message
    assert "\n" not in message
    assert len(message) < 1000


@pytest.mark.parametrize("content", [BILLION, QUADRATIC, OUTSIDE, PARAMETER])
def test_entities_and_document_types_are_refused(tmp_path, content):
    refused(tmp_path, content.encode(), "DOCTYPE|not well-formed")


@pytest.mark.parametrize("tag", ["a", "road", "userData"])
def test_100000_nested_elements_are_refused(tmp_path, tag):
    nested = f"<{tag}>" * 100_000 + f"</{tag}>" * 100_000
    refused(tmp_path, f"<OpenDRIVE>{nested}</OpenDRIVE>".encode(), "not well-formed")


def test_200_megabytes_without_end_are_refused(tmp_path):
    refused(tmp_path, b'<OpenDRIVE><a b="' + b"x" * (200 * 2**20), "not well-formed")


def test_a_long_tag_text_or_blank_is_refused(tmp_path):
    filler = b"x" * (20 * 2**20)
    for before, after in ((b'<a b="', b'"/>'), (b"<a>", b"</a>")):
        refused(tmp_path, b"<OpenDRIVE>" + before + filler + after + b"</OpenDRIVE>", "not well-formed")
    refused(tmp_path, filler, "not well-formed")
    refused(tmp_path, b" " * len(filler), "empty")


def test_too_many_tags_and_too_many_bytes_are_refused_unread(tmp_path):
    refused(tmp_path, b"<OpenDRIVE>" + b"<a/>" * (MAX_TAGS + 1) + b"</OpenDRIVE>", "more than .* tags")
    file = tmp_path / "huge.xodr"
    with file.open("wb") as stream:
        stream.truncate(2**36)
    with pytest.raises(MapReadError, match="larger than"):
        load_map(file)


def test_memory_grows_with_the_file_and_no_faster(tmp_path, text):
    file = tmp_path / "many.xodr"
    per_road = []
    for count in (100, 400):
        file.write_text(text.document(*(text.road(road_id=str(i)) for i in range(count))), encoding="utf-8")
        tracemalloc.start()
        model = read_map(file)
        per_road.append(tracemalloc.get_traced_memory()[1] / count)
        tracemalloc.stop()
        assert len(model.roads) == count
    assert per_road[1] < 1.2 * per_road[0]
    assert per_road[1] < 100_000


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "iso-8859-1", "windows-1252"])
def test_encodings_are_honoured(tmp_path, text, encoding):
    content = text.document(text.road(road_id="Häggvägen")).split("\n", 1)[1]
    declared = "utf-8" if encoding == "utf-8-sig" else encoding
    file = tmp_path / "map.xodr"
    file.write_bytes(f'<?xml version="1.0" encoding="{declared}"?>{content}'.encode(encoding))
    assert list(load_map(file).roads) == ["Häggvägen"]


def test_wrong_encodings_are_refused(tmp_path, text):
    content = text.document(text.road(road_id="Häggvägen"))
    refused(tmp_path, content.encode("latin-1"), "not well-formed")
    refused(tmp_path, content.encode("utf-16")[1:], "not well-formed")
    refused(tmp_path, b'<?xml version="1.0" encoding="klingon"?><OpenDRIVE/>', "not well-formed")


def test_includes_are_refused(tmp_path, text):
    content = text.document('<include file="other.xodr"/>', text.road())
    refused(tmp_path, content.encode(), "includes 'other.xodr'")


@pytest.mark.parametrize(
    "value", ["nan", "inf", "-inf", "1e308", "-1e308", "1e999", "1e10", "x" * 10_000, ""]
)
@pytest.mark.parametrize(
    "attribute", ['s="0"', 'x="10"', 'y="5"', 'hdg="0.3"', 'length="100"', 'a="3.5"', 'd="0.0"']
)
def test_absurd_numbers_where_a_road_lies_are_refused(tmp_path, text, attribute, value):
    name = attribute.split("=", maxsplit=1)[0]
    content = text.document(text.road()).replace(attribute, f'{name}="{value}"', 1)
    refused(tmp_path, content.encode(), rf"road 'r', <\w+>, line \d+: attribute '{name}'")


@pytest.mark.parametrize("length", ["-1", "1e7"])
def test_impossible_lengths_are_refused(tmp_path, text, length):
    content = text.document(text.road()).replace('length="100.0"', f'length="{length}"')
    refused(tmp_path, content.encode(), "'length' is")


BESIDE = (
    '<objects><object id="1" type="pole" s="nan" t="0"/><object id="2" type="pole" s="5" t="0"/></objects>'
    '<signals><signal id="1" s="5" t="1e308"/></signals>'
)


def test_absurd_numbers_beside_the_road_are_left_out_with_a_warning(load, text):
    mark = '<roadMark sOffset="inf" type="solid"/><roadMark sOffset="1" type="solid"/>'
    width = text.record("width", 3.0)
    lanes = text.section(right=text.lane(-1, width + mark + '<speed sOffset="0" max="1e400"/>'))
    network = load(text.road(sections=lanes, extra=BESIDE))
    road = network.model.roads["r"]
    assert [item.id for item in road.objects] == ["2"]
    assert road.signals == ()
    lane = road.sections[0].lanes[-1]
    assert [m.s_offset_m for m in lane.road_marks] == [1.0]
    assert lane.speeds == ()
    assert [w.kind for w in network.warnings] == [WarningKind.LEFT_OUT] * 4
    assert all("left out" in w.message for w in network.warnings)


def test_numbers_too_small_for_normal_floats_pass(load, text):
    network = load(text.road('<geometry s="0" x="1e-320" y="0" hdg="0" length="100"><line/></geometry>'))
    assert np.isfinite(network.bounds).all()


def test_the_error_of_a_road_names_it_even_if_its_id_is_long(tmp_path, text):
    content = text.document(text.road(road_id="r" * 100_000)).replace('hdg="0.3"', 'hdg="nan"')
    refused(tmp_path, content.encode(), "attribute 'hdg'")


def test_a_map_without_lanes_is_refused_by_road(tmp_path, text):
    content = text.document(text.road(road_id="7")).replace("lanes>", "lines>")
    file = tmp_path / "bad.xodr"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(MapContentError, match=r"road '7', <road>, line 2: <lanes> is missing"):
        load_map(file)


def test_a_spiral_that_turns_as_far_as_is_allowed_takes_a_second_or_so(load, text):
    def plan(turn_rad):
        spiral = f'<spiral curvStart="0" curvEnd="{turn_rad / 100.0!r}"/>'
        return f'<geometry s="0" x="0" y="0" hdg="0" length="100">{spiral}</geometry>'

    with pytest.raises(MapContentError, match="turns by 101 rad"):
        load(text.road(plan(101.0)))
    network = load(text.road(plan(99.0)))
    start = time.process_time()
    assert np.isfinite(network.bounds).all()
    assert len(network.lane_polygons()) == 2
    assert network.locate([[0.0, 1.0]]).lane.size
    assert time.process_time() - start < 10.0
