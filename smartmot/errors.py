"""Errors that the perception package raises."""

from __future__ import annotations


class SmartMotError(ValueError):
    """Base of every error this package raises on bad input."""


class ShapeError(SmartMotError):
    """An array has another shape, length or kind than the type asks for."""


class ConfigError(SmartMotError):
    """A setting has a value outside its allowed range."""


class TimeOrderError(SmartMotError):
    """A frame is not newer than the one before it."""


class StampError(ShapeError, TimeOrderError):
    """A stamp is no finite number of seconds."""


class PluginError(SmartMotError):
    """An object of the user's cannot be loaded, fails, or returns something that cannot be used."""
