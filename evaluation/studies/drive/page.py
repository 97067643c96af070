"""A folder of drives as one HTML page, with a replay of every drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np

from evaluation.results.files import check_writable, write_whole
from evaluation.results.tables import EMPTY, Table
from evaluation.runs.folder import Run
from evaluation.studies.drive.folder import DriveFolder, Row, read_drive_folder
from evaluation.studies.drive.tables import HINDSIGHT, common_settings
from evaluation.views.account.explain import KINDS
from evaluation.views.page import charts
from evaluation.views.page.page import PAGE_NAME, PALETTE, PageContent, Replays, RunView, render
from evaluation.views.page.payload import pack_map, pack_run
from evaluation.views.page.summary import MARKS, Cell, Matrix, Reason, Verdict, outcome_colour
from evaluation.views.pictures import told_of_writing
from evaluation.views.plots.strategies import strategy_looks
from smartmot.types import FloatArray

NO_RUN: Run = {
    "collided": False, "contact_time_s": np.nan, "t0_s": np.nan, "flag_time_s": np.nan,
}  # fmt: skip
"""What the diagram of a run marks: on a recorded drive nothing is hit and nothing stops."""


def write_drive_page(
    directory: Path, out: Path | None = None, progress: Callable[[int, int], None] = lambda done, total: None
) -> tuple[Path, tuple[str, ...]]:
    """Write the report of a folder of drives; see `evaluation.views.page.page.write_page`."""
    folder = read_drive_folder(directory)
    target = directory / PAGE_NAME if out is None else out
    with told_of_writing("--out", target):
        check_writable(target)
    text = render(drive_content(folder, progress))
    with told_of_writing("--out", target):
        write_whole(target, text.encode())
    return target, folder.notes


def drive_content(
    folder: DriveFolder, progress: Callable[[int, int], None] = lambda done, total: None
) -> PageContent:
    """Read all drives of a folder and say what they came to.

    Raises:
        ResultsError: a log is missing or broken.
    """
    drives = folder.drives
    replays = replays_of_drives(folder, [row["log"] for row in drives], progress)
    views = replays.views
    names = [row["strategy"] for row in drives]
    return PageContent(
        title=f"Recorded drives, {_counted(len({row['sequence'] for row in drives}), 'sequence')}",
        facts=_facts(folder),
        notes=(HINDSIGHT, *folder.notes),
        verdicts=_verdicts(folder, views),
        matrix=_matrix(folder, views),
        table=_table(folder),
        runs=views,
        first=min(range(len(views)), key=lambda k: KINDS.index(views[k].account.kind)),
        colours={name: colour for name, (colour, _) in strategy_looks(names).items()},
        panels=[],
        legend=[],
        packed_maps=replays.packed_maps,
        palette=PALETTE,
        recorded=True,
    )


def replays_of_drives(
    folder: DriveFolder,
    logs: Sequence[str],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Replays:
    """Read the logs of drives, by their names, and say what each came to.

    Raises:
        ResultsError: a log is missing or broken.
    """
    views: list[RunView] = []
    networks = folder.networks
    ways: list[list[FloatArray]] = [[] for _ in networks]
    for log in logs:
        view = folder.view(log)
        way = view.frames.ego[["x_m", "y_m"]].to_numpy(np.float64)
        map_index, origin = -1, np.rint(way[0])
        if view.network is not None:
            map_index = networks.index(view.network)
            ways[map_index].append(way)
            origin = np.rint(ways[map_index][0][0])
        diagram = charts.temporal_spec(view.frames, NO_RUN)
        packed = pack_run(view.frames, view.account, origin, diagram)
        views.append(RunView(log, folder.label(view.row), view.title, view.account, packed, map_index))
        progress(len(views), len(logs))
    driven = [place for place, way in enumerate(ways) if way]
    packed_maps = [pack_map(networks[k], ways[k], np.rint(ways[k][0][0])) for k in driven]
    views = [
        replace(view, map_index=driven.index(k)) if (k := view.map_index) >= 0 else view for view in views
    ]
    return Replays(views, {}, packed_maps)


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _facts(folder: DriveFolder) -> dict[str, str]:
    drives = folder.drives
    facts = {
        "Strategies": ", ".join(dict.fromkeys(row["strategy"] for row in drives)),
        "Rules": ", ".join(dict.fromkeys(row["rule"] for row in drives)),
        "Preset": ", ".join(dict.fromkeys(row["preset"] for row in drives)),
        "Seen": ", ".join(dict.fromkeys(row["sees"] for row in drives)),
    }
    if folder.settings:
        facts["Settings"] = folder.settings
    if names := [network.name for network in folder.networks if network.name]:
        facts["Map"] = ", ".join(names)
    return facts


def _verdicts(folder: DriveFolder, views: Sequence[RunView]) -> list[Verdict]:
    """One per strategy, settings and rule."""
    by_log = {view.log: view for view in views}
    verdicts = []
    for label, group in groupby(folder.rows, folder.label):
        rows = list(group)
        members = [by_log[row["log"]] for row in rows if row["log"]]
        false = [view for view in members if view.account.kind == "false"]
        reasons: tuple[Reason, ...] = ()
        if false:
            first, *others = false
            also = tuple((view.log, view.title) for view in others)
            title = f"False activation ({first.title})"
            reasons = (Reason(first.log, title, first.account.finding, also, 0),)
        worst = min((view.account.kind for view in members), key=KINDS.index)
        verdicts.append(Verdict(label, worst, _headline(rows[-1]), reasons))
    return verdicts


LEAST_HOURS = 0.1
"""Shorter times are said in seconds."""


def _duration(hours: float) -> str:
    return f"{hours:.2f} h" if hours >= LEAST_HOURS else f"{3600.0 * hours:.0f} s"


def _headline(row: Row) -> str:
    """Counts and exposure of all drives of a strategy and rule."""
    met = f", {_counted(int(row['pedestrians']), 'pedestrian')} met" if row["pedestrians"] else ""
    exposure = f"on {float(row['km']):.2f} km ({_duration(float(row['hours']))}){met}"
    if row["requests"] == "0":
        most = row["at_most_per_km"]
        bound = f"; fewer than {float(most):.2g} per km (95 %)" if most else ""
        return f"No request {exposure}{bound}."
    return (
        f"{row['false_activations']} of {row['requests']} requests false activations, "
        f"{row['undecided']} undecided, {exposure}."
    )


def _matrix(folder: DriveFolder, views: Sequence[RunView]) -> Matrix:
    """Sequences by strategy, settings and rule."""
    drives = folder.drives
    columns = list(dict.fromkeys(map(folder.label, drives)))
    by_place = {(row["sequence"], folder.label(row)): view for row, view in zip(drives, views, strict=True)}
    lines = []
    for sequence in dict.fromkeys(row["sequence"] for row in drives):
        cells: list[Cell | None] = []
        for column in columns:
            view = by_place.get((sequence, column))
            cells.append(None if view is None else _cell(view))
        lines.append((sequence, cells))
    return Matrix("Sequence", columns, lines)


def _cell(view: RunView) -> Cell:
    kind = view.account.kind
    return Cell(view.log, "", view.account.outcome, MARKS[kind], outcome_colour(kind))


def _table(folder: DriveFolder) -> Table:
    """Counts beside exposure, a line per row of `drives.csv`."""
    own = common_settings(row["settings"] for row in folder.rows)[1]
    header = (
        "sequence", "strategy", "settings", "rule", "km", "h", "pedestrians met", "requests",
        "false activations", "undecided", "at most per km", "warnings", "false warnings",
    )  # fmt: skip
    lines = tuple(
        (
            row["sequence"], row["strategy"], own[row["settings"]], row["rule"], f"{float(row['km']):.3f}",
            f"{float(row['hours']):.4f}", row["pedestrians"] or EMPTY, row["requests"],
            row["false_activations"], row["undecided"],
            f"{float(row['at_most_per_km']):.3g}" if row["at_most_per_km"] else EMPTY,
            row["warnings"], row["false_warnings"],
        )
        for row in folder.rows
    )  # fmt: skip
    if any(own.values()):
        return Table(header, lines)
    k = header.index("settings")
    return Table(header[:k] + header[k + 1 :], tuple(line[:k] + line[k + 1 :] for line in lines))
