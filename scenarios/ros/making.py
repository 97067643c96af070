"""Messages of rosbags' classes from some of their fields; the classes know no defaults."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

Make = Callable[..., Any]
"""Makes a message from the name of its type and its fields; those not given have their defaults."""


def rosbags_make(types: Typestore) -> Make:
    """Makes messages of a store, as `make("std_msgs/msg/Bool", data=True)`."""

    def defaults(name: str) -> dict[str, Any]:
        return {field: default(kind, what) for field, (kind, what) in types.fielddefs[name][1]}

    def default(kind: Any, what: Any) -> Any:
        if kind.name == "BASE":
            return _BASE_DEFAULTS.get(what[0], 0)
        if kind.name == "NAME":
            return types.types[what](**defaults(what))
        (inner_kind, inner), length = what
        count = length if kind.name == "ARRAY" else 0
        if inner_kind.name == "BASE" and inner[0] != "string":
            return np.zeros(count, dtype=_DTYPES.get(inner[0], inner[0]))
        return [default(inner_kind, inner) for _ in range(count)]

    def make(name: str, /, **fields: Any) -> Any:
        return types.types[name](**{**defaults(name), **fields})

    return make


_BASE_DEFAULTS = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}
_DTYPES = {"byte": "uint8", "octet": "uint8", "char": "uint8"}
