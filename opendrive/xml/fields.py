"""Tables of fields: how the fields of a record stand in a file, for reading and for writing alike.

A `Field` reads one value out of an element and writes it into one. A `Table` names the fields of a record, in
the order in which they are written. They are read in the order of the record's class, so that of two faults
always the same one is reported.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from functools import partial
from typing import Any, Generic, TypeAlias, TypeVar

from lxml import etree

from opendrive.arrays import FloatArray
from opendrive.model import Deferred
from opendrive.xml.values import Element, Names, Values, children, children_but, empty_table, first


class Required(Enum):
    """Stands for the default of an attribute that has to be there."""

    REQUIRED = "required"


REQUIRED = Required.REQUIRED
Convert: TypeAlias = Callable[[Values, Element, str, str], Any]
"""Makes a value of an element's attribute, given by name and text; raises `MapContentError`."""

_NO_TAGS: frozenset[str] = frozenset()

_Value = TypeVar("_Value")
_Record = TypeVar("_Record")


@dataclass(frozen=True, slots=True)
class Field(Generic[_Value]):
    """One field of a record.

    Attributes:
        read: returns the value; raises `MapContentError`.
        write: writes the value.
        attributes: names of the attributes that it is read from.
        tags: names of the children that it is read from.
        part: child that attributes and children stand in; empty for the record's own element.
        absent: value where those children are missing; None if the field has to be read all the same.
        leftovers: returns the elements inside the children that are kept, but not read.
        is_single: whether only the first of these children is read.
    """

    read: Callable[[Values, Element], _Value]
    write: Callable[[Element, _Value], None]
    attributes: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    part: str = ""
    absent: _Value | None = None
    leftovers: Callable[[Values, Element], list[Element]] | None = None
    is_single: bool = False

    @property
    def own_tags(self) -> tuple[str, ...]:
        """Names of the children of the record's own element."""
        return (self.part,) if self.part else self.tags

    def then(self, change: Callable[[_Value], _Value]) -> "Field[_Value]":
        """Return the field with what is read put through a function."""
        return replace(self, read=lambda values, element: change(self.read(values, element)))

    def lenient(self) -> "Field[_Value]":
        """Return the field with a value that cannot be read warned about, and read as absent.

        For what says nothing about where a road or lane lies.
        """

        def read(values: Values, element: Element) -> _Value:
            value: _Value = values.or_absent(lambda: self.read(values, element), element, self.absent)
            return value

        return replace(self, read=read)

    def inside(self, part: str, always: bool = False) -> "Field[Any]":
        """Return the field for attributes and children that stand in a child of the record's element.

        Args:
            part: name of that child; the first one of that name is read.
            always: write the child even if there is nothing in it.
        """

        def read(values: Values, element: Element) -> _Value | None:
            inner = first(element, part)
            return self.absent if inner is None else self.read(values, inner)

        def write(element: Element, value: _Value) -> None:
            if always or (value is not None and value != self.absent):
                inner = first(element, part)
                self.write(etree.SubElement(element, part) if inner is None else inner, value)

        return Field(read, write, self.attributes, self.tags, part, self.absent, is_single=True)


@dataclass(frozen=True, slots=True)
class Attribute(Field[Any]):
    """A field that is read from one attribute of the record's own element.

    Attributes:
        default: what an absent attribute means; `REQUIRED` if it has to be there.
        convert: makes the value of the text; None for the text itself.
    """

    default: object = REQUIRED
    convert: Convert | None = None

    def lenient(self) -> "Attribute":
        """Return the attribute with a value that cannot be meant warned about, and read as absent."""
        convert, default = self.convert, self.default
        assert convert is not None
        assert default is not REQUIRED

        def convert_or_warn(values: Values, element: Element, name: str, text: str) -> Any:
            return values.or_absent(lambda: convert(values, element, name, text), element, default)

        return replace(
            attribute(self.attributes[0], default, convert_or_warn, self.write), absent=self.absent
        )


