"""Attributes of elements as checked values, and what is tolerated on the way."""

import math
from collections.abc import Callable, Collection, Iterable
from typing import Literal, TypeAlias, TypeVar, overload

import numpy as np
from lxml import etree

from opendrive.arrays import FloatArray, read_only
from opendrive.errors import MapContentError, MapWarning, WarningKind
from opendrive.model import ContactPoint, LaneRange, TrafficRule

Element: TypeAlias = etree._Element
_Record = TypeVar("_Record")

MPS_PER_UNIT = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704}
MAX_NUMBER = 1e9
"""A greater number is refused: no quantity of a road map comes near it."""

MAX_INTEGER = 10**6
MAX_LENGTH_M = 1e6
"""A road that is longer is refused."""

CUBIC = ("s", "a", "b", "c", "d")
CUBIC_OFFSET = ("sOffset", "a", "b", "c", "d")
NO_CUBICS = read_only(np.empty((0, 5)))

_KEPT_AS_THEY_ARE = {
    "userData", "dataQuality", "surface", "license", "defaultRegulations", "semantics", "boundary",
    "elevationGrid", "planView", "neighbor", "skeleton",
}  # fmt: skip


SMALL_INTEGERS = {str(value): value for value in range(-30, 31)}
"""By their text: ids of lanes are converted thousands of times."""


