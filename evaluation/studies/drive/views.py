"""Films and pictures of drives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from evaluation.results.files import ResultsError, log_path
from evaluation.runs.folder import read_shown_log
from evaluation.studies.drive.folder import DriveFolder, read_drive_folder
from evaluation.views.film.replay import write_films
from evaluation.views.film.run import RunDrawing
from evaluation.views.pictures import save_picture
from evaluation.views.plots.strategies import strategy_colour
from evaluation.views.traces.folders import MCAP_FOLDER
from evaluation.views.traces.mcap import SUFFIX, write_mcap


def replay_drive(
    directory: Path,
    log: str,
    files: Sequence[tuple[Path, str]],
    fps: float = 20.0,
    speed: float = 1.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[list[Path], tuple[str, ...]]:
    """Write a drive as a film; see `evaluation.views.film.replay.replay`.

    Args:
        directory: folder of drives.
        log: name of the log.
        files: each with the option that asks for it; empty: a GIF in the folder.
        fps: pictures per second.
        speed: 1 for real time.
        progress: called with the pictures drawn so far and their number.
    """
    folder = read_drive_folder(directory)
    view = folder.view(log)
    colour = strategy_colour(view.row["strategy"], (row["strategy"] for row in folder.drives))
    drawing = RunDrawing(view.frames, view.account, view.network, view.title, colour)
    written = write_films(drawing, files or [(directory / f"{log}.gif", "--gif")], fps, speed, progress)
    return written, folder.notes


def write_drive_mcaps(
    directory: Path, progress: Callable[[int, int], None] = lambda done, total: None
) -> tuple[str, ...]:
    """Write every drive of a folder as `mcap/NAME.mcap`; see `evaluation.views.traces.folders`."""
    folder = read_drive_folder(directory)
    notes = dict.fromkeys(folder.notes)
    for done, row in enumerate(folder.drives, 1):
        path = directory / MCAP_FOLDER / f"{row['log']}{SUFFIX}"
        notes |= dict.fromkeys(write_mcap(path, folder.logged_run(row["log"])))
        progress(done, len(folder.drives))
    return tuple(notes)


def draw_drive(directory: Path, shown: str | None, form: str) -> tuple[list[Path], list[str]]:
    """Draw temporal diagram and, with a map, bird's-eye view of a drive; see `suite.draw_again`."""
    from evaluation.views.plots import birdseye, temporal_diagram

    folder = read_drive_folder(directory)
    view = folder.view(shown or drive_to_show(folder))
    log = read_shown_log(log_path(directory, view.row["log"]))
    written = [directory / f"temporal_diagram.{form}"]
    save_picture(temporal_diagram(log, view.title), written[0], "the folder of results")
    if view.network is not None:
        time_s = float(view.frames.time_s[view.account.frame])
        areas = view.frames.areas(view.account.frame)
        figure = birdseye(view.network, log, time_s, areas, f"{view.title}; t = {time_s:.2f} s")
        written.append(directory / f"birdseye.{form}")
        save_picture(figure, written[-1], "the folder of results")
    return written, list(folder.notes)


def drive_to_show(folder: DriveFolder) -> str:
    """Log of the drive with most false activations, of several the first."""
    if not folder.drives:
        raise ResultsError(f"{folder.path}: no drives")
    return max(folder.drives, key=lambda row: int(row["false_activations"]))["log"]
