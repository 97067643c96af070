"""A folder of runs as one HTML page that needs no network."""

from __future__ import annotations

import importlib.resources
import json
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.protocols.paper import PUBLISHED
from evaluation.results.by_speed import comparison_table, impact_table
from evaluation.results.files import check_writable, write_whole
from evaluation.results.tables import Table
from evaluation.runs.folder import Run, RunFolder, read_folder
from evaluation.runs.specs import lidar_notes
from evaluation.views.account.explain import Account, explain
from evaluation.views.frames import frames_of
from evaluation.views.page import charts
from evaluation.views.page.comparison import HEIGHT, WIDTH, Comparison
from evaluation.views.page.payload import pack_map, pack_run
from evaluation.views.page.summary import Matrix, Verdict, by_scenario, score_matrix, verdicts
from evaluation.views.pictures import told_of_writing
from evaluation.views.plots.ground import AREA_COLOURS, LANE_COLOURS, OTHER_LANE_COLOUR
from evaluation.views.plots.objects import (
    DETECTION_COLOURS,
    EGO_COLOUR,
    HOUSING_COLOUR,
    SIGNAL_COLOURS,
    TRACK_COLOURS,
)
from evaluation.views.plots.speed import speed_style
from evaluation.views.plots.strategies import strategy_looks
from opendrive import RoadNetwork
from scenarios.presets import PRESETS
from scenarios.settings import PARAMETERS
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

PAGE_NAME = "report.html"

_FEW = 3
"""Names that a heading holds, and scenarios that get diagrams of their own."""

PALETTE = {
    "lanes": LANE_COLOURS, "other": OTHER_LANE_COLOUR, "areas": AREA_COLOURS, "tracks": TRACK_COLOURS,
    "detections": DETECTION_COLOURS, "ego": EGO_COLOUR, "signals": SIGNAL_COLOURS, "housing": HOUSING_COLOUR,
}  # fmt: skip
"""Colours that the page's script draws with."""


@dataclass(frozen=True, slots=True)
class RunView:
    """A run as the page shows it.

    Args:
        log: name of its log.
        strategy: monitored area.
        title: strategy, speed and what else sets it apart from the others.
        account: what happened, in words.
        packed: what its replay draws.
        map_index: which of the page's maps it is on; -1 without a map.
    """

    log: str
    strategy: str
    title: str
    account: Account
    packed: str
    map_index: int


@dataclass(frozen=True, slots=True)
class PageContent:
    """Everything that the template shows.

    `colours` by strategy, `recorded` of recorded drives; `comparison` stands in place of verdicts and matrix.
    """

    title: str
    facts: dict[str, str]
    notes: tuple[str, ...]
    verdicts: list[Verdict]
    matrix: Matrix
    table: Table
    runs: list[RunView]
    first: int
    colours: dict[str, str]
    panels: list[tuple[str, dict[str, Any]]]
    legend: list[tuple[str, str, bool]]
    packed_maps: list[str]
    palette: dict[str, Any]
    recorded: bool = False
    comparison: Comparison | None = None


def write_page(
    directory: Path,
    out: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
    allow_plugins: bool = False,
) -> tuple[Path, tuple[str, ...]]:
    """Write the report of a folder of results.

    Args:
        directory: what a run wrote.
        out: the page; None: `report.html` in the folder.
        progress: called with the runs read so far and their number.
        allow_plugins: whether code of the user's own may make monitored areas again.

    Returns:
        The page, and what the reader has to know about what is missing.

    Raises:
        ResultsError: the folder cannot be read, or its logs are missing.
        ArgumentError: the page cannot be written.
    """
    folder = read_folder(directory, allow_plugins)
    target = directory / PAGE_NAME if out is None else out
    with told_of_writing("--out", target):
        check_writable(target)
    text = render(page_content(folder, progress))
    with told_of_writing("--out", target):
        write_whole(target, text.encode())
    return target, folder.notes


