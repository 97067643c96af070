"""The closed loop: world, sensor, perception, brakes."""

from _smartmot import names_of

__getattr__ = names_of(__name__, "scenarios.simulation.simulation")
