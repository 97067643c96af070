"""Kinds of fields: attributes as texts, numbers and flags; children as records, rows and tables."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from lxml import etree

from opendrive.arrays import FloatArray
from opendrive.xml.tables import REQUIRED, Attribute, Field, Required, Steps, Table, attribute, names_of
from opendrive.xml.values import Convert, Element, Names, Values, children, children_but, empty_table, first

# Attributes


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

    steps = Steps(items)
    return Field(
        lambda values, element: tuple(steps.read(values, element)),
        write,
        tuple(name for item in items for name in item.attributes),
        names=names_of(items),
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

    return Field(read, write, tags=(tag,), is_single=True, inner=_inner(tag, item))


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

    return Field(
        read,
        write,
        tags=(within or tag,),
        absent=(),
        leftovers=leftovers if kept else None,
        inner=_inner(tag, item, within),
    )


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


def _inner(tag: str, item: "Field[Any] | Table[Any]", within: str = "") -> dict[str, Names]:
    """Return, by child, what may stand in it, if that is known."""
    if item.names is None or not item.names.is_complete:
        return {}
    names = {tag: item.names}
    return {within: Names(late={tag}, inner=names)} if within else names
