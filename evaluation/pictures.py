"""The standard pictures of a folder of results."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evaluation.errors import ArgumentError
from opendrive import RoadNetwork
from scenarios.cpna import Site, make_strategy
from scenarios.presets import named_preset, named_weather, preset_in_weather
from smartmot.types import EgoState

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

DPI = 200

_STAMPS: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
"""Formats, and the metadata in them that would differ from one run to the next."""


def save_pictures(
    directory: Path,
    runs: pd.DataFrame,
    logs: Mapping[str, pd.DataFrame],
    site: Site,
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
        site: place of the runs, for map and monitored area.
        shown: log of the run to show; None: the fastest one of the last strategy that was flagged.
        suffix: png, svg or pdf.
        done: called after each picture.

    Returns:
        Files written.
    """
    from evaluation.plots import birdseye, speed_curves, temporal_diagram

    row = _row_to_show(runs, shown)
    log = logs[str(row["log"])]
    written: list[Path] = []

    def save(figure: Figure, name: str) -> None:
        path = directory / f"{name}.{suffix}"
        _write(figure, path, "the folder of results")
        written.append(path)
        done()

    speed = f"{row['v_test_kmh']:g} km/h"
    title = f"{row['scenario']}, {row['strategy']}, {speed}, {row['weather']}, preset {row['preset']}"
    save(speed_curves(runs, logs), "speed_curves")
    save(temporal_diagram(log, title), "temporal_diagram")
    time = (
        float(row["flag_time_s"]) if row["flag_time_s"] == row["flag_time_s"] else float(log["time_s"].max())
    )
    preset = preset_in_weather(named_preset(str(row["preset"])), named_weather(str(row["weather"])))
    ego = _ego_at(log, time)
    areas = make_strategy(str(row["strategy"]), preset, site).at(ego).polygons()
    save(birdseye(site.network, log, time, areas, f"{title}; t = {time:.2f} s"), "birdseye")
    return written


def save_map(
    network: RoadNetwork, path: Path, site: Site | None, strategy: str, speed_kmh: float, preset_name: str
) -> None:
    """Draw a map, and at a place the monitored area there.

    Raises:
        ArgumentError: the file cannot be written, or its ending is not that of a picture.
    """
    from evaluation.plots import map_picture

    if site is None:
        figure = map_picture(network, title=network.name or None)
    else:
        x, y, yaw = site.route.pose(site.line_m)
        ego = EgoState(0.0, x, y, yaw, speed_kmh / 3.6)
        areas = make_strategy(strategy, named_preset(preset_name), site).at(ego).polygons()
        figure = map_picture(
            network, areas, (x, y, yaw), f"{network.name or 'map'}: {strategy} area at {speed_kmh:g} km/h"
        )
    _write(figure, path, "--png")


def _write(figure: Figure, path: Path, where: str) -> None:
    """Write a picture without time stamps and random names, so that equal runs give equal bytes."""
    import matplotlib as mpl

    ending = path.suffix.lower().removeprefix(".")
    if ending not in _STAMPS:
        raise ArgumentError(f"{where}: cannot draw {path.name!r}; the ending must be .png, .svg or .pdf")
    try:
        with mpl.rc_context({"svg.hashsalt": "smartmot"}):
            figure.savefig(path, dpi=DPI, metadata=_STAMPS[ending])
    except OSError as error:
        reason = error.strerror or str(error)
        raise ArgumentError(f"{where}: cannot write {path}: {reason}; choose another place") from None


def _row_to_show(runs: pd.DataFrame, shown: str | None) -> dict[Hashable, Any]:
    if shown is not None:
        match = runs[runs["log"] == shown]
        if match.empty:
            raise ArgumentError(f"--run: no run {shown!r}; the folder has: {', '.join(runs['log'])}")
        row: dict[Hashable, Any] = match.to_dict("records")[0]
        return row
    last = runs[runs["strategy"] == runs["strategy"].iloc[-1]]
    flagged = last[last["flag_time_s"].notna()]
    # 50 km/h is the usual speed in town; otherwise the fastest flagged run
    town = flagged[flagged["v_test_kmh"] == 50]
    rows: list[dict[Hashable, Any]] = (town if len(town) else flagged if len(flagged) else last).to_dict(
        "records"
    )
    return rows[-1]


def _ego_at(log: pd.DataFrame, time_s: float) -> EgoState:
    ego = log[log["kind"] == "ego"]
    row = ego.iloc[(ego["time_s"] - time_s).abs().argmin()]
    return EgoState(
        float(row["time_s"]),
        float(row["x_m"]),
        float(row["y_m"]),
        float(row["yaw_rad"]),
        float(row["speed_mps"]),
        length_m=float(row["length_m"]),
        width_m=float(row["width_m"]),
    )
