"""Traffic signals in log, page and film: what each shows, when, and where it stands on the map."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from evaluation.results.files import log_path
from evaluation.results.logs import read_log
from evaluation.results.rows import read_runs
from evaluation.runs.folder import read_folder
from evaluation.views.account.explain import explain
from evaluation.views.film.run import RunDrawing
from evaluation.views.frames import LogFrames, frames_of
from evaluation.views.page.payload import pack_run, read_run
from evaluation.views.plots.birdseye import birdseye
from evaluation.views.plots.objects import HOUSING_COLOUR, SIGNAL_COLOURS, signal_lamp
from evaluation.views.traces.run import LoggedRun
from opendrive import load_map
from tests.evaluation.views.conftest import call
from tests.scenarios.openscenario.conftest import (
    EGO_AT_START,
    act,
    at_time,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
    write_scenario,
)

RED_LIGHT, POLE = (42.0, -9.0), (50.0, 8.0)
"""Where the signals stand: `1` beside road A, which runs along the x axis; `2` by its physical position."""
SIGNALS = (
    '<signals><signal s="42" t="-9" id="1" name="a" dynamic="yes" orientation="+" zOffset="3" type="1000001" '
    'subtype="-1" country="OpenDRIVE"/>'
    '<signal s="90" t="-9" id="2" name="b" dynamic="yes" orientation="+" zOffset="3" type="1000001" '
    'subtype="-1" country="OpenDRIVE"><positionInertial x="50" y="8" z="2" hdg="0"/></signal></signals>'
)
CONTROLLER = (
    '<TrafficSignals><TrafficSignalController name="c" delay="0">'
    '<Phase name="go" duration="2"><TrafficSignalState trafficSignalId="1" state="off;off;on"/></Phase>'
    '<Phase name="stop" duration="30"><TrafficSignalState trafficSignalId="1" state="on;off;off"/></Phase>'
    "</TrafficSignalController></TrafficSignals>"
)


def shows(signal: str, state: str) -> str:
    return (
        "<GlobalAction><InfrastructureAction><TrafficSignalAction>"
        f'<TrafficSignalStateAction name="{signal}" state="{state}"/>'
        "</TrafficSignalAction></InfrastructureAction></GlobalAction>"
    )


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The ego drives past for 5 s; `1` is green, red from 2 s on; `2` amber from 3 s on; `x` is nowhere."""
    place = tmp_path_factory.mktemp("signals")
    late = trigger(condition(at_time(3)))
    events = (event("e", shows("2", "Amber"), late), event("f", shows("x", "red"), late))
    path = write_scenario(
        place,
        act(maneuver(*events)),
        init=EGO_AT_START + private("Other", teleport(lane_position(250)), speed(0)),
        stop=trigger(condition(at_time(5)), kind="StopTrigger"),
    )
    road = place / "two_roads.xodr"
    road.write_text(road.read_text().replace("</lanes></road>", f"</lanes>{SIGNALS}</road>", 1))
    path.write_text(path.read_text().replace('"two_roads.xodr"/>', f'"two_roads.xodr"/>{CONTROLLER}'))
    return path


