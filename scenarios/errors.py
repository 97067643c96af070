"""Errors that the scenario package raises."""

from __future__ import annotations


class ScenarioError(ValueError):
    """A scenario cannot be set up or run as asked; the message says what, where and what to do."""


class StepOrderError(ScenarioError):
    """A source of frames is stepped before its start or after its end, or has no outcome yet."""


class DatasetError(ValueError):
    """A recording or a table of boxes cannot be used; the message names file, line and field."""
