"""Attributes of elements as checked values, and what is tolerated on the way."""

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import Any, NamedTuple, TypeAlias, TypeVar

import numpy as np
from lxml import etree

from opendrive.arrays import FloatArray, read_only
from opendrive.errors import MapContentError, MapWarning, WarningKind
from opendrive.model import Deferred, RoadMark

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

_KEPT_AS_THEY_ARE = {
    "userData", "dataQuality", "surface", "license", "defaultRegulations", "semantics", "boundary",
    "elevationGrid", "planView", "neighbor", "skeleton",
}  # fmt: skip


SMALL_INTEGERS = {str(value): value for value in range(-30, 31)}
"""By their text: ids of lanes are converted thousands of times."""


Convert: TypeAlias = Callable[["Values", Element, str, str], Any]
"""Makes a value of an element's attribute, given by name and text; raises `MapContentError`."""


class Names(NamedTuple):
    """Names of the children and attributes of an element, and what can be warned of in them.

    Attributes:
        plain: children that are read at once.
        late: those that are read when first asked for.
        parts: by those in which other children stand, the names of these.
        single: those of which only the first is read.
        inner: by children that are read late, the names in them, where these say everything.
        apart: children of which only one kind may be there.
        numbers: attributes that have to be numbers.
        checks: by other attributes that cannot be any text, what refuses them.
        required: attributes that have to be there.
        is_complete: whether reading an element that keeps to these names gives no warning.
    """

    plain: Collection[object] = ()
    late: Collection[object] = ()
    parts: Mapping[Any, Collection[object]] = {}
    single: Collection[object] = ()
    inner: Mapping[Any, "Names"] = {}
    apart: Collection[object] = ()
    numbers: Collection[object] = ()
    checks: Mapping[Any, Convert] = {}
    required: Collection[str] = ()
    is_complete: bool = True


