"""XML elements with their scope: attributes resolved, unknown content refused, places named.

The parser expands no entities and opens no network connection.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from datetime import UTC, datetime
from functools import cache, lru_cache
from pathlib import Path
from typing import TypeAlias

from lxml import etree

from scenarios.openscenario.errors import (
    ContentError,
    ExpressionError,
    FileReadError,
    ParameterError,
    UnsupportedError,
)
from scenarios.openscenario.expressions import Value, evaluate

Element: TypeAlias = etree._Element
Scope: TypeAlias = Mapping[str, Value]

MAX_NUMBER = 1e9
"""A greater number is refused: no quantity of a road scenario comes near it, `INF` excepted."""

TRUTH = {"true": True, "1": True, "false": False, "0": False}


def parse(path: Path) -> Element:
    """Root element of a file; an unchanged file is parsed once.

    Raises:
        FileReadError: the file cannot be opened, is not well-formed, or is not OpenSCENARIO 1.0 to 1.3.
    """
    try:
        stat = path.stat()
    except OSError as error:
        raise FileReadError(f"{path}: {error.strerror or 'cannot be opened'}") from None
    return _parse(path, stat.st_mtime_ns, stat.st_size).root()


class _Parsed:
    """A parsed file.

    lxml makes an element anew whenever it is asked for, unless somebody holds it. Those of a file that is
    read a second time, as a scenario with many variations is, are held from then on.
    """

    def __init__(self, root: Element) -> None:
        self._root = root
        self._held: list[Element] | None = None

    def root(self) -> Element:
        """The root element."""
        # the first reading leaves an empty list, the second fills it
        self._held = [] if self._held is None else self._held or list(self._root.iter())
        return self._root


MINOR = re.compile(r"[0-9]+")
"""esmini's files have 1.1+ and the like where they use something of a later version."""


@lru_cache(maxsize=256)
def _parse(path: Path, _mtime_ns: int, _size: int) -> _Parsed:
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        root = etree.fromstring(path.read_bytes(), parser)
    except OSError as error:
        raise FileReadError(f"{path}: {error.strerror or 'cannot be read'}") from None
    except etree.XMLSyntaxError as error:
        line = error.lineno or 0
        raise FileReadError(f"{path}:{line}: not well-formed XML: {error.msg.splitlines()[0]}") from None
    if root.tag != "OpenSCENARIO":
        raise FileReadError(f"{path}: the root element is <{root.tag}>, expected <OpenSCENARIO>")
    header = root.find("FileHeader")
    version = ("", "") if header is None else (header.get("revMajor", ""), header.get("revMinor", ""))
    # entries of catalogs are the same in 0.9, by which CARLA's still call themselves
    catalog = version == ("0", "9") and root.find("Catalog") is not None
    if not catalog and (version[0] != "1" or MINOR.match(version[1]) is None):
        raise FileReadError(
            f"{path}: FileHeader gives version '{version[0]}.{version[1]}'; "
            "OpenSCENARIO XML 1.0 to 1.3 is read, and later 1.x as far as it has the same elements"
        )
    return _Parsed(root)


@cache
def _names(text: str) -> dict[str, None]:
    """Names separated by blanks; the same few texts are asked for thousands of times."""
    return dict.fromkeys(text.split())


