"""The closed loop: world, sensors, brakes; stepped from outside, or run with the perception of a preset."""

from _smartmot import names_of

__getattr__ = names_of(
    __name__,
    "scenarios.simulation.ends",
    "scenarios.simulation.outcome",
    "scenarios.simulation.motion_actions",
    "scenarios.simulation.counts",
    "scenarios.sources.perception",
    "scenarios.simulation.simulation",
    front=("CUT_OFF", "EndReason", "Outcome", "Simulation", "StopRule"),
)
