"""Closed-loop worlds: actors, sensor, brakes, ego dynamics and the scripted tests."""

import _smartmot

_smartmot.check(__name__)
