"""Runs as values: what determines them, carrying them out in several processes, what is finished."""

from _smartmot import names_of

__getattr__ = names_of(__name__, "scenarios.spec", "scenarios.weather", "evaluation.runs.execution")