def page_content(
    folder: RunFolder, progress: Callable[[int, int], None] = lambda done, total: None
) -> PageContent:
    """Read all runs of a folder and say what they came to.

    Raises:
        ResultsError: a log is missing or broken.
    """
    rows = folder.runs[folder.runs["log"].notna()]
    rows = rows[~rows["log"].duplicated()]
    distinct = _distinct_columns(rows)
    runs = [Shown(str(run["log"]), _title(run, distinct), folder, run) for run in rows.to_dict("records")]
    replays = replays_of(runs, progress)
    views = replays.views
    accounts = {view.log: view.account for view in views}
    return PageContent(
        title=_subject(rows),
        facts=_facts(folder),
        notes=folder.notes,
        verdicts=verdicts(rows, accounts, {view.log: view.title for view in views}),
        matrix=score_matrix(rows, accounts),
        table=_numbers(folder),
        runs=views,
        first=first_run(views),
        colours={name: colour for name, (colour, _) in strategy_looks(map(str, rows["strategy"])).items()},
        panels=charts.speed_specs(rows, replays.egos, many=len(set(rows["scenario"])) > _FEW),
        legend=[(f"{v:g} km/h", *_swatch(v)) for v in sorted(set(rows["v_test_kmh"]))],
        packed_maps=replays.packed_maps,
        palette=PALETTE,
    )


@dataclass(frozen=True, slots=True)
class Shown:
    """A run that a page is to show.

    Args:
        name: by which links on the page open it.
        title: what sets it apart from the others.
        folder: where it is.
        run: its row there.
    """

    name: str
    title: str
    folder: RunFolder
    run: Run


@dataclass(frozen=True, slots=True, eq=False)
class Replays:
    """What a page needs to show runs again.

    Args:
        views: of the runs, in their order.
        egos: rows of kind `ego` of their logs, by the name of the run.
        packed_maps: the maps that they are on.
    """

    views: list[RunView]
    egos: dict[str, pd.DataFrame]
    packed_maps: list[str]


def replays_of(
    runs: Sequence[Shown], progress: Callable[[int, int], None] = lambda done, total: None
) -> Replays:
    """Read the logs of runs, and say what each came to.

    Raises:
        ResultsError: a log is missing or broken.
    """
    views: list[RunView] = []
    egos: dict[str, pd.DataFrame] = {}
    networks: list[RoadNetwork] = []
    ways: list[list[FloatArray]] = []
    origin = np.zeros(2)
    for shown in runs:
        name, log = str(shown.run["log"]), shown.folder.log(str(shown.run["log"]))
        egos[shown.name] = log[log["kind"] == "ego"]
        setup = shown.folder.setup(name)
        frames = frames_of(log, setup.strategy)
        way = frames.ego[["x_m", "y_m"]].to_numpy(np.float64)
        origin = origin if views else np.rint(way[0])
        map_index = -1
        if setup.network is not None:
            if setup.network not in networks:
                networks.append(setup.network)
                ways.append([])
            map_index = networks.index(setup.network)
            ways[map_index].append(way)
        account = explain(frames, shown.run, setup)
        packed = pack_run(frames, account, origin, charts.temporal_spec(frames, shown.run))
        strategy = str(shown.run["strategy"])
        views.append(RunView(shown.name, strategy, shown.title, account, packed, map_index))
        progress(len(views), len(runs))
    packed_maps = [pack_map(network, way, origin) for network, way in zip(networks, ways, strict=True)]
    return Replays(views, egos, packed_maps)


def render(content: PageContent) -> str:
    """The page as text. All that comes from files is escaped."""
    import jinja2

    files = importlib.resources.files("evaluation.views.page")
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined,
        loader=jinja2.FunctionLoader(lambda name: (files / name).read_text(encoding="utf-8")),
    )  # fmt: skip
    template = environment.get_template("template.html.j2")
    return template.render(
        page=content,
        width=WIDTH,
        height=HEIGHT,
        colour_of=lambda title: _colour_of(title, content.colours),
        style=(files / "page.css").read_text(encoding="utf-8"),
        script=(files / "page.js").read_text(encoding="utf-8"),
        plotly=charts.plotly_script() if content.runs else "",
        data=_script_json(
            {
                "palette": content.palette,
                "first": content.first,
                "panels": [spec for _, spec in content.panels],
                "logs": [view.log for view in content.runs],
                "maps": [view.map_index for view in content.runs],
            }
        ),
    )


