"""What is known of a detector: rate, scale of its scores, noise; a small JSON file that trackers go by."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path

from smartmot.errors import ConfigError
from smartmot.filters.motion_models import PerCategory, Setting, table
from smartmot.tracking.settings import TrackerConfig
from smartmot.types import CATEGORIES

FILE_VERSION = 1
_KIND = "smartmot detector profile"


@dataclass(frozen=True, slots=True)
class CategoryProfile:
    """A detector on one category.

    Args:
        detections: How many the values are from.
        reference_score: Score of a sure detection, see `smartmot.tracking.scores`.
        position_sigma_m: Noise of a centre along each axis; None: not known.

    Raises:
        ConfigError: A value is outside its range.
    """

    detections: int
    reference_score: float
    position_sigma_m: float | None = None

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if value is None and item.default is None:
                continue
            high = 1.0 if item.name == "reference_score" else math.inf
            if not (_is_number(value) and 0.0 < value <= high and math.isfinite(value)):
                allowed = "over 0 and at most 1" if high == 1.0 else "positive"
                raise ConfigError(f"{item.name} must be {allowed}, got {value!r}")


@dataclass(frozen=True, slots=True)
class DetectorProfile:
    """A detector.

    Args:
        name: For people.
        rate_hz: Frames per second.
        categories: What it says of the categories that it reports.
        delay_s: Time from a measurement to its arrival, where several detectors report to one tracker.
        trust: What a sure detection of it counts, against one of a detector of trust 1: scores are multiplied
            by it. Under the tracker's threshold for births it starts no track, and only follows those of
            others.

    Raises:
        ConfigError: A value is outside its range, or a category unknown.
    """

    name: str
    rate_hz: float
    categories: Mapping[str, CategoryProfile] = field(default_factory=dict)
    delay_s: float = 0.0
    trust: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.name, str):
            raise ConfigError(f"name must be a text, got {self.name!r}")
        if not _is_number(self.rate_hz) or not 0.0 < self.rate_hz < math.inf:
            raise ConfigError(f"rate_hz must be positive, got {self.rate_hz!r}")
        if not _is_number(self.delay_s) or not 0.0 <= self.delay_s < math.inf:
            raise ConfigError(f"delay_s must be 0 or more, got {self.delay_s!r}")
        if not _is_number(self.trust) or not 0.0 < self.trust <= 1.0:
            raise ConfigError(f"trust must be over 0 and at most 1, got {self.trust!r}")
        for category in self.categories:
            if category not in CATEGORIES:
                raise ConfigError(f"category {category!r} is unknown; there are {', '.join(CATEGORIES)}")

    def configured(self, config: TrackerConfig) -> TrackerConfig:
        """A configuration for this detector; what the profile does not know stays as it is.

        Args:
            config: The configuration. Its thresholds on scores become relative to the detector's.
        """
        known = {name: each.position_sigma_m for name, each in self.categories.items()}
        reference = {name: each.reference_score for name, each in self.categories.items()}
        return replace(
            config,
            score_reference=_changed(1.0, reference),
            filter=replace(config.filter, position_sigma_m=_changed(config.filter.position_sigma_m, known)),
        )

    def save(self, path: str | Path) -> None:
        """Write the profile as JSON, for `load`."""
        content = {"kind": _KIND, "version": FILE_VERSION, **asdict(self)}
        Path(path).write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> DetectorProfile:
        """Profile that `save` wrote, or that somebody has written by hand.

        Raises:
            ConfigError: The file is missing, no profile, of another version, or has a value out of range.
        """
        try:
            content = json.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise ConfigError(f"{path}: {error.strerror or error}") from None
        except (ValueError, RecursionError) as error:
            raise ConfigError(f"{path}: no JSON ({error})") from None
        if not isinstance(content, dict) or content.get("kind") != _KIND:
            raise ConfigError(
                f'{path}: no detector profile; "kind" must be "{_KIND}" (made by mot --profile)'
            )
        if content.get("version") != FILE_VERSION:
            version = content.get("version")
            raise ConfigError(f"{path}: profile of version {version!r}, this release reads {FILE_VERSION}")
        try:
            categories = {
                name: CategoryProfile(**values) for name, values in content.get("categories", {}).items()
            }
            more = {name: content[name] for name in ("delay_s", "trust") if name in content}
            return cls(content["name"], content["rate_hz"], categories, **more)
        except KeyError as error:
            raise ConfigError(f"{path}: {error.args[0]} is missing") from None
        except (TypeError, AttributeError, ConfigError) as error:
            raise ConfigError(f"{path}: {error}") from None


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def is_profile(name: str) -> bool:
    """Whether a tracker's name is a file with a detector's profile."""
    return name.lower().endswith(".json")


def _changed(setting: Setting, known: Mapping[str, float | None]) -> PerCategory:
    """A setting with the values that are known."""
    usual = dict(zip(CATEGORIES, table(setting).tolist(), strict=True))
    return PerCategory(**usual | {name: value for name, value in known.items() if value is not None})
