"""Sentences of the reference page, computed from the tables beside it."""
