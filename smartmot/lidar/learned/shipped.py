"""Networks that come with the package; their cards say how they were made and how good they are."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from smartmot.errors import ConfigError
from smartmot.lidar.learned.network_file import LearnedConfig

FOLDER = Path(__file__).parent / "weights"

SHIPPED = ("pillars", "pillars_int8")
"""Names of the networks: NAME.onnx in the folder, with the card NAME.json."""


def shipped_card(name: str) -> dict[str, Any]:
    """What is known of a shipped network: SHA-256, size, data, training, quality.

    Raises:
        ConfigError: there is no such network, or the package is damaged.
    """
    if name not in SHIPPED:
        raise ConfigError(f"network: no {name!r} is shipped; choose {', '.join(SHIPPED)}")
    path = FOLDER / f"{name}.json"
    try:
        card: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        _ = card["sha256"], card["bytes"], card["least_score"]
    except (OSError, ValueError, KeyError, TypeError):
        raise ConfigError(f"{path}: is missing or damaged; install the package again") from None
    return card


def shipped_path(name: str) -> Path:
    """The file of a shipped network."""
    return FOLDER / f"{name}.onnx"


def shipped_network(name: str = "pillars", least_score: float | None = None) -> LearnedConfig:
    """A shipped network, if size and SHA-256 are those of its card.

    Args:
        name: out of `SHIPPED`.
        least_score: boxes with a lower score are left out; None: what the card says of each class.

    Raises:
        ConfigError: there is no such network, or the package is damaged.
    """
    card, path = shipped_card(name), shipped_path(name)
    size = path.stat().st_size if path.is_file() else 0
    if size != card["bytes"]:
        raise ConfigError(f"{path}: has {size} bytes in place of {card['bytes']}; install the package again")
    least = tuple(card["least_score"]) if least_score is None else least_score
    return LearnedConfig(path, card["sha256"], least)