class _Steps:
    """The reading of several fields of an element, with few calls: there are thousands of elements."""

    def __init__(self, columns: Iterable[Field[Any]]) -> None:
        self._steps = [
            (column.attributes[0], column.default, column.convert, column.read, ())
            if isinstance(column, Attribute)
            else ("", column.absent, None, column.read, () if column.absent is None else column.own_tags)
            for column in columns
        ]

    def read(self, values: Values, element: Element) -> list[Any]:
        """Return the values of the fields."""
        result: list[Any] = []
        tags = {child.tag for child in element} if len(element) else _NO_TAGS
        for name, absent, convert, read, read_tags in self._steps:
            if name:
                text = element.get(name)
                if text is None:
                    if absent is REQUIRED:
                        raise values.missing(element, name)
                    result.append(absent)
                else:
                    result.append(text if convert is None else convert(values, element, name, text))
            elif read_tags and tags.isdisjoint(read_tags):
                result.append(absent)
            else:
                result.append(read(values, element))
        return result


class Table(Generic[_Record]):
    """The fields of a record, by name.

    Attributes:
        tags: names of the children that are read.
        names: the same, by how they are read.
    """

    def __init__(
        self,
        record: Callable[..., _Record],
        details: Callable[..., object] | None = None,
        check: Callable[[Values, Element, _Record], object] | None = None,
        **columns: Field[Any],
    ) -> None:
        """Put together the fields of a record, in the order in which they are written.

        Args:
            record: class of the record.
            details: class of what is read when first asked for: the record's last field, `details`.
            check: called with each record that was read; warns of what is odd, refuses what is impossible.
            columns: the fields of the record and of its details, by name.
        """
        eager = [name for name in _field_names(record) if name != "details"]
        late = _field_names(details)
        assert columns.keys() == {*eager, *late}, f"{record}: {columns.keys() ^ {*eager, *late}}"
        self._record, self._details, self._check = record, details, check
        ordered = [columns[name] for name in (*eager, *late)]
        self._attributes = {name for column in ordered if not column.part for name in column.attributes}
        self.tags = tuple(dict.fromkeys(tag for column in ordered for tag in column.own_tags))
        self._parts = {
            part: tuple(tag for column in ordered if column.part == part for tag in column.tags)
            for part in dict.fromkeys(column.part for column in ordered if column.part)
        }
        self._single = {tag for column in ordered if column.is_single for tag in column.own_tags}
        self._leftovers = [column.leftovers for column in ordered if column.leftovers is not None]
        bound = {name: self._bound(column) for name, column in columns.items()}
        self._steps = _Steps(bound[name] for name in eager)
        self._late_steps = _Steps(bound[name] for name in late)
        self._writes = [(name, column.write) for name, column in bound.items()]
        # An element with nothing but these children has no details.
        self._plain_tags = {tag for name in eager if not columns[name].part for tag in columns[name].tags}
        late_tags = {tag for name in late for tag in columns[name].own_tags}
        self.names = Names(self._plain_tags, late_tags, self._parts, self._single)
        self._no_details = None if details is None else Deferred.of(details())

    def read(self, values: Values, element: Element) -> _Record:
        """Return the record of an element.

        Raises:
            MapContentError: a value is missing or impossible.
        """
        arguments = self._steps.read(values, element)
        if self._details is not None:
            arguments.append(self._deferred(values, element))
        record = self._record(*arguments)
        if self._check is not None:
            self._check(values, element, record)
        return record

    def write(self, element: Element, record: _Record) -> None:
        """Write a record into its element."""
        for name, write in self._writes:
            write(element, getattr(record, name))

    def _deferred(self, values: Values, element: Element) -> Deferred[object] | None:
        if all(child.tag in self._plain_tags for child in element) and self._attributes.issuperset(
            element.attrib
        ):
            return self._no_details
        return self.details(values, element)

    def details(self, values: Values, element: Element) -> Deferred[Any]:
        """Return the details of an element, the same ones that its record has."""
        known = values.details.get(element)
        if known is None:
            known = values.details[element] = Deferred(partial(self._read_details, values, element))
        return known

    def _read_details(self, values: Values, element: Element) -> object:
        assert self._details is not None
        return self._details(*self._late_steps.read(values, element))

    def _bound(self, column: Field[Any]) -> Field[Any]:
        """Return a column that knows which children and attributes the others read."""
        if column is REST:
            return replace(column, read=lambda values, element: values.extra(self._rest(values, element)))
        if column is OTHER_ATTRIBUTES:
            return replace(column, read=self._other_attributes)
        return column

    def _rest(self, values: Values, element: Element) -> list[Element]:
        """Return the elements that no field reads: children, and those inside the parts."""
        if not len(element):
            return []
        elements = children_but(element, self.tags)
        elements += values.repeated(element, self._single) if self._single else []
        for part, tags in self._parts.items():
            elements += children_but(first(element, part), tags)
        for leftovers in self._leftovers:
            elements += leftovers(values, element)
        return elements

    def _other_attributes(self, values: Values, element: Element) -> tuple[tuple[str, str], ...]:
        return tuple((str(n), str(value)) for n, value in element.items() if n not in self._attributes)


