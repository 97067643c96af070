"""Comparisons: suites of runs, scores, tables, pictures and the command line."""

import _smartmot

_smartmot.check(__name__)
