"""The command line.

Each command has a file.
"""

from evaluation.cli.command import app, main

__all__ = ["app", "main"]
