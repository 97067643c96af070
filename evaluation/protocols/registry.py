"""The protocols by the names that the command line gives them."""

from __future__ import annotations

from collections.abc import Callable

from evaluation.protocols.assessment import Protocol
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2023 import EuroNcap2023
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.protocols.paper import PaperProtocol
from evaluation.protocols.unece_r152 import R152

PROTOCOLS: dict[str, Callable[[], Protocol]] = {
    "2026": EuroNcap2026,
    "2023": EuroNcap2023,
    "paper": PaperProtocol,
    "r152": R152,
}


def named_protocol(name: str) -> Protocol:
    """A protocol with its own defaults.

    Raises:
        ProtocolError: there is none of that name.
    """
    if name not in PROTOCOLS:
        raise ProtocolError(f"unknown protocol {name!r}; use one of: {', '.join(PROTOCOLS)}")
    return PROTOCOLS[name]()
