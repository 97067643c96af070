"""A map as one HTML page, to pan, zoom, search and hover; it needs no network."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from pathlib import Path

from evaluation.results.files import write_whole
from evaluation.views.map_page.payload import map_payload
from evaluation.views.pictures import told_of_writing
from opendrive import RoadNetwork
from opendrive.arrays import FloatArray
from smartmot.area.lanes import MapAreaConfig

TEMPLATE = Path(__file__).with_name("map.html")
DEFAULT_AREA = MapAreaConfig()
DEFAULT_SPEED_KMH = 50.0


def map_page(
    network: RoadNetwork,
    title: str,
    area: Sequence[FloatArray] = (),
    config: MapAreaConfig = DEFAULT_AREA,
    speed_kmh: float = DEFAULT_SPEED_KMH,
) -> str:
    """Return the page of a map.

    Args:
        network: the map.
        title: shown above it.
        area: outlines of a monitored area, (P, 2) each, map frame.
        config: of the monitored lanes at a place that is clicked.
        speed_kmh: of the ego there, at first.
    """
    data = json.dumps(map_payload(network, area, config, speed_kmh), separators=(",", ":"), allow_nan=False)
    page = TEMPLATE.read_text(encoding="utf-8")
    # Names in a map may hold anything; within a script no "<" may begin a tag.
    return page.replace("@TITLE@", html.escape(title)).replace("@DATA@", data.replace("<", "\\u003c"))


def save_map_page(
    network: RoadNetwork,
    path: Path,
    title: str,
    area: Sequence[FloatArray] = (),
    config: MapAreaConfig = DEFAULT_AREA,
    speed_kmh: float = DEFAULT_SPEED_KMH,
) -> None:
    """Write the page of a map; see `map_page`.

    Raises:
        ArgumentError: the file cannot be written.
    """
    with told_of_writing("--view", path):
        write_whole(path, map_page(network, title, area, config, speed_kmh).encode("utf-8"))
