"""A strategy has one colour, whoever is shown beside it, and any colour vision tells it from the others."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb

from evaluation.views.plots.strategies import OWN, SHIPPED, strategy_colour, strategy_looks

# Machado, Oliveira and Fernandes 2009, table 1, severity 1.0, for linear RGB
VISIONS = {
    "normal": np.eye(3),
    "protan": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deutan": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritan": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
# sRGB (IEC 61966-2-1) to CIE XYZ, white of D65
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
WHITE = np.array([0.95047, 1.0, 1.08883])


def lab(colour: str, vision: str) -> np.ndarray:
    """CIELAB of a colour as somebody sees it."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = XYZ @ np.clip(np.array(VISIONS[vision]) @ linear, 0.0, 1.0) / WHITE
    f = np.where(seen > 216 / 24389, np.cbrt(seen), (24389 / 27 * seen + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", VISIONS)
def test_any_colour_vision_tells_the_palette_apart(vision: str) -> None:
    """A distance of 2.3 is just noticed; 20 is plain, and more than the least between Okabe's and Ito's
    eight."""
    colours = [*(colour for colour, _ in SHIPPED.values()), *(colour for colour, _ in OWN), "white"]
    for one, two in itertools.combinations(colours, 2):
        assert np.linalg.norm(lab(one, vision) - lab(two, vision)) > 20.0, (one, two)


def test_markers_tell_the_palette_apart_without_colour() -> None:
    markers = [marker for _, marker in (*SHIPPED.values(), *OWN)]
    assert len(set(markers)) == len(markers)


@pytest.mark.parametrize("name", ["rectangular", "map", "all", "none", "mine:make", "other.area:build"])
def test_the_look_does_not_depend_on_who_else_is_shown(name: str) -> None:
    alone = strategy_looks([name])[name]
    for shown in itertools.permutations([name, "rectangular", "map", "all"]):
        assert strategy_looks(shown)[name] == alone
    assert strategy_colour(name) == alone[0]


@given(st.lists(st.text(max_size=12), unique=True, max_size=len(OWN)))
def test_own_strategies_differ_from_the_shipped_and_from_each_other(names: list[str]) -> None:
    looks = strategy_looks([*SHIPPED, *names])
    own = set(looks) - set(SHIPPED)
    assert len({looks[name] for name in own} | set(SHIPPED.values())) == len(looks)
    assert strategy_looks(reversed(list(looks))) == looks


def test_more_strategies_than_colours_share_them() -> None:
    names = [f"area{k}:make" for k in range(len(OWN) + 3)]
    looks = strategy_looks(names)
    assert set(looks) == set(names)
    assert set(looks.values()) == set(OWN)
