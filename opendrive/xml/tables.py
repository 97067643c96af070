"""How the fields of a record stand in a file, for reading and for writing alike.

A `Field` reads one value out of an element and writes it into one. A `Table` names the fields of a record, in
the order in which they are written. They are read in the order of the record's class, so that of two faults
always the same one is reported.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import Enum
from functools import partial
from typing import Any, Generic, TypeVar

from lxml import etree

from opendrive.model import Deferred
from opendrive.xml.values import Convert, Element, Names, Values, children_but, first, number_of


class Required(Enum):
    """Stands for the default of an attribute that has to be there."""

    REQUIRED = "required"


REQUIRED = Required.REQUIRED
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
        names: what may stand in the element, where the field can be all that is read of it.
        inner: by child that it is read from, what may stand in that.
    """

    read: Callable[[Values, Element], _Value]
    write: Callable[[Element, _Value], None]
    attributes: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    part: str = ""
    absent: _Value | None = None
    leftovers: Callable[[Values, Element], list[Element]] | None = None
    is_single: bool = False
    names: Names | None = None
    inner: Mapping[str, Names] = field(default_factory=dict)

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

        return Field(
            read, write, self.attributes, self.tags, part, self.absent, is_single=True, inner=self.inner
        )


@dataclass(frozen=True, slots=True)
class Attribute(Field[Any]):
    """A field that is read from one attribute of the record's own element.

    Attributes:
        default: what an absent attribute means; `REQUIRED` if it has to be there.
        convert: makes the value of the text; None for the text itself.
        check: raises an error for a text that gives an error or a warning; None where there is none.
    """

    default: object = REQUIRED
    convert: Convert | None = None
    check: Convert | None = None

    @property
    def is_number(self) -> bool:
        """Whether every number that can be meant is its own value."""
        return self.check is Values.to_number

    def lenient(self) -> "Attribute":
        """Return the attribute with a value that cannot be meant warned about, and read as absent."""
        convert, default = self.convert, self.default
        assert convert is not None
        assert default is not REQUIRED

        def convert_or_warn(values: Values, element: Element, name: str, text: str) -> Any:
            return values.or_absent(lambda: convert(values, element, name, text), element, default)

        return replace(
            attribute(self.attributes[0], default, convert_or_warn, self.write),
            absent=self.absent,
            check=self.check,
        )


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
    field = Attribute(read, write, (name,), absent=absent, default=default, convert=convert, check=convert)
    return replace(field, names=names_of([field]))


class Steps:
    """The reading of several fields of an element, with few calls: there are thousands of elements."""

    def __init__(self, columns: Iterable[Field[Any]]) -> None:
        self._steps = [
            (column.attributes[0], column.default, column.convert, column.is_number, column.read, ())
            if isinstance(column, Attribute)
            else ("", column.absent, None, False, column.read, _tags_needed(column))
            for column in columns
        ]

    def read(self, values: Values, element: Element) -> list[Any]:
        """Return the values of the fields."""
        result: list[Any] = []
        # One call for all attributes is quicker than one for each.
        texts: dict[Any, Any] = dict(element.items())
        tags = {child.tag for child in element} if len(element) else _NO_TAGS
        for name, absent, convert, is_number, read, read_tags in self._steps:
            if name:
                text = texts.get(name)
                if text is None:
                    if absent is REQUIRED:
                        raise values.missing(element, name)
                    result.append(absent)
                elif is_number and (value := number_of(text)) is not None:
                    result.append(value)
                else:
                    result.append(text if convert is None else convert(values, element, name, text))
            elif read_tags and tags.isdisjoint(read_tags):
                result.append(absent)
            else:
                result.append(read(values, element))
        return result


def _tags_needed(column: Field[Any]) -> tuple[str, ...]:
    """Return the children without which a field is absent; none if it has to be read all the same."""
    return () if column.absent is None else column.own_tags


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
        eager = [name for name in _fieldnames_of(record) if name != "details"]
        late = _fieldnames_of(details)
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
        # Of one such child nothing is left over.
        self._own_tags = {
            tag for column in ordered if not column.part and column.leftovers is None for tag in column.tags
        }
        self._leftovers = [column.leftovers for column in ordered if column.leftovers is not None]
        bound = {name: self._bound(column) for name, column in columns.items()}
        self._steps = Steps(bound[name] for name in eager)
        self._late_steps = Steps(bound[name] for name in late)
        self._writes = [(name, column.write) for name, column in bound.items()]
        # An element with nothing but these children has no details.
        self._plain_tags = {tag for name in eager if not columns[name].part for tag in columns[name].tags}
        self.names = names_of(columns[name] for name in (eager if details is None else late))
        plain = () if details is None else self._plain_tags
        self.names = self.names._replace(
            plain=plain,
            parts=self._parts,
            single=self._single,
            is_complete=self.names.is_complete and check is None,
        )
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
        present = {child.tag for child in element}
        if len(present) == len(element) and self._own_tags.issuperset(present):
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


def names_of(columns: Iterable[Field[Any]]) -> Names:
    """Return what may stand in an element that is read by some fields."""
    late: set[object] = set()
    numbers: set[object] = set()
    required: set[str] = set()
    inner: dict[Any, Names] = {}
    checks: dict[Any, Convert] = {}
    is_complete = True
    for column in columns:
        late.update(column.own_tags)
        inner.update(column.inner)
        if isinstance(column, Attribute):
            name = column.attributes[0]
            if column.is_number:
                numbers.add(name)
            elif column.check is not None:
                checks[name] = column.check
            if column.default is REQUIRED:
                required.add(name)
        elif column.names is not None:
            numbers |= set(column.names.numbers)
            required |= set(column.names.required)
            checks |= column.names.checks
            is_complete &= column.names.is_complete
        else:
            is_complete &= column is REST or column is OTHER_ATTRIBUTES or bool(column.tags)
    return Names(
        late=late, inner=inner, numbers=numbers, checks=checks, required=required, is_complete=is_complete
    )


def _fieldnames_of(record: Callable[..., object] | None) -> list[str]:
    return [each.name for each in fields(record)] if is_dataclass(record) else []


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
