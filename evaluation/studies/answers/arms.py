"""Who decides, in which conditions: the sides of a comparison, and their runs over independent scenes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from evaluation.errors import ArgumentError
from evaluation.runs.execution import execute
from evaluation.studies.compare.grid import joined, seeded_phase_s
from evaluation.studies.study import LabelledRun
from scenarios.errors import ScenarioError
from scenarios.presets import Preset, named_preset
from scenarios.scenes.scenes import SceneRun
from scenarios.settings import PARAMETERS, Setting, Settings, preset_with, settings_text
from scenarios.spec import RunSpec
from scenarios.strategies import path_source
from smartmot.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Arm:
    """One side of a comparison.

    Args:
        name: in tables and figures.
        strategy: monitored area.
        settings: parameters that depart from the preset.
        preset: conditions.
        coins: parameters among them whose sign is drawn for each scene: a bias whose side is not known.
    """

    name: str
    strategy: str
    settings: Settings = ()
    preset: str = "physical"
    coins: tuple[str, ...] = ()

    @property
    def rule(self) -> str:
        """Name of the brake rule."""
        return str(dict(self.settings).get("rule", "paper"))

    @property
    def text(self) -> str:
        """Strategy and settings as they are typed."""
        return ", ".join(part for part in (self.strategy, settings_text(self.settings)) if part)

    @property
    def conditions(self) -> Preset:
        """Its preset with its settings."""
        return preset_with(named_preset(self.preset), self.settings)

    @property
    def path_from(self) -> str:
        """Where its planned path comes from; see `scenarios.strategies.path_source`."""
        return path_source(self.strategy, self.conditions)

    def having(self, *settings: tuple[str, Setting], name: str = "", coin: bool = False) -> Arm:
        """The same with other values of some parameters; those that mean nothing for its strategy drop out.

        Args:
            settings: names and values.
            name: in tables; empty: as before.
            coin: whether the sign of these is drawn for each scene.
        """
        changed = {key: value for key, value in settings if PARAMETERS[key].changes(self.strategy)}
        coins = (*self.coins, *changed) if coin else tuple(key for key in self.coins if key not in changed)
        merged = tuple((dict(self.settings) | changed).items())
        return replace(self, name=name or self.name, settings=merged, coins=tuple(dict.fromkeys(coins)))

    def check(self) -> None:
        """See that its settings are possible, before the first run.

        Raises:
            ArgumentError: one is not.
        """
        try:
            self.conditions  # noqa: B018 - made to see whether it can be
        except (ConfigError, ScenarioError) as error:
            raise ArgumentError(f"{self.name} ({settings_text(self.settings)}): {error}") from None

    @property
    def plugins(self) -> tuple[str, ...]:
        """What of the user's own takes part."""
        return self._trial.plugins

    def try_out(self) -> None:
        """Drive one shipped crossing with it: mistakes in what is the user's own appear in the first frames.

        Raises:
            smartmot.errors.PluginError: it cannot be made, or fails.
        """
        execute(self._trial, keep_log=False)

    @property
    def _trial(self) -> RunSpec:
        parameters = (("Ego_speed_kmh", 50.0),)
        return RunSpec(
            "trial", "crossing", parameters, self.strategy, self.preset, "dry", 50.0, settings=self.settings
        )

    def settings_in(self, scene_seed: int) -> Settings:
        """Its settings in the scene with a seed, signs drawn."""
        return tuple((key, self._value(key, value, scene_seed)) for key, value in self.settings)

    def _value(self, key: str, value: Setting, scene_seed: int) -> Setting:
        if key not in self.coins or isinstance(value, str):
            return value
        return value if _digest(f"{scene_seed} {key}") % 2 else -value


ArmRun = LabelledRun[tuple[Arm, SceneRun]]
"""One run of an arm in a scene."""


def scene_seed(seed: int, scene: SceneRun) -> int:
    """Seed of the noise in a scene: its own, since scenes with the same noise would not be independent."""
    return _digest(f"{seed} {scene.name}")


def _digest(text: str) -> int:
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:4], "big")


def arm_runs(
    arms: Sequence[Arm], scenes: Sequence[SceneRun], seed: int, common: Settings = ()
) -> list[ArmRun]:
    """The runs, by arm and scene. In one scene all arms meet the same noise.

    Args:
        arms: who is run.
        scenes: where.
        seed: of the noise.
        common: settings of all arms that do not have others.
    """
    return [
        LabelledRun(spec_of(arm, scene, scene_seed(seed, scene), common), (arm, scene))
        for arm in arms
        for scene in scenes
    ]


def spec_of(arm: Arm, scene: SceneRun, noise: int, common: Settings = ()) -> RunSpec:
    """A run of an arm in a scene, with a seed of the noise."""
    return RunSpec(
        scenario=scene.name,
        file=scene.file,
        parameters=scene.parameters,
        strategy=arm.strategy,
        preset=arm.preset,
        weather="dry",
        v_test_kmh=scene.speed_kmh,
        seed=noise,
        phase_s=seeded_phase_s(noise),
        must=scene.must,
        settings=_with_own_street(joined(common, arm.settings_in(noise)), noise),
    )


_STREETS = 100_000
"""Seeds of streets that scenes draw from."""


def _with_own_street(settings: Settings, noise: int) -> Settings:
    """Settings with a furnished street of the scene's own, unless one is asked for."""
    values = dict(settings)
    if values.get("street") != "furnished" or "street_seed" in values:
        return settings
    return (*settings, ("street_seed", float(noise % _STREETS)))