def _colour_of(title: str, colours: Mapping[str, str]) -> str:
    """Colour of the strategy that a title begins with; empty where it begins with none."""
    return next((colour for name, colour in colours.items() if f"{title}, ".startswith(f"{name}, ")), "")


def _script_json(value: object) -> str:
    """JSON that may stand inside a script element: nothing in it can close the element."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _distinct_columns(rows: pd.DataFrame) -> list[str]:
    """Conditions that set runs apart, besides strategy and speed."""
    names = ("scenario", "preset", "weather", "adversaries", "seed")
    return [name for name in names if len(set(rows[name])) > 1]


def _title(run: dict[Hashable, Any], distinct: list[str]) -> str:
    conditions = [f"seed {run[name]}" if name == "seed" else str(run[name]) for name in distinct]
    speed = f"{run['v_test_kmh']:g} km/h"
    told_already = any(speed in text for text in conditions)
    return ", ".join([str(run["strategy"]), *([] if told_already else [speed]), *conditions])


def _subject(runs: pd.DataFrame) -> str:
    """What was run: a scenario, or how many."""
    names = list(dict.fromkeys(map(str, runs["scenario"])))
    return ", ".join(names) if len(names) <= _FEW else f"{len(names)} scenarios"


def _facts(folder: RunFolder) -> dict[str, str]:
    """What the runs have in common, and what made them."""
    runs = folder.runs
    facts = {
        name.capitalize(): ", ".join(dict.fromkeys(map(str, runs[name])))
        for name in ("scenario", "preset", "weather", "adversaries", "seed")
    }
    facts["Scenario"] = _subject(runs)
    facts["Runs"] = str(len(runs))
    maps = dict.fromkeys(filter(None, (setup.map_name for setup in folder.setups.values())))
    if maps:
        facts["Map"] = ", ".join(maps)
    presets = [setup.preset for setup in folder.setups.values() if setup.preset is not None]
    notes = dict.fromkeys(tuple(lidar_notes(preset)) for preset in presets if preset.lidar is not None)
    for k, (sensing, bound) in enumerate(notes):
        facts[f"Sensor {k + 1}" if len(notes) > 1 else "Sensor"] = f"{sensing}. This is {bound}"
    for name in ("detector", "tracker", "rule"):
        of = PARAMETERS[name].of
        used = {s.preset.name: of(s.preset) for s in folder.setups.values() if s.preset is not None}
        changed = [
            str(value)
            for preset, value in used.items()
            if preset not in PRESETS or value != of(PRESETS[preset])
        ]
        if changed:
            facts[PARAMETERS[name].text.capitalize()] = ", ".join(dict.fromkeys(changed))
    if folder.version:
        facts["Made by"] = f"smartmot {folder.version}"
    return facts


def _numbers(folder: RunFolder) -> Table:
    """Impact speeds; scores as well where there are any, unless the matrix has a line per scenario."""
    if by_scenario(folder.runs) or folder.runs["score"].isna().all():
        return impact_table(folder.runs)
    return comparison_table(folder.runs, PUBLISHED if folder.published else None)


def first_run(views: list[RunView]) -> int:
    """The run to open: the first false activation, else unnecessary braking, else collision, else any."""
    ranks = {kind: rank for rank, kind in enumerate(("false", "unnecessary", "hit", "mitigated"))}
    return min(range(len(views)), key=lambda index: ranks.get(views[index].account.kind, len(ranks)))


def _swatch(speed_kmh: float) -> tuple[str, bool]:
    """Colour of a test speed, and whether its line is dashed."""
    colour, style = speed_style(speed_kmh)
    return colour, style != "-"
