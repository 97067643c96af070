"""Values: what is never changed once it is made."""

from __future__ import annotations

from typing import Self


class Immutable:
    """What is never changed once it is made, so that copies of a run share it."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self
