"""The scenes of the comparison.

`scenes.toml` says which file is run where, with which values, and what must happen; here it is read and
checked.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args

import _smartmot
from scenarios.errors import ScenarioError
from scenarios.openscenario.expressions import Value
from scenarios.scenes.placement import SCENES, parameter_values, read_place

__all__ = ["DATA", "SCENES", "SceneRun", "all_scenes", "choose_scenes", "left_out", "scene_names"]

__getattr__ = _smartmot.names_of(__name__, "scenarios.scenes.placement")

DATA = SCENES / "scenes.toml"

Must = Literal["brake", "nothing"]


@dataclass(frozen=True, slots=True)
class SceneRun:
    """One variant of a scene.

    Args:
        scene: what it is about; variants of one scene share it.
        variant: where and how.
        must: what the ego must do.
        file: scenario file, or name of a shipped scenario.
        parameters: values in place of the declared ones, by name.
        speed_kmh: of the ego.
        default: whether it belongs to the short comparison.
    """

    scene: str
    variant: str
    must: Must
    file: str
    parameters: tuple[tuple[str, Value], ...]
    speed_kmh: float
    default: bool = True

    @property
    def name(self) -> str:
        """Name in tables, unique."""
        return f"{self.scene}, {self.variant}"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Row:
    """A variant as the data file has it; see there."""

    scene: str
    must: Must
    file: str
    parameters: Mapping[str, Value]
    speed_kmh: float
    place: str = ""
    side: str = ""
    lead_s: float = 0.0
    detail: str = ""
    after: str = ""
    short: bool = True

    def __post_init__(self) -> None:
        if self.must not in get_args(Must):
            raise ValueError(f"must is {self.must!r}; write one of: {', '.join(get_args(Must))}")
        if self.side not in ("", "near", "far"):
            raise ValueError(f"side is {self.side!r}; write near or far")
        if self.place and self.place not in _data()["places"]:
            raise ValueError(f"there is no place {self.place!r}")
        if self.file.endswith(".xosc") and not (SCENES / self.file).is_file():
            raise ValueError(f"there is no file {self.file}")

    @property
    def outer(self) -> str:
        """Name of the outer map, empty for other places."""
        return str(_data()["places"].get(self.place, {}).get("outer", ""))

    def run(self, maps: Path | None) -> SceneRun:
        """The variant as it is run.

        Raises:
            ScenarioError: the place is not on its map.
        """
        values, name = dict(self.parameters), ""
        if self.place:
            entry = _data()["places"][self.place]
            map_file = str((maps / self.outer).resolve()) if maps and self.outer else entry.get("map", "")
            place = read_place(self.place, entry, map_file)
            sources = {key: value for key, value in values.items() if str(value).startswith("=")}
            if sources:
                computed = place.computed(self.side)
                if absent := {str(source)[1:] for source in sources.values()} - computed.keys():
                    raise ScenarioError(f"place {self.place!r} computes no {', '.join(sorted(absent))}")
                values |= {key: computed[str(source)[1:]] for key, source in sources.items()}
            values |= place.values(self.side, round(self.speed_kmh / 3.6 * self.lead_s, 3))
            name = place.name
        side = f"{self.side} side" if self.side else ""
        detail = self.detail.format_map(self.parameters)
        texts = (name, side, detail, f"{self.speed_kmh:g} km/h", self.after)
        return SceneRun(
            self.scene,
            ", ".join(text for text in texts if text),
            self.must,
            str(SCENES / self.file) if self.file.endswith(".xosc") else self.file,
            tuple(sorted(values.items())),
            self.speed_kmh,
            self.short,
        )


@cache
def _data() -> dict[str, Any]:
    return tomllib.loads(DATA.read_text(encoding="utf-8"))


def recordings() -> list[dict[str, Any]]:
    """The recordings of traffic that the data file asks for; see there."""
    return list(_data()["recording"])


@cache
def _rows() -> tuple[_Row, ...]:
    """The variants in the order of the data file.

    Raises:
        ScenarioError: something in it is not understood.
    """
    rows: list[_Row] = []
    for number, table in enumerate(_data()["table"], start=1):
        columns = table["columns"]
        constants = {key: value for key, value in table.items() if key not in ("columns", "rows")}
        for line, cells in enumerate(table["rows"], start=1):
            try:
                rows.append(_row(constants, dict(zip(columns, cells, strict=True))))
            except (TypeError, ValueError) as error:
                raise ScenarioError(f"{DATA}: table {number}, row {line}: {error}") from None
    return tuple(rows)


def _row(constants: Mapping[str, Any], cells: Mapping[str, Any]) -> _Row:
    """A variant; what has a capital is a parameter.

    Raises:
        TypeError, ValueError: a key is unknown or missing, or a value cannot be.
    """
    values = {**constants, **cells}
    parameters = constants.get("parameters", {}) | cells.get("parameters", {})
    parameters |= {key: value for key, value in values.items() if key[:1].isupper()}
    values = {key: value for key, value in values.items() if key[:1].islower() and key != "parameters"}
    if unknown := values.keys() - {field.name for field in fields(_Row)}:
        raise ValueError(f"{', '.join(sorted(unknown))} is not understood")
    speed = values.pop("speed_kmh", parameters.get("Ego_speed_kmh"))
    return _Row(parameters=parameter_values(parameters), speed_kmh=float(speed), **values)


@cache
def all_scenes(maps: Path | None = None) -> tuple[SceneRun, ...]:
    """Every variant that can be run: those of outer maps only where the maps are.

    Args:
        maps: folder of outer maps: CARLA's towns and those of a campus.
    """
    return tuple(row.run(maps) for row in _rows() if _has_map(row, maps))


def _has_map(row: _Row, maps: Path | None) -> bool:
    return not row.outer or (maps is not None and (maps / row.outer).is_file())


def scene_names() -> tuple[str, ...]:
    """Names of the scenes, each once."""
    return tuple(dict.fromkeys(row.scene for row in _rows()))


def _wanted(names: Sequence[str], full: bool) -> list[_Row]:
    """Variants of the scenes of that name, without names of all."""
    wanted = set(names or scene_names())
    return [row for row in _rows() if row.scene in wanted and (full or row.short)]


def choose_scenes(
    names: Sequence[str] = (), *, full: bool = False, maps: Path | None = None
) -> tuple[SceneRun, ...]:
    """Variants to run.

    Args:
        names: scenes; none: all.
        full: every variant, not just those of the short comparison.
        maps: folder of outer maps; what `full` asks for there is left out without it, see `left_out`.

    Raises:
        ScenarioError: an unknown name, or one that only the full comparison or only outer maps have.
    """
    known = scene_names()
    for name in names:
        if name not in known:
            raise ScenarioError(f"no scene {name!r}; there are: {'; '.join(known)}")
    rows = _wanted(names, full)
    if absent := [name for name in names if name not in {row.scene for row in rows}]:
        raise ScenarioError(f"only the full comparison has {'; '.join(absent)}: add --full")
    there = {row.scene for row in rows if _has_map(row, maps)}
    if absent := [name for name in names if name not in there]:
        raise ScenarioError(f"only outer maps have {'; '.join(absent)}: give their folder with --maps")
    return tuple(row.run(maps) for row in rows if _has_map(row, maps))


def left_out(names: Sequence[str] = (), *, full: bool = False, maps: Path | None = None) -> list[str]:
    """What `choose_scenes` leaves out because an outer map is missing: a line per map."""
    scenes: dict[str, list[str]] = {}
    for row in _wanted(names, full):
        if not _has_map(row, maps):
            scenes.setdefault(row.outer, []).append(row.scene)
    reason = "give its folder with --maps" if maps is None else f"it is not in {maps}"
    return [
        f"left out: {len(absent)} variant{'s' if len(absent) > 1 else ''} on {name} "
        f"({', '.join(dict.fromkeys(absent))}); {reason}"
        for name, absent in scenes.items()
    ]
