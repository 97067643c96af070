"""The libraries of the extra `ros`, imported only where they are used."""

from __future__ import annotations

from importlib import import_module

import _smartmot
from scenarios.errors import DatasetError


def require_libraries() -> None:
    """Demand that the extra `ros` is installed.

    Raises:
        DatasetError: it is not; the message says how to install it.
    """
    for name in ("rosbags.typesys", "zstandard", "lz4.frame"):
        try:
            import_module(name)
        except ImportError as error:
            raise DatasetError(_smartmot.missing_extra("ROS bags", "ros", error)) from None
