"""The page of a comparison, with the replays of its runs that were logged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from evaluation.results.files import RUNS_JSON, ResultsError, check_writable, one_line, write_whole
from evaluation.results.tables import Table
from evaluation.runs.configuration import read_configuration
from evaluation.runs.folder import RunFolder, read_folder
from evaluation.studies.compare.command import LOGGED
from evaluation.studies.comparison_page import sides as read
from evaluation.studies.comparison_page.sides import GOOD, Axis, Ended, Side
from evaluation.studies.comparison_page.words import Words, read_words
from evaluation.studies.diff.results import COMPARE_JSON
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

STUDY_JSON = "study.json"
MOST_REPLAYS = 300
"""In a page, which then has about 10 MB; those of runs that went wrong come first."""
MOST_LINES = 60
"""Scenes that a point names."""
_FIGURES = ("frontier*", "ablation*")

Settings = frozenset[str]
"""As `name=value`."""
Key = tuple[str, str, Settings, str]
"""Weather, strategy, settings and scene of a logged run."""


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
    logs: dict[Key, Shown] = {}
    notes: list[str] = []
    if is_study:
        words, sides = read_words(directory / "answer.md", "Results"), read.sides_of_study(directory)
        axes = [(read.STUDY_STOPS, read.AVOIDED)]
        notes.append("A study keeps no logs: there are no replays behind its points.")
    elif on_drives:
        words, sides = (
            read_words(directory / "table.md", "Requests and exposure"),
            read.sides_of_drives(directory),
        )
        axes = [(read.FALSE_PER_KM, read.REQUESTS)]
        notes.append(
            "A comparison on drives keeps no logs; smartmot-eval drive makes them, and its page has replays."
        )
    else:
        words, sides = read_words(directory / "table.md", "Summary"), read.sides_of_scenes(directory)
        axes = [(read.FALSE, read.AVOIDED), (read.STOPS, read.AVOIDED)]
        logs, missing = _logged(directory, configuration, allow_plugins)
        notes += missing
    chosen, left_out = _chosen(sides, logs)
    notes += left_out
    replays = replays_of(list(chosen.values()), progress) if chosen else Replays([], {}, [])
    colours = {name: look[0] for name, look in strategy_looks(side.strategy for side in sides).items()}
    points = [_point(k + 1, side, chosen, colours, [*axes[0], *axes[-1]]) for k, side in enumerate(sides)]
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
    facts = {"Sides": str(len(sides)), "Runs": str(sum(len(side.runs) for side in sides))}
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


def _logged(
    directory: Path, configuration: Mapping[str, object], allow_plugins: bool
) -> tuple[dict[Key, Shown], list[str]]:
    """The logged runs of a comparison over scenes, and what the reader has to know of them.

    Raises:
        ResultsError: a folder of them is damaged.
    """
    folders = sorted(path.parent for path in directory.glob(f"{LOGGED}*/{RUNS_JSON}"))
    if not folders:
        return {}, ["Without logs there are no replays behind the points; compare --logs keeps them."]
    common = configuration.get("common", {})
    of_all = _texts(common) if isinstance(common, Mapping) else frozenset()
    logs: dict[Key, Shown] = {}
    notes: list[str] = []
    for path in folders:
        folder: RunFolder = read_folder(path, allow_plugins)
        notes += folder.notes
        settings = {
            stored.spec.log: _texts(dict(stored.spec.settings)) for stored in read_configuration(path).runs
        }
        for run in folder.runs[folder.runs["log"].notna()].to_dict("records"):
            log, scene = str(run["log"]), str(run["scenario"])
            own = settings.get(log, frozenset()) - of_all
            name = log if path.name == LOGGED else f"{path.name}/{log}"
            logs[str(run["weather"]), str(run["strategy"]), own, scene] = Shown(name, scene, folder, run)
    return logs, list(dict.fromkeys(notes))


def _texts(settings: Mapping[str, object]) -> Settings:
    return frozenset(setting_text(name, value) for name, value in settings.items())  # type: ignore[arg-type]


def _chosen(
    sides: Sequence[Side], logs: Mapping[Key, Shown]
) -> tuple[dict[tuple[int, str], Shown], list[str]]:
    """Replays that the page holds, by side and scene; and which are left out."""
    by_scene: dict[str, set[str]] = {}
    for side in sides:
        for run in side.runs:
            by_scene.setdefault(run.title, set()).add(run.outcome)
    ranked: list[tuple[int, tuple[int, str], Shown]] = []
    several = {side.group for side in sides if side.group}
    for k, side in enumerate(sides):
        own = frozenset(filter(None, side.settings.split(", ")))
        weathers = {key[0] for key in logs}
        weather = side.group if several else next(iter(weathers), "")
        for title, outcomes in _by_title(side.runs).items():
            shown = logs.get((weather, side.strategy, own, title))
            if shown is not None:
                rank = 0 if not outcomes.keys() <= set(GOOD) else 1 if len(by_scene[title]) > 1 else 2
                shown = replace(shown, title=", ".join(filter(None, (side.name, title, side.group))))
                ranked.append((rank, (k, title), shown))
    ranked.sort(key=lambda entry: entry[0])
    kept = sorted(ranked[:MOST_REPLAYS], key=lambda entry: entry[1][0])
    notes = []
    if len(ranked) > len(kept):
        notes.append(
            f"Replays of {len(kept)} of {len(ranked)} logged runs are in this page, those that went wrong "
            "first; smartmot-eval report makes a page of each folder of runs."
        )
    return {key: shown for _, key, shown in kept}, notes


def _by_title(runs: Sequence[Ended]) -> dict[str, Counter[str]]:
    """How often each outcome came in each scene."""
    scenes: dict[str, Counter[str]] = {}
    for run in runs:
        scenes.setdefault(run.title, Counter())[run.outcome] += 1
    return scenes


def _point(
    number: int,
    side: Side,
    chosen: Mapping[tuple[int, str], Shown],
    colours: Mapping[str, str],
    axes: Sequence[Axis],
) -> PointView:
    """A side as the page shows it: the scenes in which it went wrong first."""
    lines = []
    for title, outcomes in _by_title(side.runs).items():
        total = sum(outcomes.values())
        parts = [name if count == total else f"{name} {count} of {total}" for name, count in outcomes.items()]
        is_good = outcomes.keys() <= set(GOOD)
        shown = chosen.get((number - 1, title))
        lines.append(
            RunLine(
                title, ", ".join(parts), "good" if is_good else "bad", "" if shown is None else shown.name
            )
        )
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