def _field_names(record: Callable[..., object] | None) -> list[str]:
    return [each.name for each in fields(record)] if is_dataclass(record) else []


# Attributes


def attribute(
    name: str, default: object, convert: Convert | None, write: Callable[[Element, Any], None]
) -> Attribute:
    """Return the field of an attribute; see `Attribute`."""

    def read(values: Values, element: Element) -> object:
        value = element.get(name)
        if value is None:
            if default is REQUIRED:
                raise values.missing(element, name)
            return default
        return value if convert is None else convert(values, element, name, value)

    absent = None if default is REQUIRED else default
    return Attribute(read, write, (name,), absent=absent, default=default, convert=convert)


def text(
    name: str,
    default: str | Required | None = "",
    omitted: str | None = None,
    convert: Convert | None = None,
) -> Attribute:
    """Return the field of a text.

    Args:
        name: name of the attribute.
        default: what an absent attribute means; an empty text is left out in writing if it means the same.
        omitted: another value that is left out.
        convert: checks the text.
    """
    unwritten = (None, omitted, "") if default == "" else (None, omitted)

    def write(element: Element, value: str | None) -> None:
        if value not in unwritten:
            element.set(name, value or "")

    # Where the part that it stands in is missing, a required text is empty.
    return replace(attribute(name, default, convert, write), absent="" if default is REQUIRED else default)


def number(
    name: str, default: float | Required | None = REQUIRED, convert: Convert = Values.to_number
) -> Attribute:
    """Return the field of a number; None is left out in writing."""

    def write(element: Element, value: float | None) -> None:
        if value is not None:
            element.set(name, repr(value))

    return attribute(name, default, convert, write)


def integer(name: str, default: int | Required | None = REQUIRED) -> Attribute:
    """Return the field of an integer; None is left out in writing."""
    return number(name, default, Values.to_integer)


LENGTH = number("length", convert=Values.to_length_m)
"""A length that a road can have."""


def flag(
    name: str,
    default: bool = False,
    yes: str = "true",
    no: str = "",
    true: Sequence[str] = ("true", "1", "yes"),
) -> Attribute:
    """Return the field of a yes-or-no attribute.

    Args:
        name: name of the attribute.
        default: what an absent attribute means.
        yes: what is written for true.
        no: what is written for false; nothing if it is empty.
        true: what is read as true.
    """

    def write(element: Element, value: bool) -> None:
        if word := yes if value else no:
            element.set(name, word)

    return attribute(name, default, lambda values, element, name, text: text in true, write)


def row(*items: Field[Any], order: Sequence[int] = ()) -> Field[tuple[Any, ...]]:
    """Return the field of several values as a tuple.

    Args:
        items: fields of the values.
        order: in which they are written, if not in this order.
    """

    def write(element: Element, value: tuple[Any, ...]) -> None:
        for k in order or range(len(items)):
            items[k].write(element, value[k])

    steps = _Steps(items)
    return Field(
        lambda values, element: tuple(steps.read(values, element)),
        write,
        tuple(name for item in items for name in item.attributes),
    )


