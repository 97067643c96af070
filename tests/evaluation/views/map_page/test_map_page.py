"""The page of a map: what is in it, and how it behaves in a browser."""

from __future__ import annotations

import json
import os
import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from evaluation.views.map_page import map_page, save_map_page
from evaluation.views.map_page.payload import UNITS_PER_M
from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from smartmot.area.lanes import MapArea, MapAreaConfig
from smartmot.maps.route import route_ahead
from smartmot.types import EgoState

ROOT = Path(__file__).parents[4]
FIELD = ROOT / "tests" / "data" / "field" / "opendrive"
TOWN = ROOT.parent / "shared" / "opendrive" / "maps" / "Town04.xodr"
REQUIRED = os.environ.get("SMARTMOT_BROWSER") == "required"
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


def payload(page: str) -> dict[str, Any]:
    """The data of a page."""
    text = re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.S)
    assert text is not None
    data: dict[str, Any] = json.loads(text[1])
    return data


def test_outlines_and_places_are_those_of_the_map() -> None:
    """Within the centimetres that they are written in."""
    network = load_map(shipped_map("urban_intersection"))
    data = payload(map_page(network, "a map"))
    assert [(row["road"], row["section"], row["lane"]) for row in data["lanes"]] == list(network.lanes.key)
    assert [row["next"] for row in data["lanes"]] == [
        list(network.successors(lane)) for lane in range(len(network.lanes))
    ]
    outlines = network.lane_polygons()
    for row, outline in zip(data["lanes"], outlines, strict=True):
        (ring,) = row["rings"]
        corners = np.cumsum(np.reshape(ring, (-1, 2)), axis=0) / UNITS_PER_M + data["origin"]
        assert shapely.hausdorff_distance(shapely.Polygon(corners), outline) < 0.01
    assert len(data["roads"]) == len(network.roads)
    assert len(data["junctions"]) == 1


def test_findings_are_at_their_place() -> None:
    data = payload(map_page(load_map(FIELD / "linked_roads_apart.xodr"), "apart"))
    (finding,) = data["findings"]
    at = np.array(finding["at"]) / UNITS_PER_M + data["origin"]
    np.testing.assert_allclose(at, (50.0, -1.75), atol=0.01)


def test_a_page_needs_no_network_and_trusts_no_name(tmp_path: Path) -> None:
    content = shipped_map("urban_street").read_text(encoding="utf-8")
    file = tmp_path / "odd.xodr"
    file.write_text(content.replace('name=""', 'name="&lt;/script&gt;&lt;b&gt;"'), encoding="utf-8")
    page = map_page(load_map(file), "<b>title</b>")
    assert "<b>" not in page
    assert not re.search(r"(?:src|href)=|https?://", page)


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of Town04."""
    if not TOWN.is_file():
        pytest.skip(f"the reference map is absent: {TOWN}")
    path = tmp_path_factory.mktemp("town") / "town.html"
    save_map_page(load_map(TOWN), path, "Town04")
    return path


def test_a_town_is_of_moderate_size(town: Path) -> None:
    assert town.stat().st_size < 15e6


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The page of an intersection in a browser; nothing may be on the console or asked of the network."""
    if REQUIRED:
        from playwright import sync_api
    else:
        sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
        if CHROMIUM is None:
            pytest.skip("no chromium on the PATH: no browser tests")
    path = tmp_path_factory.mktemp("map") / "map.html"
    save_map_page(load_map(shipped_map("urban_intersection")), path, "intersection")
    messages: list[str] = []
    urls: list[str] = []
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1000, "height": 800})
        page.on("console", lambda message: messages.append(message.text))
        page.on("pageerror", lambda error: messages.append(str(error)))
        page.on("request", lambda request: urls.append(request.url))
        page.goto(path.as_uri())
        until(page, "window.view !== undefined")
        yield page
        browser.close()
    assert messages == []
    assert [url for url in urls if not url.startswith("file:")] == []


def until(page: Any, condition: str) -> None:
    """Wait for a condition; the page's own wait evaluates text, which the page's policy forbids."""
    end = time.monotonic() + 30.0
    while not page.evaluate(f"() => {condition}"):
        assert time.monotonic() < end, f"not in 30 s: {condition}"
        page.wait_for_timeout(10)


SCREEN = "([x, y]) => [view.ox + view.scale * x, view.oy - view.scale * y]"


def test_hovering_names_the_lane_below(view: Any) -> None:
    lane = view.evaluate("() => mapPage.D.lanes.findIndex(l => l.type === 'driving' && !l.junction)")
    middle = view.evaluate(f"() => mapPage.D.lanes[{lane}].middle")
    x, y = view.evaluate(SCREEN, middle)
    view.mouse.move(x, y)
    key = view.evaluate(f"() => [mapPage.D.lanes[{lane}].road, mapPage.D.lanes[{lane}].lane]")
    assert f"road {key[0]}, section 0, lane {key[1]}" in view.locator("#tip").text_content()
    assert view.locator("#place").text_content().startswith("x ")


def test_searching_zooms_to_a_road_and_says_if_there_is_none(view: Any) -> None:
    road = view.evaluate("() => mapPage.D.roads[1].id")
    before = view.evaluate("() => view.scale")
    view.fill("#search", f"road {road}")
    view.press("#search", "Enter")
    until(view, f"view.scale !== {before!r}")
    assert view.evaluate("() => mapPage.marked.id") == road
    view.fill("#search", "road of nobody")
    view.press("#search", "Enter")
    assert view.locator("#note").text_content() == "nothing of that name"


