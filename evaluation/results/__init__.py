"""Files of results: rows, logs and tables, written and read."""

from _smartmot import names_of

__getattr__ = names_of(
    __name__,
    *(f"evaluation.results.{name}" for name in ("rows", "logs", "tables", "by_speed", "notes", "files")),
)