class Values:
    """Reads values out of elements; collects warnings.

    Attributes:
        file: name of the file, for messages.
        warnings: what was tolerated so far.
        left_out: elements that are kept as they are, since they say too little to be read.
        road_marks: road marks that were read, by their attributes.
        details: what of roads and lanes is read when first asked for, by their element.
        sound: names, attributes and content of children of lanes that gave no warning.
        numbers: texts of numbers that can be meant.
    """

    def __init__(self, file: str) -> None:
        """Start without warnings."""
        self.file = file
        self.warnings: list[MapWarning] = []
        self.left_out: set[Element] = set()
        self.road_marks: dict[tuple[tuple[str | bytes, str | bytes], ...], RoadMark] = {}
        self.details: dict[Element, Deferred[Any]] = {}
        self.sound: set[object] = set()
        self.numbers: set[str] = set()
        self._unknown: set[object] = set()
        self._is_quiet = False

    # Where

    @contextmanager
    def quietly(self) -> Iterator[None]:
        """Read again what has been warned of already."""
        self._is_quiet = True
        try:
            yield
        finally:
            self._is_quiet = False

    def error(self, element: Element, message: str) -> MapContentError:
        """Return an error that says where `element` is."""
        owner = _owner(element)
        inside = f"{owner.tag} {owner.get('id', '?')!r:.80}, " if owner is not None else ""
        return MapContentError(
            f"{self.file}: {inside}<{element.tag!s:.80}>, line {element.sourceline}: {message}"
        )

    def warn(
        self,
        kind: WarningKind,
        element: Element,
        message: str,
        s_m: float | None = None,
        rule: str = "",
        amount_m: float | None = None,
    ) -> None:
        """Note a tolerated defect; where it lies is that of its element, unless `s_m` is given."""
        if self._is_quiet:
            return
        owner = _owner(element)
        owner_id = owner.get("id", "")[:80] if owner is not None else ""
        at_m, lane_id = _place(element)
        self.warnings.append(
            MapWarning(
                owner_id,
                str(element.tag)[:80],
                f"line {element.sourceline}: {message}",
                kind,
                at_m if s_m is None else s_m,
                lane_id,
                amount_m,
                "" if amount_m is None else "m",
                rule,
            )
        )

    def each(
        self, read: Callable[["Values", Element], _Record], elements: Iterable[Element]
    ) -> tuple[_Record, ...]:
        """Return the records of `elements`; one that cannot be read is left out with a warning."""
        records: list[_Record] = []
        for element in elements:
            try:
                records.append(read(self, element))
            except MapContentError as error:
                message = f"{str(error).removeprefix(self.file + ': ')}; left out"
                self.warn(WarningKind.LEFT_OUT, element, message)
        return tuple(records)

    def or_absent(self, read: Callable[[], _Record], element: Element, absent: object) -> Any:
        """Return what is read of an element; `absent`, with a warning, if it cannot be read."""
        try:
            return read()
        except MapContentError as error:
            message = f"{str(error).partition(f'line {element.sourceline}: ')[2] or error}; read as absent"
            self.warn(WarningKind.UNKNOWN_VALUE, element, message)
            return absent

    def repeated(self, element: Element, tags: Collection[str]) -> list[Element]:
        """Return the children beyond the first of each of some names, and warn of those nobody left out."""
        seen: set[object] = set()
        again: list[Element] = []
        for member in element:
            if member.tag in tags and member.tag in seen:
                again.append(member)
                if member not in self.left_out:
                    message = f"a second <{member.tag!s:.80}>; the first is read, this one is kept as text"
                    self.warn(WarningKind.IGNORED, member, message)
                    self.left_out.add(member)
            seen.add(member.tag)
        return again

    # Single values

    def missing(self, element: Element, name: str) -> MapContentError:
        """Return the error of an attribute that has to be there."""
        return self.error(element, f"attribute {name!r} is missing; add it")

    def unexpected(self, element: Element, name: str, text: str, expected: str) -> MapContentError:
        """Return the error of an attribute that cannot be what it is."""
        return self.error(element, f"attribute {name!r} is {text!r:.40}, expected {expected}")

    def text(self, element: Element, name: str) -> str:
        """Return a required attribute."""
        value: str | None = element.get(name)
        if value is None:
            raise self.missing(element, name)
        return value

    def number(self, element: Element, name: str) -> float:
        """Return a required attribute as a finite number."""
        return self.to_number(element, name, self.text(element, name))

    def is_number(self, text: str) -> bool:
        """Return whether a text is a finite number that can be meant."""
        if text in self.numbers:
            return True
        if number_of(text) is None:
            return False
        self.numbers.add(text)
        return True

    def content(self, element: Element) -> object:
        """Return a key that elements share whose content is equal but for where they start."""
        items: list[object] = [*element.items()]
        start = element.get("sOffset")
        if start is not None and (start in self.numbers or self.is_number(start)):
            items.remove(("sOffset", start))
        items.append(element.tag)
        if len(element):
            items += [self.content(child) for child in element]
        return tuple(items)

    def is_plain(self, element: Element, names: "Names") -> bool:
        """Return whether an element has nothing that can be warned of once it is read."""
        plain, late, parts, single, inner, apart = names[:6]
        seen: list[object] = []
        for child in element:
            tag = child.tag
            if tag in single:
                if tag in seen:
                    return False
                seen.append(tag)
            if tag in plain:
                continue
            if tag in parts:
                read = parts[tag]
                for member in child:
                    if member.tag not in read:
                        if not self.is_known(member.tag):
                            return False
                    elif tag in late and not self.is_sound(member, inner.get(member.tag)):
                        return False
            elif tag in late:
                if not self.is_sound(child, inner.get(tag)):
                    return False
            elif not self.is_known(tag):
                return False
        return not apart or len({child.tag for child in element if child.tag in apart}) < 2

    def is_sound(self, element: Element, names: Names | None) -> bool:
        """Return whether an element that was not read has nothing that can be warned of.

        Args:
            element: the element.
            names: what may stand in it; None where only what was read of others can tell.
        """
        if names is None:
            return self.content(element) in self.sound
        numbers, checks = names.numbers, names.checks
        for name, text in element.items():
            if name in numbers:
                if number_of(text) is None:
                    return False
            elif name in checks:
                try:
                    checks[name](self, element, str(name), str(text))
                except MapContentError:
                    return False
        if any(element.get(name) is None for name in names.required):
            return False
        return not len(element) or self.is_plain(element, names)

    def to_number(self, element: Element, name: str, text: str) -> float:
        """Return the text of an attribute as a finite number."""
        value = number_of(text)
        if value is not None:
            return value
        try:
            is_finite = math.isfinite(float(text))
        except ValueError:
            is_finite = False
        expected = f"a value within {MAX_NUMBER:g}" if is_finite else "a finite number"
        raise self.unexpected(element, name, text, expected)

    def to_integer(self, element: Element, name: str, text: str) -> int:
        """Return the text of an attribute as an integer."""
        if (known := SMALL_INTEGERS.get(text)) is not None:
            return known
        try:
            # Python refuses integers of thousands of digits in its own way.
            value = int(text) if len(text) <= 40 else MAX_INTEGER + 1
        except ValueError:
            raise self.unexpected(element, name, text, "an integer") from None
        if abs(value) > MAX_INTEGER:
            raise self.unexpected(element, name, text, f"a value within {MAX_INTEGER}")
        return value

    def to_length_m(self, element: Element, name: str, text: str) -> float:
        """Return the text of an attribute as a length that a road can have, metres."""
        value = self.to_number(element, name, text)
        if not 0.0 <= value <= MAX_LENGTH_M:
            message = f"attribute {name!r} is {value:g}, expected 0 to {MAX_LENGTH_M:g} m"
            raise self.error(element, message)
        return value

    def speed_mps(self, element: Element) -> float | None:
        """Return the limit of a speed element; None for ``no limit`` and ``undefined``."""
        text = self.text(element, "max").strip()
        if text in ("no limit", "undefined", "unlimited"):
            return None
        unit = element.get("unit", "m/s") or "m/s"
        if unit not in MPS_PER_UNIT:
            raise self.unexpected(element, "unit", unit, f"one of {', '.join(MPS_PER_UNIT)}")
        value = self.to_number(element, "max", text)
        if value < 0.0:
            self.warn(WarningKind.UNKNOWN_VALUE, element, f"negative speed {value}; read as no limit")
            return None
        return value * MPS_PER_UNIT[unit]

    @staticmethod
    def write_speed(element: Element, speed_mps: float | None) -> None:
        """Write the limit of a speed element, in m/s."""
        element.set("max", "no limit" if speed_mps is None else repr(speed_mps))
        element.set("unit", "m/s")

    # Tables and the rest

    def table(self, records: list[Element], names: tuple[str, ...], keys: int = 1) -> FloatArray:
        """Return one row of numbers per record, ascending in the first `keys` columns."""
        if not records:
            return empty_table(len(names))
        rows = [[self.number(record, name) for name in names] for record in records]
        ordered = sorted(rows, key=lambda row: row[:keys])
        if ordered != rows:
            self.warn(WarningKind.ORDER, records[0], f"records are not in ascending {names[0]}; sorted")
        return read_only(np.array(ordered))

    def is_known(self, tag: object) -> bool:
        """Return whether elements of a name that nothing reads are kept without a further warning."""
        return tag in _KEPT_AS_THEY_ARE or tag in self._unknown

    def extra(self, elements: Iterable[Element]) -> tuple[str, ...]:
        """Return the XML text of elements without record; unknown ones are warned about, once per name."""
        texts: list[str] = []
        for element in elements:
            tag = str(element.tag)
            if not (self._is_quiet or self.is_known(tag) or element in self.left_out):
                self._unknown.add(tag)
                self.warn(
                    WarningKind.UNKNOWN_ELEMENT, element, f"<{tag:.80}> is kept, but has no meaning here"
                )
            texts.append(etree.tostring(element, encoding="unicode", with_tail=False))
        return tuple(texts)


