"""The protocols by the names that the command line gives them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from evaluation.protocols.assessment import Protocol
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2023 import EuroNcap2023
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.protocols.from_file import FMVSS_127, named_table
from evaluation.protocols.paper import PaperProtocol
from evaluation.protocols.unece_r152 import R152

PROTOCOLS: dict[str, Callable[[], Protocol]] = {
    "2026": EuroNcap2026,
    "2023": EuroNcap2023,
    "paper": PaperProtocol,
    "r152": R152,
    "fmvss127": partial(named_table, FMVSS_127),
}

ALIASES = {"ancap": "2026"}
"""ANCAP takes over the protocols of Euro NCAP; which edition is assumed here: docs/protocols.md."""


def is_file(name: str) -> bool:
    """Whether a protocol is named by its file."""
    return name.lower().endswith(".toml")


def named_protocol(name: str) -> Protocol:
    """A protocol with its own defaults, or that of a file.

    Raises:
        ProtocolError: there is none of that name, or the file cannot be read.
    """
    if is_file(name):
        return named_table(Path(name))
    name = ALIASES.get(name, name)
    if name not in PROTOCOLS:
        raise ProtocolError(f"unknown protocol {name!r}; use one of: {', '.join(PROTOCOLS)}")
    return PROTOCOLS[name]()
