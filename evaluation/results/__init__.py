"""Files of results: rows, logs and tables, written and read."""

from _smartmot import names_of

__getattr__ = names_of(__name__, "evaluation.results.rows")