class Node:
    """One XML element and the parameters visible to it.

    Args:
        element: the element.
        file: where it comes from.
        scope: parameters by name.
    """

    __slots__ = ("element", "file", "scope")

    def __init__(self, element: Element, file: Path, scope: Scope) -> None:
        self.element, self.file, self.scope = element, file, scope

    @property
    def tag(self) -> str:
        """Name of the element."""
        return str(self.element.tag)

    @property
    def where(self) -> str:
        """File, line and element, for messages."""
        return f"{self.file}:{self.element.sourceline}: <{self.tag}>"

    def within(self, scope: Scope) -> Node:
        """The same element, seeing other parameters."""
        return Node(self.element, self.file, scope)

    def allow(self, attributes: str = "", children: str = "") -> None:
        """Refuse every attribute and child element that is not named (names separated by blanks).

        Raises:
            UnsupportedError: there is another one.
        """
        known = _names(attributes)
        names: list[str] = self.element.keys()  # type: ignore[assignment]  # never bytes
        for name in names:
            if name not in known and not name.startswith("{"):
                raise UnsupportedError(
                    f"{self.where} attribute '{name}' is not supported; "
                    f"supported: {', '.join(known) or 'none'}"
                )
        tags = _names(children)
        for child in self.element:
            if child.tag not in tags:
                kind = f"<{child.tag}>" if isinstance(child.tag, str) else f"the entity {child.text}"
                raise UnsupportedError(
                    f"{self.file}:{child.sourceline}: {kind} in <{self.tag}> is not supported; "
                    f"supported there: {', '.join(tags) or 'no element'}"
                )

    # Children

    def __iter__(self) -> Iterator[Node]:
        return (Node(child, self.file, self.scope) for child in self.element)

    def without(self, tags: str) -> Node:
        """A copy of this element that lacks some children and all attributes."""
        copy = etree.Element(self.tag)
        copy.extend([deepcopy(child) for child in self.element if child.tag not in tags.split()])
        copy.sourceline = self.element.sourceline
        return Node(copy, self.file, self.scope)

    def all(self, tag: str) -> list[Node]:
        """Children of a name."""
        return [Node(child, self.file, self.scope) for child in self.element if child.tag == tag]

    def get(self, tag: str) -> Node | None:
        """The child of a name, or None.

        Raises:
            ContentError: there are several.
        """
        children = [child for child in self.element if child.tag == tag]
        if not children:
            return None
        if len(children) > 1:
            second = Node(children[1], self.file, self.scope)
            raise ContentError(f"{second.where} stands a second time in <{self.tag}>")
        return Node(children[0], self.file, self.scope)

    def need(self, tag: str) -> Node:
        """The child of a name.

        Raises:
            ContentError: there is none, or several.
        """
        child = self.get(tag)
        if child is None:
            raise ContentError(f"{self.where} needs an element <{tag}>")
        return child

    def one_of(self, tags: str, attributes: str = "") -> Node:
        """The only child, which is one of the names (separated by blanks); refuses other attributes.

        Raises:
            ContentError: there is none, or several.
            UnsupportedError: it is another, or there are other attributes.
        """
        self.allow(attributes, tags)
        if len(self.element) != 1:
            raise ContentError(
                f"{self.where} needs one of: {', '.join(_names(tags))}; got {len(self.element)}"
            )
        return Node(self.element[0], self.file, self.scope)

    def some(self, tags: str, what: str = "") -> list[Node]:
        """All children, which are of some names (separated by blanks) and at least one.

        Args:
            tags: the names.
            what: what is needed, for the message; empty: the names.

        Raises:
            ContentError: there is none.
            UnsupportedError: one is of another name.
        """
        self.allow(children=tags)
        children = list(self)
        if not children:
            raise ContentError(f"{self.where} needs at least one {what or tags}")
        return children

    # Attributes

    def has(self, name: str) -> bool:
        """Whether an attribute is given."""
        return self.element.get(name) is not None

    def value(self, name: str, default: Value | None = None) -> Value:
        """Value of an attribute: text, or what its parameter or expression comes to.

        Raises:
            ContentError: the attribute is missing and has no default.
            ParameterError: it names an unknown parameter.
            ExpressionError: its expression has no value.
        """
        text = self.element.get(name)
        if text is None:
            if default is None:
                raise ContentError(f"{self.where} needs an attribute '{name}'")
            return default
        text = text.strip()
        if not text.startswith("$"):
            return text.replace("\\$", "$") if "\\$" in text else text
        try:
            return resolve(text, self._parameter)
        except ExpressionError as error:
            raise ExpressionError(f"{self.where} {name}: {error}") from None
        except ParameterError as error:
            raise ParameterError(f"{self.where} {name}: {error}") from None

    def _parameter(self, name: str) -> Value:
        try:
            return self.scope[name]
        except KeyError:
            raise ParameterError(f"parameter '{name}' is not declared") from None

    def text(self, name: str, default: Value | None = None) -> str:
        """Attribute as text."""
        return as_text(self.value(name, default))

    def name(self, attribute: str) -> str:
        """Attribute that names a parameter or variable, which some tools write with a `$` before it.

        Raises:
            ContentError: it is missing.
        """
        text = self.element.get(attribute)
        if text is None:
            raise ContentError(f"{self.where} needs an attribute '{attribute}'")
        return text.strip().removeprefix("$")

    def path(self, name: str) -> Path:
        """Attribute as a path, which counts from the folder of the file; also as it is written on Windows."""
        given = self.text(name)
        path = self.file.parent / given
        return path if "\\" not in given or path.exists() else self.file.parent / given.replace("\\", "/")

    def number(self, name: str, default: Value | None = None) -> float:
        """Attribute as a finite number.

        Raises:
            ContentError: it is none.
        """
        value = self.value(name, default)
        number = as_number(value)
        if number is None or abs(number) > MAX_NUMBER:
            raise ContentError(
                f"{self.where} {name}: expected a number without unit (SI units), got '{as_text(value)}'"
            )
        return number

    def date_time(self, name: str) -> float:
        """Attribute as a date and time (xsd:dateTime), in seconds since 1970; without time zone in UTC.

        Raises:
            ContentError: it is none.
        """
        text = self.text(name)
        try:
            day = datetime.fromisoformat(text.strip())
        except ValueError:
            raise ContentError(
                f"{self.where} {name}: expected a date and time such as 2026-06-01T12:30:00, got '{text}'"
            ) from None
        return (day if day.tzinfo else day.replace(tzinfo=UTC)).timestamp()

    def positive(self, name: str, default: Value | None = None, zero: bool = True) -> float:
        """Attribute as a number that is not negative (and not zero, if `zero` is false).

        Raises:
            ContentError: it is none.
        """
        number = self.number(name, default)
        if number < 0.0 or (number == 0.0 and not zero):
            raise ContentError(
                f"{self.where} {name}: expected a {'non-negative' if zero else 'positive'} number, "
                f"got {number:g}"
            )
        return number

    def integer(self, name: str, default: Value | None = None) -> int:
        """Attribute as a whole number.

        Raises:
            ContentError: it is none.
        """
        number = self.number(name, default)
        if number != round(number):
            raise ContentError(f"{self.where} {name}: expected a whole number, got {number:g}")
        return round(number)

    def boolean(self, name: str, default: Value | None = None) -> bool:
        """Attribute as true or false.

        Raises:
            ContentError: it is neither.
        """
        value = self.value(name, default)
        truth = as_truth(value)
        if truth is None:
            raise ContentError(f"{self.where} {name}: expected true or false, got '{as_text(value)}'")
        return truth

    def choice(self, name: str, options: str, default: Value | None = None) -> str:
        """Attribute as one of the options (separated by blanks).

        Raises:
            UnsupportedError: it is another.
        """
        value = self.text(name, default)
        words = _names(options)
        if value not in words:
            same = [word for word in words if word.lower() == value.lower()]
            if len(same) == 1:  # other tools write other letters in capitals
                return same[0]
            raise UnsupportedError(
                f"{self.where} {name}='{value}' is not supported; supported: {', '.join(words)}"
            )
        return value


def resolve(text: str, parameters: Callable[[str], Value]) -> Value:
    """Value of a text that begins with `$`: a parameter, or an expression in `${...}`."""
    if text.startswith("${") and text.endswith("}"):
        return evaluate(text[2:-1], parameters)
    return parameters(text[1:])


def as_text(value: Value) -> str:
    """Value as it would stand in a file."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return format(value, ".15g")
    return value


def as_truth(value: Value) -> bool | None:
    """Value as a truth value, in whatever letters it is written; None if it is none."""
    return value if isinstance(value, bool) else TRUTH.get(as_text(value).lower())


def as_number(value: Value) -> float | None:
    """Value as a finite number, or None."""
    if isinstance(value, bool):
        return None
    try:
        number = float(value)
    except ValueError:
        return None
    # Python also reads '1_000', 'nan' and 'inf'; XML Schema knows only the last two, in other spellings
    if not math.isfinite(number) or (isinstance(value, str) and "_" in value):
        return None
    return number
