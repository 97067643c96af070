"""What `import smartmot` gives beside perception: maps, scenarios, runs, studies, results.

Each function carries out what the command of the same name does, by the same functions, and gives its
results in place of printing them.
"""

from evaluation.api.inputs import load_map, scenarios
from evaluation.api.results import Results, load_results
from evaluation.api.single_run import Run, run
from evaluation.api.studies import compare, drive, ncap, sweep

__all__ = [
    "Results",
    "Run",
    "compare",
    "drive",
    "load_map",
    "load_results",
    "ncap",
    "run",
    "scenarios",
    "sweep",
]
