"""Colour and marker of each strategy: the same in every picture, on the page and in a film."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

from evaluation.views.plots.style import BLACK, BLUE, GREY, VERMILLION

Look = tuple[str, str]
"""Colour, and marker of a point."""

SHIPPED: dict[str, Look] = {
    "rectangular": (VERMILLION, "s"),
    "map": (BLUE, "o"),
    "path": ("#00cc66", "^"),
    "all": (BLACK, "D"),
    "adaptive": ("#aa00ff", "v"),
    "none": (GREY, "p"),
}
"""Of the shipped strategies, and of the run in which nothing brakes."""

OWN: tuple[Look, ...] = (
    ("#663311", "P"),
    ("#ffcc00", "X"),
    ("#221199", "<"),
    ("#aaccff", ">"),
    ("#554455", "h"),
    ("#ee55ff", "d"),
    ("#440055", "8"),
    ("#99ffbb", "H"),
)
"""Of the user's own. Chosen one after the other, each the colour of the RGB cube (16 steps) whose least
CIELAB distance to white, to the shipped colours and to those before it is greatest, over normal vision and
three kinds of colour blindness (Machado, Oliveira and Fernandes 2009, full severity): 21 or more between any
two."""


def strategy_looks(strategies: Iterable[str]) -> dict[str, Look]:
    """Colour and marker of each strategy, in the order given.

    A strategy of the user's own has the look that the digest of its name points at, so that it is the same
    whichever others are shown. Of two that point at the same one, the later by name takes the next that is
    free.

    Args:
        strategies: names, in any order; repetitions count once.
    """
    names = list(dict.fromkeys(strategies))
    taken: dict[int, str] = {}
    looks = {name: SHIPPED[name] for name in names if name in SHIPPED}
    for name in sorted(set(names) - set(looks)):
        first = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
        places = [(first + step) % len(OWN) for step in range(len(OWN))]
        place = next((place for place in places if place not in taken), places[0])
        taken[place] = name
        looks[name] = OWN[place]
    return {name: looks[name] for name in names}


def strategy_colour(strategy: str, among: Iterable[str] = ()) -> str:
    """Colour of one strategy.

    Args:
        strategy: its name.
        among: all that a folder of results holds, so that it is drawn as beside them.
    """
    return strategy_looks([strategy, *among])[strategy][0]
