"""Errors that the evaluation package raises."""

from __future__ import annotations


class ArgumentError(ValueError):
    """An argument of the command line is wrong; the message names the option and what to write instead."""


class WorkerError(RuntimeError):
    """A worker process was lost; what was finished before is kept where the command keeps a journal."""
