"""Maps for recordings: OpenDRIVE files and Argoverse 2's vector maps."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from opendrive import RoadNetwork, load_map
from scenarios.errors import DatasetError
from scenarios.recorded.argoverse.archive import map_archive, read_vector_map
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.maps.vector_map import VectorMap

DriveMap = RoadNetwork | VectorMap
"""A map of any kind that is read here."""


def load_drive_map(path: Path) -> DriveMap:
    """Load a map by its name: `.json` or a log's folder is one of Argoverse 2, all else OpenDRIVE.

    Raises:
        DatasetError: A folder has no map, or a vector map is wrong.
        opendrive.OpenDriveError: An OpenDRIVE file cannot be read.
    """
    if path.is_dir():
        archive = map_archive(path)
        if archive is None:
            raise DatasetError(f"{path}: no map/log_map_archive_*.json in it; name a map file")
        return read_vector_map(archive)
    return read_vector_map(path) if path.suffix == ".json" else load_map(path)


def notes_on_levels(lane_map: DriveMap, sequence: Sequence) -> list[str]:
    """What a user should know about the heights of a drive, a line each: none where no roads overlap."""
    pairs = lane_map.overlapping_roads if isinstance(lane_map, RoadNetwork) else ()
    if not pairs or sequence.ego_heights_m() is not None:
        return []
    a, b = pairs[0]
    more = f" and {len(pairs) - 1} more pairs" if len(pairs) > 1 else ""
    return [
        f"roads of the map lie above each other ({a} and {b}{more}), and sequence {sequence.name} has no "
        "heights: lanes of all levels count"
    ]


def map_of(sequences: Iterable[Sequence], named: Path | None = None) -> Path | None:
    """The map that a user named, or else the recordings' own if all have the same; None: there is none."""
    if named is not None:
        return named
    paths = {sequence.map_path for sequence in sequences}
    return paths.pop() if len(paths) == 1 else None