def number_of(text: Any) -> float | None:
    """Return a text as a number; None if it is none, or none that can be meant."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if -MAX_NUMBER <= value <= MAX_NUMBER else None


@cache
def empty_table(columns: int) -> FloatArray:
    """Return a table without rows, the same one each time."""
    return read_only(np.empty((0, columns)))


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


def children_but(element: Element | None, tags: Collection[str]) -> list[Element]:
    """Return the children of any other name."""
    return [] if element is None else [child for child in element if child.tag not in tags]


def _place(element: Element) -> tuple[float | None, int | None]:
    """Return s and lane id of what an element stands in; None where they have no meaning or no number."""
    lane_id: int | None = None
    offset_m = 0.0
    for outer in (element, *element.iterancestors()):
        if outer.tag == "lane":
            text = outer.get("id", "")
            lane_id = int(text) if len(text) < 8 and text.lstrip("+-").isdecimal() else None
        if outer.tag in ("road", "junction"):
            break
        try:
            if outer.get("sOffset") is not None:
                offset_m = float(outer.get("sOffset", ""))
            elif outer.get("s") is not None:
                s_m = float(outer.get("s", "")) + offset_m
                return (s_m if abs(s_m) <= MAX_NUMBER else None), lane_id
        except ValueError:
            continue
    return None, lane_id


def _owner(element: Element) -> Element | None:
    """Return the road or junction that an element belongs to."""
    if element.tag in ("road", "junction"):
        return element
    return next(element.iterancestors("road", "junction"), None)
