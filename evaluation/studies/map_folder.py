"""All maps of a folder: loaded or refused, why, and what was found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from time import process_time

from opendrive import MapReadError, load_map

SUFFIX = ".xodr"


@dataclass(frozen=True, slots=True)
class MapAccount:
    """What became of one map of a folder.

    Attributes:
        name: the file, relative to the folder.
        roads: how many roads it has.
        lanes: how many lanes it has.
        refusal: why it was refused; empty if it was not.
        found: how often each kind of finding was found, the most frequent first.
        defects: how many of the findings are defects, not only broken rules of the standard.
        processor_s: processor time of reading and checking it, s.
    """

    name: str
    roads: int
    lanes: int
    refusal: str
    found: tuple[tuple[str, int], ...]
    defects: int
    processor_s: float


def maps_of(folder: Path, layer: str) -> Iterator[MapAccount]:
    """Yield what became of each OpenDRIVE file of a folder and the folders in it, by name."""
    for file in sorted(folder.rglob(f"*{SUFFIX}")):
        name = file.relative_to(folder).as_posix()
        start_s = process_time()
        roads, lanes, refusal, defects, kinds = 0, 0, "", 0, Counter[str]()
        try:
            network = load_map(file, layer=layer)
        except MapReadError as error:
            refusal = str(error).removeprefix(f"{file}: ")
        else:
            roads, lanes = len(network.roads), len(network.lanes)
            kinds.update(finding.kind.value for finding in network.findings)
            defects = sum(finding.kind.is_defect for finding in network.findings)
        spent_s = process_time() - start_s
        yield MapAccount(name, roads, lanes, refusal, tuple(kinds.most_common()), defects, spent_s)


def folder_table(accounts: Iterator[MapAccount]) -> Iterator[str]:
    """Yield the lines of a Markdown table of maps, and a line with their numbers."""
    yield "| map | roads | lanes | found | s |"
    yield "|---|---|---|---|---|"
    loaded = refused = clean = 0
    for account in accounts:
        kinds = ", ".join(f"{count} x {kind}" for kind, count in account.found)
        sizes = f"{account.roads} | {account.lanes}"
        if account.refusal:
            refused += 1
            sizes, kinds = "| ", f"refused: {_cell(account.refusal)}"
        else:
            loaded += 1
            clean += not account.found
        yield f"| {_cell(account.name)} | {sizes} | {kinds} | {account.processor_s:.2f} |"
    yield ""
    yield f"{loaded + refused} maps: {loaded} loaded, {clean} of them without findings; {refused} refused"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
