"""All maps of a folder: loaded or refused, why, and what was found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from opendrive import MapReadError, RoadNetwork, load_map

SUFFIX = ".xodr"


@dataclass(frozen=True, slots=True)
class MapAccount:
    """What became of one map of a folder.

    Attributes:
        name: the file, relative to the folder.
        network: the map; None if it was refused.
        refusal: why it was refused; empty if it was not.
        found: how often each kind of finding was found, the most frequent first.
    """

    name: str
    network: RoadNetwork | None
    refusal: str
    found: tuple[tuple[str, int], ...]


def maps_of(folder: Path, layer: str) -> Iterator[MapAccount]:
    """Yield what became of each OpenDRIVE file of a folder and the folders in it, by name."""
    for file in sorted(folder.rglob(f"*{SUFFIX}")):
        name = file.relative_to(folder).as_posix()
        try:
            network = load_map(file, layer=layer)
        except MapReadError as error:
            yield MapAccount(name, None, str(error).removeprefix(f"{file}: "), ())
        else:
            kinds = Counter(finding.kind.value for finding in network.findings)
            yield MapAccount(name, network, "", tuple(kinds.most_common()))


def folder_table(accounts: Iterator[MapAccount]) -> Iterator[str]:
    """Yield the lines of a Markdown table of maps, and a line with their numbers."""
    yield "| map | roads | lanes | found |"
    yield "|---|---|---|---|"
    loaded = refused = clean = 0
    for account in accounts:
        if account.network is None:
            refused += 1
            yield f"| {account.name} | | | refused: {_cell(account.refusal)} |"
            continue
        loaded += 1
        clean += not account.found
        kinds = ", ".join(f"{count} x {kind}" for kind, count in account.found)
        yield f"| {account.name} | {len(account.network.roads)} | {len(account.network.lanes)} | {kinds} |"
    yield ""
    yield f"{loaded + refused} maps: {loaded} loaded, {clean} of them without findings; {refused} refused"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
