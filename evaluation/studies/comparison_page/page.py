"""The page of a comparison, with the replays of its runs that were logged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from evaluation.results.files import (
    RUNS_JSON,
    STUDY_JSON,
    ResultsError,
    check_writable,
    one_line,
    write_whole,
)
from evaluation.results.tables import Table
from evaluation.runs.configuration import read_configuration
from evaluation.runs.folder import Run, RunFolder, read_folder
from evaluation.studies.comparison_page import sides as read
from evaluation.studies.comparison_page.sides import Axis, Ended, Side
from evaluation.studies.comparison_page.words import Words, read_words
from evaluation.studies.diff.results import COMPARE_JSON
from evaluation.studies.drive.folder import is_drive_folder, read_drive_folder
from evaluation.studies.drive.page import replays_of_drives
from evaluation.studies.logged import GOOD, LOGGED, most_telling
from evaluation.views.page.comparison import Chart, Comparison, Picture, PointView, RunLine, chart, picture
from evaluation.views.page.page import (
    PAGE_NAME,
    PALETTE,
    PageContent,
    Replays,
    Shown,
    first_run,
    render,
    replays_of,
)
from evaluation.views.page.summary import Matrix
from evaluation.views.pictures import told_of_writing
from evaluation.views.plots.strategies import strategy_looks
from scenarios.reading import ReadError, read_json
from scenarios.settings import setting_text

MOST_LINES = 60
"""Scenes that a point names."""
_FIGURES = ("frontier*", "ablation*")

Kept = TypeVar("Kept")
Logs = Mapping[Hashable, Shown]
"""Logged runs, by what sides know them by."""
WITHOUT_LOGS = "Without logs there are no replays behind the points; {} --logs keeps them."


def is_comparison_folder(directory: Path) -> bool:
    """Whether `compare` or a question of `study` wrote a folder."""
    return any((directory / name).is_file() for name in (COMPARE_JSON, STUDY_JSON))


def write_comparison_page(
    directory: Path,
    out: Path | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
    allow_plugins: bool = False,
) -> tuple[Path, tuple[str, ...]]:
    """Write the report of a comparison; see `evaluation.views.page.page.write_page`."""
    target = directory / PAGE_NAME if out is None else out
    with told_of_writing("--out", target):
        check_writable(target)
    content = comparison_content(directory, progress, allow_plugins)
    with told_of_writing("--out", target):
        write_whole(target, render(content).encode())
    return target, content.notes


def comparison_content(
    directory: Path,
    progress: Callable[[int, int], None] = lambda done, total: None,
    allow_plugins: bool = False,
) -> PageContent:
    """Read what a comparison came to, and the logs of its runs where there are any.

    Raises:
        ResultsError: a file is missing or damaged.
    """
    is_study = (directory / STUDY_JSON).is_file()
    configuration = _configuration(directory / (STUDY_JSON if is_study else COMPARE_JSON))
    on_drives = not is_study and "scenes" not in configuration
    logs: Logs = {}
    notes: list[str] = []
    folders = sorted(path.parent for path in directory.glob(f"{LOGGED}*/{RUNS_JSON}"))
    if is_study:
        words, sides = read_words(directory / "answer.md", "Results"), read.sides_of_study(directory)
        axes = [(read.STUDY_STOPS, read.AVOIDED)]
        logs, missing = logs_of_study(folders, allow_plugins)
        # a question without points (curves, severities) keeps no logs
        notes += missing or ([] if folders or not sides else [WITHOUT_LOGS.format("study")])
    elif on_drives:
        words, sides = (
            read_words(directory / "table.md", "Requests and exposure"),
            read.sides_of_drives(directory),
        )
        axes = [(read.FALSE_PER_KM, read.REQUESTS)]
        if not is_drive_folder(directory / LOGGED):
            notes.append(WITHOUT_LOGS.format("compare --drives"))
    else:
        words, sides = read_words(directory / "table.md", "Summary"), read.sides_of_scenes(directory)
        axes = [(read.FALSE, read.AVOIDED), (read.STOPS, read.AVOIDED)]
        logs, missing = logs_of_scenes(folders, configuration, allow_plugins)
        notes += missing or ([] if folders else [WITHOUT_LOGS.format("compare")])
    if on_drives and is_drive_folder(directory / LOGGED):
        drives = read_drive_folder(directory / LOGGED)
        notes += drives.notes
        by_key: dict[Hashable, str] = {
            tuple(row[name] for name in read.OF_DRIVE): row["log"] for row in drives.drives
        }
        chosen, left_out = _chosen(sides, by_key)
        replays = replays_of_drives(drives, list(chosen.values()), progress)
        names = dict(chosen)
    else:
        chosen_runs, left_out = _chosen(sides, logs)
        replays = replays_of(_titled(sides, chosen_runs), progress) if chosen_runs else Replays([], {}, [])
        names = {place: shown.name for place, shown in chosen_runs.items()}
    notes += left_out
    colours = {name: look[0] for name, look in strategy_looks(side.strategy for side in sides).items()}
    points = [_point(k + 1, side, names, colours, [*axes[0], *axes[-1]]) for k, side in enumerate(sides)]
    pictures = _pictures(directory, words)
    return PageContent(
        title=words.title or _title(configuration, on_drives),
        facts=_facts(configuration, sides),
        notes=tuple(notes),
        verdicts=[],
        matrix=Matrix("", [], []),
        table=Table((), ()),
        runs=replays.views,
        first=first_run(replays.views) if replays.views else 0,
        colours=colours,
        panels=[],
        legend=[],
        packed_maps=replays.packed_maps,
        palette=PALETTE,
        recorded=on_drives,
        comparison=Comparison(
            tuple(words.sentences), _charts(sides, points, axes), tuple(points), tuple(words.tables),
            tuple(pictures), tuple(words.notes),
        ),
    )  # fmt: skip


def _configuration(path: Path) -> Mapping[str, object]:
    try:
        content = read_json(path)
    except ReadError as error:
        raise ResultsError(f"{path}: not understood ({one_line(error)}); run the comparison again") from None
    if not isinstance(content, Mapping):
        raise ResultsError(f"{path}: not understood; run the comparison again")
    return content


def _title(configuration: Mapping[str, object], on_drives: bool) -> str:
    if on_drives:
        return "Comparison on recorded drives"
    scenes, preset = configuration["scenes"], configuration.get("preset", "")
    count = len(scenes) if isinstance(scenes, list) else 0
    return f"Comparison over {count} scene variants, preset {preset}"


def _facts(configuration: Mapping[str, object], sides: Sequence[Side]) -> dict[str, str]:
    facts: dict[str, str] = {}
    if sides:
        facts |= {"Sides": str(len(sides)), "Runs": str(sum(len(side.runs) for side in sides))}
    if seeds := configuration.get("seeds"):
        facts["Seeds"] = str(seeds)
    if version := configuration.get("version"):
        facts["Made by"] = f"smartmot {version}"
    return facts


def _charts(
    sides: Sequence[Side], points: Sequence[PointView], axes: Sequence[tuple[Axis, Axis]]
) -> tuple[Chart, ...]:
    """One per group and pair of measures that has a point."""
    charts = []
    for group in dict.fromkeys(side.group for side in sides):
        own = [(side, point) for side, point in zip(sides, points, strict=True) if side.group == group]
        for x, y in axes:
            places = [(point, side.values[x.name], side.values[y.name]) for side, point in own]
            title = ": ".join(filter(None, (group, x.text)))
            made = chart(title, x.text, y.text, places, is_share=x.scale == y.scale == read.PERCENT)
            if made.marks:
                charts.append(made)
    return tuple(charts)


def _pictures(directory: Path, words: Words) -> list[Picture]:
    """Figures of the folder: those that its text shows, or all of a comparison; vectors where they are."""
    stems = {Path(name).stem for name in words.figures if Path(name).name == name}
    stems |= {path.stem for pattern in _FIGURES for path in directory.glob(f"{pattern}.[ps][nv]g")}
    pictures = []
    for stem in sorted(stems):
        files = (directory / f"{stem}.svg", directory / f"{stem}.png")
        path = next((file for file in files if file.is_file()), None)
        if path is not None:
            pictures.append(picture(stem.replace("_", " "), path.name, path.read_bytes()))
    return pictures


# ---- runs --------------------------------------------------------------------------------------------------


def logs_of_scenes(
    folders: Sequence[Path], configuration: Mapping[str, object], allow_plugins: bool
) -> tuple[dict[Hashable, Shown], list[str]]:
    """The logged runs of a comparison over scenes, and what the reader has to know of them.

    They are known by weather, strategy, settings and scene.

    Raises:
        ResultsError: a folder of them is damaged.
    """
    common = configuration.get("common", {})
    of_all = _texts(common) if isinstance(common, Mapping) else frozenset()
    logs: dict[Hashable, Shown] = {}
    notes: list[str] = []
    for path in folders:
        folder: RunFolder = read_folder(path, allow_plugins)
        notes += folder.notes
        settings = {
            stored.spec.log: _texts(dict(stored.spec.settings)) for stored in read_configuration(path).runs
        }
        for name, run in _rows(folder):
            scene = str(run["scenario"])
            own = settings.get(str(run["log"]), frozenset()) - of_all
            logs[str(run["weather"]), str(run["strategy"]), own, scene] = Shown(name, scene, folder, run)
    return logs, list(dict.fromkeys(notes))


def logs_of_study(folders: Sequence[Path], allow_plugins: bool) -> tuple[dict[Hashable, Shown], list[str]]:
    """The logged runs of a question, by the number of the side and the scenario; see `logs_of_scenes`."""
    logs: dict[Hashable, Shown] = {}
    notes: list[str] = []
    for path in folders:
        folder = read_folder(path, allow_plugins)
        notes += folder.notes
        number = int(path.name.split("_")[1])
        for name, run in _rows(folder):
            scene = str(run["scenario"])
            logs[number, scene] = Shown(name, scene, folder, run)
    return logs, list(dict.fromkeys(notes))


def _rows(folder: RunFolder) -> Iterator[tuple[str, Run]]:
    """Logged runs of a folder, with names that tell those of several folders apart."""
    for run in folder.runs[folder.runs["log"].notna()].to_dict("records"):
        log = str(run["log"])
        yield log if folder.path.name == LOGGED else f"{folder.path.name}/{log}", run


def _texts(settings: Mapping[str, object]) -> frozenset[str]:
    """Settings as `name=value`."""
    return frozenset(setting_text(name, value) for name, value in settings.items())  # type: ignore[arg-type]


def _chosen(
    sides: Sequence[Side], logs: Mapping[Hashable, Kept]
) -> tuple[dict[tuple[int, str], Kept], list[str]]:
    """Replays that the page holds, by number of the side and title of the scene; and what is left out."""
    outcomes: list[dict[str, tuple[str, ...]]] = []
    kept: dict[tuple[int, str], Kept] = {}
    for k, side in enumerate(sides):
        by_title = _by_title(side.runs)
        for run in side.runs:
            if run.logged in logs:
                kept[k, run.title] = logs[run.logged]
        outcomes.append({title: tuple(by_title[title]) for title in by_title if (k, title) in kept})
    chosen = {place: kept[place] for place in most_telling(outcomes)}
    notes = []
    if len(chosen) < len(kept):
        notes.append(
            f"Replays of {len(chosen)} of {len(kept)} logged runs are in this page, of each point those that "
            "went wrong first; smartmot-eval report makes a page of each folder of runs."
        )
    return chosen, notes


def _titled(sides: Sequence[Side], chosen: Mapping[tuple[int, str], Shown]) -> list[Shown]:
    """Replays with titles that say whose they are."""
    return [
        replace(shown, title=", ".join(filter(None, (sides[k].name, title, sides[k].group))))
        for (k, title), shown in chosen.items()
    ]


def _by_title(runs: Sequence[Ended]) -> dict[str, Counter[str]]:
    """How often each outcome came in each scene."""
    scenes: dict[str, Counter[str]] = {}
    for run in runs:
        scenes.setdefault(run.title, Counter())[run.outcome] += 1
    return scenes


def _point(
    number: int,
    side: Side,
    names: Mapping[tuple[int, str], str],
    colours: Mapping[str, str],
    axes: Sequence[Axis],
) -> PointView:
    """A side as the page shows it: the scenes in which it went wrong first.

    Args:
        number: of the point.
        side: what it shows.
        names: of the replays, by number of the side and title of the scene.
        colours: by strategy.
        axes: measures that are said in words.
    """
    lines = []
    for title, outcomes in _by_title(side.runs).items():
        total = sum(outcomes.values())
        parts = [name if count == total else f"{name} {count} of {total}" for name, count in outcomes.items()]
        is_good = outcomes.keys() <= set(GOOD)
        name = names.get((number - 1, title), "")
        lines.append(RunLine(title, ", ".join(parts), "good" if is_good else "bad", name))
    lines.sort(key=lambda line: (line.kind != "bad", not line.log))
    more = lines[MOST_LINES:]
    bad = sum(line.kind == "bad" for line in more)
    left_out = f"{len(more)} more scenes, {bad} of them ended badly; runs.csv has all" if more else ""
    numbers = []
    for axis in dict.fromkeys(axes):
        value = side.values[axis.name]
        if value.value == value.value:
            interval = f" [{value.low:.3g}, {value.high:.3g}]" if value.low == value.low else ""
            numbers.append(
                f"{axis.text.removesuffix(' (%)')} {value.value:.3g}{interval}"
                + (" %" if axis.scale == read.PERCENT else "")
            )
    name = ", ".join(filter(None, (side.name, side.group)))
    colour = colours.get(side.strategy, "")
    return PointView(number, name, colour, tuple(numbers), tuple(lines[:MOST_LINES]), left_out)
