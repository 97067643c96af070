"""The standard pictures of a folder of results."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evaluation.errors import ArgumentError
from evaluation.results.files import write_whole
from evaluation.views.plots.style import MPS_TO_KMH
from opendrive import RoadNetwork
from smartmot.area import MonitoredAreaStrategy
from smartmot.types import EgoState

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

DPI = 200

STAMPS: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""Formats, and the metadata in them that would differ from one run to the next."""


def save_pictures(
    directory: Path,
    runs: pd.DataFrame,
    logs: Mapping[str, pd.DataFrame],
    network: RoadNetwork | None,
    strategy: MonitoredAreaStrategy | None,
    *,
    shown: str | None = None,
    suffix: str = "png",
    done: Callable[[], None] = lambda: None,
) -> list[Path]:
    """Draw speed curves of all runs, and temporal diagram and bird's-eye view of one.

    Args:
        directory: where to write.
        runs: table of runs.
        logs: logs by name.
        network: map of the run to show; None: there is no bird's-eye view.
        strategy: what makes its monitored area; None: none is drawn.
        shown: log of the run to show; None: see `run_to_show`.
        suffix: png, svg or pdf.
        done: called after each picture.

    Returns:
        Files written.
    """
    from evaluation.views.plots import birdseye, speed_curves, temporal_diagram

    name = shown or run_to_show(runs)
    if name not in set(runs["log"]):
        raise ArgumentError(f"--run: no run {name!r}; the folder has: {', '.join(runs['log'])}")
    row, log = runs[runs["log"] == name].iloc[0], logs[name]
    written: list[Path] = []

    def save(figure: Figure, name: str) -> None:
        path = directory / f"{name}.{suffix}"
        save_picture(figure, path, "the folder of results")
        written.append(path)
        done()

    speed = f"{row['v_test_kmh']:g} km/h"
    title = f"{row['scenario']}, {row['strategy']}, {speed}, {row['weather']}, preset {row['preset']}"
    save(speed_curves(runs, logs), "speed_curves")
    save(temporal_diagram(log, title), "temporal_diagram")
    time = float(log["time_s"].max() if math.isnan(row["flag_time_s"]) else row["flag_time_s"])
    if network is not None:
        areas = [] if strategy is None else strategy.at(_ego_at(log, time)).polygons()
        save(birdseye(network, log, time, areas, f"{title}; t = {time:.2f} s"), "birdseye")
    return written


def save_map(
    network: RoadNetwork,
    path: Path,
    strategy: MonitoredAreaStrategy | None = None,
    ego: EgoState | None = None,
) -> None:
    """Draw a map, and the monitored area around an ego vehicle.

    Args:
        network: the map.
        path: picture to write.
        strategy: what makes the area; None: none is drawn.
        ego: where the area is.

    Raises:
        ArgumentError: the file cannot be written, or its ending is not that of a picture.
    """
    from evaluation.views.plots import map_picture

    if strategy is None or ego is None:
        figure = map_picture(network, title=network.name or None, ids=True)
    else:
        title = f"{network.name or 'map'}: {strategy.name} area at {ego.speed_mps * MPS_TO_KMH:g} km/h"
        pose = (ego.x_m, ego.y_m, ego.yaw_rad)
        figure = map_picture(network, strategy.at(ego).polygons(), pose, title, ids=True)
    save_picture(figure, path, "--png")


def save_picture(figure: Figure, path: Path, where: str) -> None:
    """Write a picture without time stamps and random names, so that equal runs give equal bytes."""
    ending = path.suffix.lower().removeprefix(".")
    if ending not in STAMPS:
        raise ArgumentError(f"{where}: cannot draw {path.name!r}; the ending must be .png, .svg or .pdf")
    with told_of_writing(where, path):
        write_whole(path, drawn(figure, ending, dpi=DPI))


@contextlib.contextmanager
def told_of_writing(where: str, path: Path) -> Iterator[None]:
    """Says of a file that cannot be written which it is and what asked for it.

    Args:
        where: option or what else names the place.
        path: the file.

    Raises:
        ArgumentError: in place of an OSError.
    """
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise ArgumentError(f"{where}: cannot write {path}: {reason}; choose another place") from None


def drawn(figure: Figure, form: str, **options: Any) -> bytes:
    """A picture as the content of a file, the same for equal figures.

    Args:
        figure: what to draw.
        form: png, svg or pdf.
        options: further ones of `Figure.savefig`.
    """
    import matplotlib as mpl

    content = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "smartmot"}):
        figure.savefig(content, format=form, metadata=STAMPS[form], **options)
    return content.getvalue()


def run_to_show(runs: pd.DataFrame) -> str:
    """Log of the run that pictures show: of the last strategy the one at 50 km/h, or else the fastest.

    50 km/h is the usual speed in town. A run in which the brake was requested goes before one without.
    """
    last = runs[runs["strategy"] == runs["strategy"].iloc[-1]]
    flagged = last[last["flag_time_s"].notna()]
    town = flagged[flagged["v_test_kmh"] == 50]
    chosen = town if len(town) else flagged if len(flagged) else last
    return str(chosen["log"].iloc[-1])


def _ego_at(log: pd.DataFrame, time_s: float) -> EgoState:
    ego = log[log["kind"] == "ego"]
    row = ego.iloc[(ego["time_s"] - time_s).abs().argmin()]
    time, x, y, yaw, speed, length, width = (
        float(row[name]) for name in ("time_s", "x_m", "y_m", "yaw_rad", "speed_mps", "length_m", "width_m")
    )
    return EgoState(time, x, y, yaw, speed, length_m=length, width_m=width)