class Values:
    """Reads values out of elements; collects warnings.

    Attributes:
        file: name of the file, for messages.
        warnings: what was tolerated so far.
    """

    def __init__(self, file: str) -> None:
        """Start without warnings."""
        self.file = file
        self.warnings: list[MapWarning] = []
        self._unknown: set[str] = set()

    # Where

    def error(self, element: Element, message: str) -> MapContentError:
        """Return an error that says where `element` is."""
        owner = _owner(element)
        inside = f"{owner.tag} {owner.get('id', '?')!r:.80}, " if owner is not None else ""
        return MapContentError(
            f"{self.file}: {inside}<{element.tag!s:.80}>, line {element.sourceline}: {message}"
        )

    def warn(self, kind: WarningKind, element: Element, message: str, s_m: float | None = None) -> None:
        """Note a tolerated defect."""
        owner = _owner(element)
        owner_id = owner.get("id", "")[:80] if owner is not None else ""
        self.warnings.append(
            MapWarning(owner_id, str(element.tag)[:80], f"line {element.sourceline}: {message}", kind, s_m)
        )

    def each(self, read: Callable[[Element], _Record], elements: Iterable[Element]) -> tuple[_Record, ...]:
        """Return the records of `elements`; one that cannot be read is left out with a warning."""
        records: list[_Record] = []
        for element in elements:
            try:
                records.append(read(element))
            except MapContentError as error:
                message = f"{str(error).removeprefix(self.file + ': ')}; left out"
                self.warn(WarningKind.LEFT_OUT, element, message)
        return tuple(records)

    # Single values

    def text(self, element: Element, name: str) -> str:
        """Return a required attribute."""
        value: str | None = element.get(name)
        if value is None:
            raise self.error(element, f"attribute {name!r} is missing; add it")
        return value

    @overload
    def number(self, element: Element, name: str) -> float: ...
    @overload
    def number(self, element: Element, name: str, default: float) -> float: ...
    @overload
    def number(self, element: Element, name: str, default: None) -> float | None: ...
    def number(
        self, element: Element, name: str, default: float | Literal["required"] | None = "required"
    ) -> float | None:
        """Return an attribute as a finite number, or `default` when it is absent."""
        text = element.get(name)
        if text is None:
            if default == "required":
                raise self.error(element, f"attribute {name!r} is missing; add it")
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if abs(value) <= MAX_NUMBER:
            return value
        if math.isfinite(value):
            raise self.error(
                element, f"attribute {name!r} is {text!r:.40}, expected a value within {MAX_NUMBER:g}"
            )
        raise self.error(element, f"attribute {name!r} is {text!r:.40}, expected a finite number")

    @overload
    def integer(self, element: Element, name: str) -> int: ...
    @overload
    def integer(self, element: Element, name: str, default: None) -> int | None: ...
    def integer(
        self, element: Element, name: str, default: Literal["required"] | None = "required"
    ) -> int | None:
        """Return an attribute as an integer, or `default` when it is absent."""
        text = element.get(name)
        if (known := SMALL_INTEGERS.get(text or "")) is not None:
            return known
        if text is None:
            if default is None:
                return None
            raise self.error(element, f"attribute {name!r} is missing; add it")
        try:
            # Python refuses integers of thousands of digits in its own way.
            value = int(text) if len(text) <= 40 else MAX_INTEGER + 1
        except ValueError:
            raise self.error(element, f"attribute {name!r} is {text!r:.40}, expected an integer") from None
        if abs(value) > MAX_INTEGER:
            raise self.error(
                element, f"attribute {name!r} is {text!r:.40}, expected a value within {MAX_INTEGER}"
            )
        return value

    def flag(self, element: Element, name: str, default: bool = False) -> bool:
        """Return a yes-or-no attribute."""
        text = element.get(name)
        return default if text is None else text in ("true", "1", "yes")

    def length_m(self, element: Element) -> float:
        """Return the attribute length, metres."""
        value = self.number(element, "length")
        if not 0.0 <= value <= MAX_LENGTH_M:
            raise self.error(element, f"attribute 'length' is {value:g}, expected 0 to {MAX_LENGTH_M:g} m")
        return value

    def junction_id(self, element: Element) -> str | None:
        """Return the junction that a road is part of, or None."""
        junction = element.get("junction", "-1")
        return None if junction in ("-1", "") else junction

    def rule(self, element: Element) -> TrafficRule:
        """Return the traffic rule of a road."""
        value = element.get("rule", "RHT")
        if value not in ("RHT", "LHT"):
            raise self.error(element, f"attribute 'rule' is {value!r:.40}, expected 'RHT' or 'LHT'")
        return "LHT" if value == "LHT" else "RHT"

    def contact_point(self, element: Element) -> ContactPoint | None:
        """Return the attribute contactPoint, or None when it is absent."""
        value = element.get("contactPoint")
        if value == "start":
            return "start"
        if value == "end":
            return "end"
        if value not in (None, "", "none"):
            raise self.error(element, f"attribute 'contactPoint' is {value!r:.40}, expected 'start' or 'end'")
        return None

    def speed_mps(self, element: Element) -> float | None:
        """Return the limit of a speed element; None for ``no limit`` and ``undefined``."""
        text = self.text(element, "max").strip()
        if text in ("no limit", "undefined", "unlimited"):
            return None
        unit = element.get("unit", "m/s") or "m/s"
        if unit not in MPS_PER_UNIT:
            raise self.error(
                element, f"attribute 'unit' is {unit!r:.40}, expected one of {', '.join(MPS_PER_UNIT)}"
            )
        value = self.number(element, "max")
        if value < 0.0:
            self.warn(WarningKind.UNKNOWN_VALUE, element, f"negative speed {value}; read as no limit")
            return None
        return value * MPS_PER_UNIT[unit]

    def validity(self, element: Element) -> tuple[LaneRange, ...]:
        """Return the lanes that an element applies to."""
        return tuple(
            LaneRange(self.integer(child, "fromLane"), self.integer(child, "toLane"))
            for child in children(element, "validity")
        )

    # Tables and the rest

    def cubics(self, records: list[Element], names: tuple[str, ...] = CUBIC) -> FloatArray:
        """Return a piecewise cubic, ascending in s."""
        return self.sorted_table(records, names) if records else NO_CUBICS

    def sorted_table(self, records: list[Element], names: tuple[str, ...], keys: int = 1) -> FloatArray:
        """Return one row of numbers per record, ascending in the first `keys` columns."""
        rows = [[self.number(record, name) for name in names] for record in records]
        ordered = sorted(rows, key=lambda row: row[:keys])
        if ordered != rows:
            self.warn(WarningKind.ORDER, records[0], f"records are not in ascending {names[0]}; sorted")
        return read_only(np.array(ordered).reshape(-1, len(names)))

    def extra(self, elements: Iterable[Element]) -> tuple[str, ...]:
        """Return the XML text of elements without record; unknown ones are warned about, once per name."""
        texts: list[str] = []
        for element in elements:
            tag = str(element.tag)
            if tag not in _KEPT_AS_THEY_ARE and tag not in self._unknown:
                self._unknown.add(tag)
                self.warn(
                    WarningKind.UNKNOWN_ELEMENT, element, f"<{tag:.80}> is kept, but has no meaning here"
                )
            texts.append(xml_of(element))
        return tuple(texts)


def xml_of(element: Element) -> str:
    """Return the XML text of an element."""
    return etree.tostring(element, encoding="unicode", with_tail=False)


def children(element: Element | None, tag: str) -> list[Element]:
    """Return the children of a name; quicker than lxml's own search for it."""
    return [] if element is None else [child for child in element if child.tag == tag]


def first(element: Element | None, tag: str) -> Element | None:
    """Return the first child of a name, or None."""
    if element is not None:
        for child in element:
            if child.tag == tag:
                return child
    return None


def others(element: Element | None, *tags: str) -> list[Element]:
    """Return the children of any other name."""
    return [] if element is None else [child for child in element if child.tag not in tags]


def other_attributes(element: Element, known: Collection[str]) -> tuple[tuple[str, str], ...]:
    """Return the attributes of any other name, with their values."""
    return tuple((str(name), str(value)) for name, value in element.items() if name not in known)


def _owner(element: Element) -> Element | None:
    """Return the road or junction that an element belongs to."""
    if element.tag in ("road", "junction"):
        return element
    return next(element.iterancestors("road", "junction"), None)
