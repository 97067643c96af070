"""Euro NCAP's protocols of 2026: grid, verification points, requirements, score."""

from _smartmot import names_of

__getattr__ = names_of(__name__, "evaluation.protocols.euroncap_2026.protocol")
