"""Who drives and walks around the ego, as values; entities of a scenario that stand for them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

from scenarios.errors import ScenarioError
from scenarios.openscenario.model import EntityDefinition, ScenarioDefinition

MODELS = ("Krauss", "IDM")
"""Car-following models of SUMO that are offered: its default, and the Intelligent Driver Model."""

CAR_M = (5.0, 1.8, 1.5)
"""Length, width and height of SUMO's passenger car (docs/Vehicle_Type_Parameter_Defaults)."""

WALKER_M = (0.60, 0.50, 1.8)
"""Length, width and height of the Euro NCAP adult target EPTa, along and across its walking direction."""

STEP_S = 0.1
"""Step of SUMO. Decisions of its drivers are multiples of it apart."""

MOST = 200
"""Vehicles, or pedestrians, of one run."""

_OWN = "traffic "


@dataclass(frozen=True, slots=True)
class Traffic:
    """Vehicles and pedestrians of SUMO around the ego.

    The defaults of drivers and pedestrians are SUMO's (https://sumo.dlr.de/docs,
    Vehicle_Type_Parameter_Defaults and Definition_of_Vehicles,_Vehicle_Types,_and_Routes). A driver of SUMO
    decides anew once per `reaction_s` (its actionStepLength): what happens in between is seen up to that
    time later, on average half of it. 1 s is SUMO's own default step.

    Args:
        followers: vehicles behind the ego on its way, each behind the one before, as fast as the ego.
        vehicles: others on the driving lanes around, at random places.
        walkers: pedestrians on the sidewalks around, at random places.
        model: car-following model, Krauss or IDM.
        gap_m: free distance of each follower to who is ahead at the start; None: `min_gap_m` and `tau_s` at
            the ego's speed, where Krauss' model keeps it.
        tau_s: time gap that drivers want.
        reaction_s: time between two decisions of a driver, a multiple of 0.1 s.
        accel_mps2, decel_mps2: greatest acceleration, and deceleration that drivers plan with.
        emergency_decel_mps2: greatest deceleration that a vehicle can reach.
        min_gap_m: free distance at standstill.
        sigma: imperfection of Krauss' drivers, 0 to 1; IDM has none.
        walking_mps: speed that pedestrians want.

    Raises:
        ScenarioError: a value is out of range.
    """

    followers: int = 1
    vehicles: int = 0
    walkers: int = 0
    model: str = "Krauss"
    gap_m: float | None = None
    tau_s: float = 1.0
    reaction_s: float = 1.0
    accel_mps2: float = 2.6
    decel_mps2: float = 4.5
    emergency_decel_mps2: float = 9.0
    min_gap_m: float = 2.5
    sigma: float = 0.5
    walking_mps: float = 5.0 / 3.6

    def __post_init__(self) -> None:
        for name in ("followers", "vehicles", "walkers"):
            if not 0 <= getattr(self, name) <= MOST:
                raise ScenarioError(f"traffic: {name} must be 0 to {MOST}, got {getattr(self, name)}")
        if not self.followers + self.vehicles + self.walkers:
            raise ScenarioError(
                "traffic: no vehicle or pedestrian is asked for; give followers, vehicles or walkers"
            )
        if self.model not in MODELS:
            raise ScenarioError(f"traffic: model must be one of {', '.join(MODELS)}, got {self.model!r}")
        for name in ("tau_s", "accel_mps2", "decel_mps2", "emergency_decel_mps2", "walking_mps"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ScenarioError(f"traffic: {name} must be positive, got {getattr(self, name):g}")
        for name in ("gap_m", "min_gap_m"):
            value = getattr(self, name)
            if value is not None and not 0.0 <= value < math.inf:
                raise ScenarioError(f"traffic: {name} must not be negative, got {value:g}")
        if not 0.0 <= self.sigma <= 1.0:
            raise ScenarioError(f"traffic: sigma must be 0 to 1, got {self.sigma:g}")
        if self.emergency_decel_mps2 < self.decel_mps2:
            raise ScenarioError(
                "traffic: emergency_decel_mps2 must not be below decel_mps2, got "
                f"{self.emergency_decel_mps2:g} and {self.decel_mps2:g}"
            )
        steps = self.reaction_s / STEP_S
        if not (1.0 - 1e-9 <= steps <= 100.0 and abs(steps - round(steps)) < 1e-6):
            raise ScenarioError(
                f"traffic: reaction_s must be a multiple of {STEP_S:g} s up to 10 s, got {self.reaction_s:g}"
            )

    @classmethod
    def parsed(cls, text: str) -> Traffic:
        """As it is typed: `followers=2,vehicles=6,tau_s=0.8`.

        Raises:
            ScenarioError: an unknown name, a name given twice, no number, or a value out of range.
        """
        known = {each.name: each for each in fields(cls)}
        values: dict[str, int | float | str] = {}
        for part in text.split(","):
            name, equals, value = (word.strip() for word in part.partition("="))
            if name not in known or not equals or name in values:
                what = "is given twice" if name in values else "is not known"
                raise ScenarioError(
                    f"traffic: '{part.strip()}' {what}; give NAME=VALUE of {', '.join(known)}"
                )
            try:
                if name == "model":
                    values[name] = value
                else:
                    values[name] = int(value) if known[name].type == "int" else float(value)
            except ValueError:
                raise ScenarioError(f"traffic: {name} must be a number, got {value!r}") from None
        return cls(**values)  # type: ignore[arg-type]  # by name, each checked

    def first_gap_m(self, speed_mps: float) -> float:
        """Free distance of a follower at the start, at a speed of the ego."""
        return self.min_gap_m + self.tau_s * speed_mps if self.gap_m is None else self.gap_m

    @property
    def names(self) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
        """Of followers from the ego back, vehicles and walkers, as entities."""
        return (
            tuple(f"{_OWN}follower {n}" for n in range(1, self.followers + 1)),
            tuple(f"{_OWN}vehicle {n}" for n in range(1, self.vehicles + 1)),
            tuple(f"{_OWN}walker {n}" for n in range(1, self.walkers + 1)),
        )


def with_traffic(definition: ScenarioDefinition, traffic: Traffic) -> ScenarioDefinition:
    """A scenario with an entity for each vehicle and pedestrian, none of them placed.

    Raises:
        ScenarioError: the scenario has no road, or an entity with such a name.
    """
    if definition.map_path is None:
        raise ScenarioError(f"{definition.path}: traffic needs a road, and there is none")
    taken = next((e.name for e in definition.entities if e.name.startswith(_OWN)), None)
    if taken is not None:
        raise ScenarioError(f"{definition.path}: '{taken}' is a name of the traffic; give it another")
    *vehicles, walkers = traffic.names
    added = [
        EntityDefinition(name, "SUMO passenger car", "car", *CAR_M, 0.0, 0.0)
        for names in vehicles
        for name in names
    ]
    added += [
        EntityDefinition(name, "adult", "pedestrian", *WALKER_M, 0.0, 0.0, object_type="pedestrian")
        for name in walkers
    ]
    return replace(definition, entities=(*definition.entities, *added))
