"""The command line: `entry` composes it, each command has a file, shared options are declared once."""

import _smartmot
from evaluation.cli.entry import app, main

__all__ = ["app", "main"]

__getattr__ = _smartmot.names_of(
    __name__, "evaluation.cli.options", "evaluation.cli.entry", "evaluation.cli.output"
)
