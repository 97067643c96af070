"""The command `replay`: finds a run by its name and makes its film."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from evaluation.results.files import check_writable
from evaluation.runs.folder import read_folder, read_shown_log
from evaluation.runs.recordings import is_log_alone, split_run
from evaluation.views.account.explain import explain
from evaluation.views.film.maker import write
from evaluation.views.film.run import RunDrawing, film_of, film_times
from evaluation.views.frames import frames_of
from evaluation.views.pictures import told_of_writing
from evaluation.views.plots.strategies import strategy_colour


def replay(
    run: Path,
    gif: Path | None,
    mp4: Path | None,
    fps: float = 20.0,
    speed: float = 1.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
    allow_plugins: bool = False,
) -> tuple[list[Path], tuple[str, ...]]:
    """Write a run as a film; without a file name a GIF in the folder of results.

    Args:
        run: `DIR/NAME` with a name from column `log` of `runs.csv`, or the path of the log; a log without a
            folder of results is drawn without map and areas.
        gif: animated GIF to write.
        mp4: H.264 film to write.
        fps: pictures per second.
        speed: 1 for real time, 0.5 for half of it.
        progress: called with the pictures drawn so far and their number.
        allow_plugins: whether code of the user's own may make monitored areas again.

    Returns:
        Files written, and what the reader has to know about what is missing.

    Raises:
        ResultsError: the folder or the log cannot be read.
        ArgumentError: the folder has no such run, or a file cannot be written.
    """
    directory, name = split_run(run)
    drawing, notes = drawing_of(run, allow_plugins)
    # without a file name a GIF in the folder of results
    files = asked_files(gif, mp4) or [(directory / f"{name}.gif", "--gif")]
    return write_films(drawing, files, fps, speed, progress), notes


def drawing_of(run: Path, allow_plugins: bool = False) -> tuple[RunDrawing, tuple[str, ...]]:
    """What draws a run, and what is missing; see `replay`."""
    if is_log_alone(run):
        return _log_alone(run)
    return _run_of_folder(*split_run(run), allow_plugins)


def asked_files(gif: Path | None, mp4: Path | None) -> list[tuple[Path, str]]:
    """The films that are asked for, each with its option."""
    return [(path, option) for path, option in ((gif, "--gif"), (mp4, "--mp4")) if path is not None]


def write_films(
    drawing: RunDrawing,
    files: Sequence[tuple[Path, str]],
    fps: float,
    speed: float,
    progress: Callable[[int, int], None],
) -> list[Path]:
    """Write a run as films; see `replay`."""
    times = film_times(drawing.frames, fps, speed)
    for path, option in files:
        with told_of_writing(option, path):
            check_writable(path)
    film = film_of(drawing, times)
    done, total = 0, len(files) * len(times.frame)

    def drawn() -> None:
        nonlocal done
        done += 1
        progress(done, total)

    for path, option in files:
        with told_of_writing(option, path):
            write(path, film, option, drawn)
    return [path for path, _ in files]


def _log_alone(path: Path) -> tuple[RunDrawing, tuple[str, ...]]:
    """A log without a folder of results, as of a recorded drive, and what is missing: scenario, map, table.

    Raises:
        ResultsError: the log cannot be read.
    """
    frames = frames_of(read_shown_log(path))
    notes = ("Only the log is known: lanes and monitored areas are not drawn.",)
    return RunDrawing(frames, explain(frames), None, path.stem), notes


def _run_of_folder(directory: Path, name: str, allow_plugins: bool) -> tuple[RunDrawing, tuple[str, ...]]:
    """A run of a folder of results by the name of its log, and what is missing.

    Raises:
        ResultsError: the folder or the log cannot be read.
        ArgumentError: the folder has no such run.
    """
    folder = read_folder(directory, allow_plugins)
    row = folder.row(name)
    setup = folder.setup(name)
    frames = frames_of(folder.log(name), setup.strategy)
    test = f"{row['v_test_kmh']:g} km/h"
    tested = [str(row["scenario"]), *([] if test in str(row["scenario"]) else [test])]
    strategy = str(row["strategy"])
    title = ", ".join([strategy, *tested, str(row["weather"])])
    colour = strategy_colour(strategy, map(str, folder.runs["strategy"]))
    account = explain(frames, row, setup)
    return RunDrawing(frames, account, setup.network, title, colour), folder.notes