def test_a_click_gives_the_place_for_the_command(view: Any) -> None:
    view.evaluate("() => mapPage.find('')")
    lane = view.evaluate("() => mapPage.D.lanes.findIndex(l => l.type === 'driving' && !l.junction)")
    view.evaluate(f"() => mapPage.fit(mapPage.D.lanes[{lane}].box, 0.5)")
    view.wait_for_timeout(60)
    x, y = view.evaluate(SCREEN, view.evaluate(f"() => mapPage.D.lanes[{lane}].middle"))
    view.mouse.click(x, y)
    row = view.evaluate(f"() => mapPage.D.lanes[{lane}]")
    text = view.locator("#note").text_content()
    place = re.fullmatch(r"--at (\S+),(-?\d+),([\d.]+)", text)
    assert place is not None
    assert (place[1], int(place[2])) == (row["road"], row["lane"])
    assert float(place[3]) == pytest.approx(sum(row["s"]) / 2.0, abs=1.0)


def test_layers_can_be_hidden_and_the_wheel_zooms(view: Any) -> None:
    picture = "() => document.getElementById('map').toDataURL()"
    view.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    shown = view.evaluate(picture)
    view.uncheck("input[name=lanes]")
    until(view, f"document.getElementById('map').toDataURL() !== {shown!r}")
    view.check("input[name=lanes]")
    scale = view.evaluate("() => view.scale")
    view.mouse.move(500, 400)
    view.mouse.wheel(0, -400)
    until(view, f"view.scale > {scale!r}")


def test_a_click_shows_the_monitored_lanes_there(view: Any) -> None:
    """The areas of the page against those of the strategy, before, in and after the junction."""
    network = load_map(shipped_map("urban_intersection"))
    config = MapAreaConfig()
    driving = np.flatnonzero(network.lanes.lane_type == "driving").tolist()
    compared = 0
    for lane in driving[::2]:
        for share, speed_kmh in ((0.3, 50.0), (0.9, 30.0)):
            low_m, high_m = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
            s_m = low_m + share * (high_m - low_m)
            shown = view.evaluate("([i, s, v]) => mapPage.monitored(i, s, v)", [lane, s_m, speed_kmh])
            route = route_ahead(network, lane, s_m, 200.0, 100.0)
            pose = route.pose(route.station_of(lane, s_m))
            expected = MapArea(network, route, config).at(EgoState(0.0, *pose, speed_kmh / 3.6)).polygons()
            assert sorted({area["role"] for area in shown}) == sorted({role for role, _ in expected})
            for role in {role for role, _ in expected}:
                here = shapely.union_all(
                    [shapely.Polygon(area["ring"]).buffer(0) for area in shown if area["role"] == role]
                )
                origin = view.evaluate("() => mapPage.D.origin")
                here = shapely.transform(here, lambda xy, origin=origin: xy + origin)
                there = shapely.union_all(
                    [shapely.Polygon(ring).buffer(0) for other, ring in expected if other == role]
                )
                assert here.symmetric_difference(there).area < 0.01 * there.area + 0.05, (lane, role)
                compared += 1
    assert compared > 30


def test_a_click_on_the_canvas_draws_and_follows_the_speed(view: Any) -> None:
    lane = view.evaluate("() => mapPage.D.lanes.findIndex(l => l.type === 'driving' && l.junction === null)")
    view.evaluate(f"() => mapPage.fit(mapPage.D.lanes[{lane}].box, 0.5)")
    view.wait_for_timeout(60)
    x, y = view.evaluate(SCREEN, view.evaluate(f"() => mapPage.D.lanes[{lane}].middle"))
    view.mouse.click(x, y)
    roles = "() => mapPage.picked.areas.map(a => a.role)"
    assert {"current", "back", "vru_margin"} <= set(view.evaluate(roles))
    assert view.locator("#roles span").all_text_contents()[:2] == ["current", "back"]
    picture = "() => document.getElementById('map').toDataURL()"
    before = view.evaluate(picture)
    view.fill("#speed", "90")
    until(view, f"document.getElementById('map').toDataURL() !== {before!r}")
    view.fill("#speed", "50")


def test_a_step_on_a_town_takes_less_than_a_tenth_of_a_second(view: Any, town: Path) -> None:
    page = view.context.browser.new_page(viewport={"width": 1000, "height": 800})
    page.goto(town.as_uri())
    until(page, "window.view !== undefined")
    spent_ms = []
    for k in range(12):  # the whole town, then steps of zoom into it
        page.mouse.move(500, 400)
        page.mouse.wheel(0, -200 if k % 2 else -100)
        page.wait_for_timeout(30)
        spent_ms.append(page.evaluate("() => lastPaintMs"))
    page.close()
    assert np.median(spent_ms) < 100.0


def test_upper_roads_are_drawn_and_found_above_lower_ones(view: Any, tmp_path: Path) -> None:
    path = tmp_path / "bridge.html"
    save_map_page(load_map(FIELD / "bridge_two_levels.xodr"), path, "bridge")
    page = view.context.browser.new_page(viewport={"width": 1000, "height": 800})
    page.goto(path.as_uri())
    until(page, "window.view !== undefined")
    lane = page.evaluate("() => mapPage.D.lanes.findIndex(l => l.road === '2')")
    heights = page.evaluate("() => mapPage.D.lanes.map(l => l.z)")
    assert heights[lane] == 6.0
    x_m, y_m = page.evaluate("() => mapPage.D.origin")
    at = page.evaluate(SCREEN, [(48.5 - x_m) * UNITS_PER_M, (-1.5 - y_m) * UNITS_PER_M])
    assert page.evaluate("([x, y]) => mapPage.at(x, y).lane.road", at) == "2"
    page.close()
