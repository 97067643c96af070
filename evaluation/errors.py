"""Errors that the evaluation package raises."""

from __future__ import annotations


class ArgumentError(ValueError):
    """An option, or an argument in Python, is wrong; the message names it and says what to write instead."""


class WorkerError(RuntimeError):
    """A worker process was lost; what was finished before is kept where the command keeps a journal."""
