"""Closed-loop worlds: actors, sensor, brakes, ego dynamics and the scripted tests."""
