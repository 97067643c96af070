"""OpenSCENARIO XML 1.0 to 1.3: reader and engine (see docs/openscenario.md).

definition = load("scenario.xosc", {"Ego_speed_kph": 40})
run = Engine(definition).run()
"""

from scenarios.openscenario.checking import FileCheck, check, scenario_files
from scenarios.openscenario.control import BrakeAt, EgoController, Motion
from scenarios.openscenario.errors import (
    CatalogError,
    ContentError,
    ExpressionError,
    FileReadError,
    OpenScenarioError,
    ParameterError,
    RunError,
    UnsupportedError,
)
from scenarios.openscenario.model import ScenarioDefinition
from scenarios.openscenario.reading.distributions import Variation, admissible, expand
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine
from scenarios.openscenario.running.results import Contact, Entities, Run

__all__ = [
    "BrakeAt",
    "CatalogError",
    "Contact",
    "ContentError",
    "EgoController",
    "Engine",
    "Entities",
    "ExpressionError",
    "FileCheck",
    "FileReadError",
    "Motion",
    "OpenScenarioError",
    "ParameterError",
    "Run",
    "RunError",
    "ScenarioDefinition",
    "UnsupportedError",
    "Variation",
    "admissible",
    "check",
    "expand",
    "load",
    "scenario_files",
]
