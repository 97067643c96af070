"""Errors that the protocols raise."""

from __future__ import annotations


class ProtocolError(ValueError):
    """A run, a cell or a setting does not fit the protocol; the message says what to change."""
