"""Errors that the scenario package raises."""

from __future__ import annotations


class ScenarioError(ValueError):
    """A scenario cannot be set up or run as asked; the message says what, where and what to do."""


class DatasetError(ValueError):
    """A recording or a table of boxes cannot be used; the message names file, line and field."""
