"""Lanes as a table, their graph, ways along them."""

from _smartmot import names_of

__getattr__ = names_of(__name__, "opendrive.lanes.table")