def numbers(*attributes: str) -> Field[tuple[Any, ...]]:
    """Return the field of several required numbers as a tuple."""
    return row(*map(number, attributes))


def constant(value: object) -> Field[Any]:
    """Return the field of a value that does not stand in the file."""
    return Field(lambda values, element: value, lambda element, value: None)


# Children


def child(tag: str, item: "Field[Any] | Table[Any]", required: bool = False) -> Field[Any]:
    """Return the field of the first child of a name; None if there is none and it is not required."""

    def read(values: Values, element: Element) -> object:
        inner = first(element, tag)
        if inner is None and required:
            raise values.error(element, f"<{tag}> is missing; add it")
        return None if inner is None else item.read(values, inner)

    def write(element: Element, value: object) -> None:
        if value is not None:
            item.write(etree.SubElement(element, tag), value)

    return Field(read, write, tags=(tag,), is_single=True)


def children_of(
    tag: str, item: "Field[Any] | Table[Any]", within: str = "", kept: bool = False
) -> Field[tuple[Any, ...]]:
    """Return the field of all children of a name.

    Args:
        tag: name of the children.
        item: how each is read and written.
        within: name of the children that they stand in, each of which is read; empty if they stand directly.
        kept: keep what is not read of them, and of what they stand in.
    """
    read_item = item.read

    def groups(element: Element) -> list[Element]:
        return children(element, within) if within else [element]

    def read(values: Values, element: Element) -> tuple[Any, ...]:
        return tuple(
            [read_item(values, each) for group in groups(element) for each in group if each.tag == tag]
        )

    def write(element: Element, records: tuple[Any, ...]) -> None:
        parent = etree.SubElement(element, within) if within and records else element
        for record in records:
            item.write(etree.SubElement(parent, tag), record)

    def leftovers(values: Values, element: Element) -> list[Element]:
        unread: list[Element] = []
        for group in groups(element):
            unread += children_but(group, (tag,)) if within else []
            for member in children(group, tag):
                unread += children_but(member, item.tags)
        return unread

    return Field(read, write, tags=(within or tag,), absent=(), leftovers=leftovers if kept else None)


def each(
    tag: str, item: "Field[Any] | Table[Any]", within: str = "", kept: bool = False
) -> Field[tuple[Any, ...]]:
    """Return the field of all children of a name; one that cannot be read is left out with a warning.

    The arguments are those of `children_of`.
    """

    def read(values: Values, element: Element) -> tuple[Any, ...]:
        groups = children(element, within) if within else [element]
        return values.each(item.read, [member for group in groups for member in children(group, tag)])

    return replace(children_of(tag, item, within, kept), read=read)


def table_of(tag: str, attributes: tuple[str, ...], keys: int = 1) -> Field[FloatArray]:
    """Return the field of rows of numbers, each a child of its own; see `Values.table`."""
    return Field(
        lambda values, element: values.table(children(element, tag), attributes, keys),
        partial(write_rows, tag, attributes),
        tags=(tag,),
        absent=empty_table(len(attributes)),
    )


def write_rows(
    tag: str, attributes: tuple[str, ...], element: Element, rows: FloatArray, **more: str
) -> None:
    """Write rows of numbers, each as a child of its own."""
    for values in rows.tolist():
        numbers_of = {name: repr(value) for name, value in zip(attributes, values, strict=True)}
        etree.SubElement(element, tag, more | numbers_of)


# The rest


def _no_reading(values: Values, element: Element) -> Any:
    raise AssertionError("a table reads it; see Table")


def _write_rest(element: Element, texts: tuple[str, ...]) -> None:
    for xml in texts:
        element.append(etree.fromstring(xml))


def _write_other_attributes(element: Element, attributes: tuple[tuple[str, str], ...]) -> None:
    for name, value in attributes:
        element.set(name, value)


REST: Field[tuple[str, ...]] = Field(_no_reading, _write_rest)
"""The XML text of children that no other field of the table reads."""

OTHER_ATTRIBUTES: Field[tuple[tuple[str, str], ...]] = Field(_no_reading, _write_other_attributes)
"""The attributes that no other field of the table reads, with their values."""
