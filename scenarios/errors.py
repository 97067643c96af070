"""Errors that the scenario package raises."""

from __future__ import annotations


class ScenarioError(ValueError):
    """A scenario cannot be set up or run as asked; the message says what, where and what to do."""
