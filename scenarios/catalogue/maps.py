"""The maps that are shipped with the package, by name."""

from __future__ import annotations

from pathlib import Path

MAPS = Path(__file__).parents[1] / "maps"

SHIPPED_MAPS = (
    "urban_street",
    "urban_street_parking",
    "urban_bend",
    "euro_ncap_street",
    "urban_intersection",
)
DEFAULT_MAP = "urban_street"
"""A test takes place on it unless the user names another."""


class UnknownMapError(LookupError):
    """A map was asked for by a name that no shipped map has."""


def shipped_map(name: str) -> Path:
    """Path of a shipped map's file.

    Raises:
        UnknownMapError: No shipped map has this name.
    """
    if name not in SHIPPED_MAPS:
        raise UnknownMapError(f"no shipped map is called {name!r}; there are {', '.join(SHIPPED_MAPS)}")
    return MAPS / f"{name}.xodr"
