"""Parts of the reference results that are made with data of others, which the project does not hold.

A folder of such data holds what the parts need by these paths: KITTI tracking sequences with detections in
`kitti`, logs of Argoverse 2 in `argoverse2/logs`, CARLA's towns as OpenDRIVE in `opendrive/maps`. Kept are
numbers alone.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError
from evaluation.studies.answers.arms import ArmRun
from evaluation.studies.answers.gain import Gain
from evaluation.studies.drive.recordings import Source
from evaluation.studies.drive.side_by_side.comparison import DriveComparison
from evaluation.studies.drive.study import Options

MAPS = "opendrive/maps"
TOWNS = ("Town01", "Town03", "Town04", "Town07", "c0910_Town10HD")
"""CARLA's towns by the names of their files."""

RULES = (
    "paper", "cascade", "cascade_gentle", "required_deceleration", "last_point_to_brake", "rss", "autoware",
    "autoware_readme", "r157",
)  # fmt: skip
"""The brake rules that the kept drives have. `staged` is newer: it comes with the next run of all of them."""


@dataclass(frozen=True, slots=True)
class DrivesPart(DriveComparison):
    """Every strategy and rule on recorded drives of others; the source's folder is a path in their folder."""

    @property
    def needs(self) -> tuple[str, ...]:
        """The data set."""
        return (self.options.source.folder.as_posix(),)

    def with_outside(self, outside: Path) -> DrivesPart:
        """The part with its data."""
        source = replace(self.options.source, folder=outside / self.options.source.folder)
        return replace(self, options=replace(self.options, source=source))


@dataclass(frozen=True, slots=True)
class TownsPart(Gain):
    """The gain of each monitored area in scenes on CARLA's towns.

    Args:
        outside: folder of data from outside; None: not known.
    """

    outside: Path | None = None
    name = "towns"

    @property
    def needs(self) -> tuple[str, ...]:
        """The towns."""
        return tuple(f"{MAPS}/{town}.xodr" for town in TOWNS)

    def with_outside(self, outside: Path) -> TownsPart:
        """The part with its maps."""
        return replace(self, outside=outside)

    def items(self, folder: Path) -> list[ArmRun]:
        """The runs; see `Question.items`."""
        return Gain.items(self._on_towns(folder), folder)

    def some(self, count: int, folder: Path) -> tuple[int, dict[int, ArmRun]]:
        """A few runs; see `Question.some`."""
        return Gain.some(self._on_towns(folder), count, folder)

    def _on_towns(self, folder: Path) -> TownsPart:
        """The part with the towns alone as its maps: they may lie among others."""
        if self.outside is None:
            raise ArgumentError(f"{self.name}: made with maps of others; give --outside DIR")
        towns = folder / "towns"
        try:
            towns.mkdir(parents=True, exist_ok=True)
            for path in self.needs:
                shutil.copyfile(self.outside / path, towns / Path(path).name)
        except OSError as error:
            raise ResultsError(f"{towns}: cannot be written ({error.strerror})") from None
        return replace(self, sample=replace(self.sample, maps=towns))


def drives_part(
    name: str, folder: str, strategies: tuple[str, ...], rules: tuple[str, ...] = RULES
) -> DrivesPart:
    """Rules with some strategies on the drives of a folder; the first strategy is compared with."""
    return DrivesPart(Options(Source(Path(folder)), strategies, rules, "real"), name)


def without_data(needs: Sequence[str], outside: Path | None) -> str:
    """What is missing of what a part needs, for a message; empty: nothing."""
    if not needs:
        return ""
    if outside is None:
        return f"its data are not in this project; give --outside DIR, a folder with {needs[0]}"
    missing = [path for path in needs if not (outside / path).exists()]
    return f"{outside} has no {missing[0]}" if missing else ""