@pytest.fixture(scope="module")
def folder(scenario: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    assert call("run", scenario, "--out", out, "--no-pictures", "--quiet", "--strategy", "map") == 0
    return out


@pytest.fixture(scope="module")
def log(folder: Path) -> pd.DataFrame:
    return read_log(log_path(folder, str(read_runs(folder)["log"].iloc[0])))


@pytest.fixture(scope="module")
def frames(log: pd.DataFrame) -> LogFrames:
    return frames_of(log)


def test_a_log_has_every_change_at_the_place_of_its_signal(log: pd.DataFrame) -> None:
    rows = log[log["kind"] == "signal"]
    assert rows["category"].tolist() == ["1", "1", "2", "x"]
    assert rows["label"].tolist() == ["off;off;on", "on;off;off", "Amber", "red"]
    assert rows["time_s"].tolist() == pytest.approx([0.0, 2.0, 3.0, 3.0], abs=0.1)
    assert rows[["x_m", "y_m"]].to_numpy()[:3] == pytest.approx(np.array([RED_LIGHT, RED_LIGHT, POLE]))
    assert rows[["x_m", "y_m"]].iloc[3].isna().all()


def test_a_signal_that_the_map_lacks_is_noted(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("run", scenario, "--out", tmp_path, "--no-pictures", "--no-aeb") == 0
    assert "the map has no signal 'x'" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("time_s", "states"), [(0.0, ["off;off;on"]), (1.8, ["off;off;on"]), (2.2, ["on;off;off"])]
)
def test_a_state_holds_until_the_next(frames: LogFrames, time_s: float, states: list[str]) -> None:
    assert frames.signals_at(frames.frame_at(time_s))["label"].tolist() == states


def test_the_page_gets_every_change_with_a_place(folder: Path, frames: LogFrames) -> None:
    run = read_folder(folder).runs.to_dict("records")[0]
    origin = np.array([7.0, 3.0])
    signals = read_run(pack_run(frames, explain(frames, run), origin, {}), origin)["signals"]
    assert [(signal, lamp) for _, signal, lamp, _ in signals] == [
        ("1", "green"),
        ("1", "red"),
        ("2", "yellow"),
    ]
    assert frames.time_s[[frame for frame, *_ in signals]] == pytest.approx([0.0, 2.0, 3.0], abs=0.1)
    assert np.array([place for *_, place in signals]) == pytest.approx(np.array([RED_LIGHT, RED_LIGHT, POLE]))


def lamps(drawing: RunDrawing, time_s: float) -> set[str]:
    """Lamps whose colour a film's picture has in full on many pixels."""
    image = drawing.picture(drawing.frames.frame_at(time_s))
    lit = {
        lamp: np.rint(np.array(to_rgb(colour)) * 255)
        for lamp, colour in SIGNAL_COLOURS.items()
        if lamp != "off"
    }
    return {lamp for lamp, rgb in lit.items() if (image[..., :3] == rgb).all(axis=2).sum() > 30}


def test_a_film_shows_which_lamp_is_lit(folder: Path, frames: LogFrames) -> None:
    drawing = RunDrawing(frames, explain(frames, read_folder(folder).runs.to_dict("records")[0]), None, "t")
    assert lamps(drawing, 1.0) == {"green"}
    assert lamps(drawing, 2.5) == {"red"}
    assert lamps(drawing, 3.2) == {"red", "yellow"}
    assert lamps(drawing, 1.0) == {"green"}


@pytest.fixture(scope="module")
def logged(folder: Path, log: pd.DataFrame) -> LoggedRun:
    return LoggedRun(str(read_runs(folder)["log"].iloc[0]), log)


@pytest.mark.parametrize(
    ("time_s", "words"),
    [(1.0, {"1: green"}), (2.6, {"1: red"}), (3.4, {"1: red", "2: yellow"})],
)
def test_a_still_shows_the_lamp_and_where_it_stands(
    scenario: Path, log: pd.DataFrame, time_s: float, words: set[str]
) -> None:
    """The ego looks east from x = 10 + 10 t (its box 1.5 m further)."""
    figure = birdseye(load_map(scenario.with_name("two_roads.xodr")), log, time_s, [])
    axes = figure.axes[0]
    assert {text.get_text() for text in axes.texts} >= words
    lines = {str(line.get_gid()): line for line in axes.lines if str(line.get_gid()).startswith("signal ")}
    assert set(lines) == {f"signal {word[0]}" for word in words}
    ego = log[(log["kind"] == "ego") & ((log["time_s"] - time_s).abs() < 0.051)].iloc[0]
    for word in words:
        place, line = {"1": RED_LIGHT, "2": POLE}[word[0]], lines[f"signal {word[0]}"]
        offset = np.hypot(
            line.get_xdata()[0] - (place[0] - ego["x_m"]), line.get_ydata()[0] - (place[1] - ego["y_m"])
        )
        assert offset < 1.0  # the still's frame is the nearest that perception has
        assert to_rgb(line.get_markerfacecolor()) == to_rgb(SIGNAL_COLOURS[word[3:]])


def test_a_trace_of_osi_has_the_lamp_that_is_lit(logged: LoggedRun) -> None:
    light = pytest.importorskip("osi3.osi_trafficlight_pb2").TrafficLight.Classification
    from evaluation.views.traces.osi import HOST_ID, ground_truth

    messages, _ = ground_truth(logged)
    shown = {}
    for message in messages:
        now = message.timestamp.seconds + message.timestamp.nanos * 1e-9
        shown[round(now, 2)] = {
            lamp.source_reference[0].identifier[0]: (
                light.Color.Name(lamp.classification.color),
                lamp.id.value,
            )
            for lamp in message.traffic_light
        }
        places = {
            lamp.source_reference[0].identifier[0]: lamp.base.position for lamp in message.traffic_light
        }
        assert all((p.x, p.y) == pytest.approx({"1": RED_LIGHT, "2": POLE}[k]) for k, p in places.items())
    assert shown[1.0] == {"1": ("COLOR_GREEN", HOST_ID + 1)}
    assert shown[2.5] == {"1": ("COLOR_RED", HOST_ID + 1)}
    assert shown[3.5] == {"1": ("COLOR_RED", HOST_ID + 1), "2": ("COLOR_YELLOW", HOST_ID + 2)}


def test_an_mcap_says_what_all_show_whenever_one_changes(logged: LoggedRun) -> None:
    pytest.importorskip("foxglove")
    reader = pytest.importorskip("mcap.reader")
    decoder = pytest.importorskip("mcap_protobuf.decoder")
    from evaluation.views.traces.mcap import mcap_bytes

    content = io.BytesIO(mcap_bytes(logged)[0])
    made = reader.make_reader(content, decoder_factories=[decoder.DecoderFactory()])
    said = [
        (message.log_time * 1e-9, [(entity.id, entity.texts[0].text) for entity in update.entities])
        for _, _, message, update in made.iter_decoded_messages(topics=["/traffic_signals"])
    ]
    assert [time for time, _ in said] == pytest.approx([0.0, 2.0, 3.0], abs=0.1)
    assert said[0][1] == [("signal 1", "1: green")]
    assert said[2][1] == [("signal 1", "1: red"), ("signal 2", "2: yellow")]


@pytest.mark.parametrize(
    ("state", "lamp"),
    [
        ("red", "red"),
        ("TrafficLightRed", "red"),
        ("STOP", "red"),
        ("amber", "yellow"),
        ("red_amber", "red"),
        ("GO", "green"),
        ("on;off;off", "red"),
        ("on;on;off", "red"),
        ("off;flashing;off", "yellow"),
        ("off;on", "green"),
        ("off;off;off", "off"),
        ("off", "off"),
        ("reduced", "reduced"),
        ("mode 3", "mode 3"),
        ("on;off;off;off", "on;off;off;off"),
    ],
)
def test_states_name_the_strictest_lamp_or_stay_as_they_are(state: str, lamp: str) -> None:
    assert signal_lamp(state) == lamp


def test_places_of_signals(folder: Path) -> None:
    files = read_folder(folder).setups.values()
    network: Any = next(iter(files)).network
    assert network.place_of_signal("1") == pytest.approx((*RED_LIGHT, 3.0))
    assert network.place_of_signal("2") == pytest.approx((*POLE, 2.0))
    assert network.place_of_signal("x") is None


def test_the_page_draws_them_where_they_stand(folder: Path, tmp_path: Path) -> None:
    browser = pytest.importorskip("tests.browser")
    if browser.CHROMIUM is None and not browser.REQUIRED:
        pytest.skip("no chromium on the PATH: no browser tests")
    path = tmp_path / "report.html"
    assert call("report", folder, "--out", path, "--quiet") == 0
    frames = frames_of(read_log(log_path(folder, str(read_runs(folder)["log"].iloc[0]))))
    canvas = "document.getElementById('scene')"

    def rgb(colour: str) -> list[int]:
        return [round(255 * part) for part in to_rgb(colour)]

    with browser.opened(path, "desktop") as page:

        def pixel(frame: int) -> list[int]:
            """Colour at the place of signal 1: the ego heads along x, and is 9 m of 51 from the left."""
            page.locator("#slider").evaluate(
                "(s, at) => { s.value = at; s.dispatchEvent(new Event('input')); }", frame
            )
            wide, high = page.evaluate(f"[{canvas}.width, {canvas}.height]")
            ego, scale = frames.ego_state(frame), wide / 51
            x = wide * 9 / 51 + (RED_LIGHT[0] - ego.x_m) * scale
            y = high / 2 - (RED_LIGHT[1] - ego.y_m) * scale
            picture = page.evaluate(browser.PICTURE).partition(",")[2]
            image = Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB")
            return list(np.asarray(image)[round(y), round(x)])

        assert pixel(5) == rgb(SIGNAL_COLOURS["green"])
        assert pixel(50) == rgb(SIGNAL_COLOURS["red"])
        page.get_by_label("traffic signals").uncheck()
        assert pixel(50) not in [rgb(SIGNAL_COLOURS["red"]), rgb(HOUSING_COLOUR)]
