"""Elements become records by what the records declare."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, cast, get_args, get_origin, get_type_hints

from scenarios.openscenario.elements import (
    Attribute,
    Check,
    Child,
    Element,
    Never,
    Only,
    Reference,
    Source,
)
from scenarios.openscenario.errors import ContentError, UnsupportedError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.reading.carla import right_handed
from scenarios.openscenario.reading.catalogs import Catalogs
from scenarios.openscenario.reading.document import Node


@dataclass(frozen=True, slots=True)
class Context:
    """What references in a scenario file are checked against.

    Args:
        catalogs: entries by name.
        entities: names of the entities.
        variables: start values by name.
        notes: lines about what is read and not used, each once.
        of_carla: whether the file is CARLA's, in its coordinates, with ScenarioRunner's triggers.
        selections: names of the entities of each EntitySelection, by its name.
        phases: names of the phases of each controller of traffic signals, by its name.
    """

    catalogs: Catalogs
    entities: Collection[str]
    variables: Mapping[str, Value]
    notes: dict[str, None] = dataclasses.field(default_factory=dict)
    of_carla: bool = False
    selections: Mapping[str, tuple[str, ...]] = dataclasses.field(default_factory=dict)
    phases: Mapping[str, tuple[str, ...]] = dataclasses.field(default_factory=dict)

    def note(self, node: Node, line: str) -> None:
        """Take note of what an element has that is not used, at its place."""
        self.notes[f"{node.where} {line}"] = None

    def entity(self, node: Node, attribute: str = "entityRef") -> str:
        """Name of an entity that exists.

        Raises:
            ContentError: it does not.
        """
        return _known(node, attribute, "entity", "entities", self.entities)

    def members(self, node: Node) -> tuple[str, ...]:
        """Names of the entities that an element refers to: of one entity, or of a selection of some.

        Raises:
            ContentError: there is neither of that name.
        """
        chosen = self.selections.get(node.text("entityRef"))
        return (self.entity(node),) if chosen is None else chosen

    def variable(self, node: Node) -> str:
        """Name of a variable that exists.

        Raises:
            ContentError: it does not.
        """
        return _known(node, "variableRef", "variable", "variables", self.variables)

    def phase(self, node: Node) -> tuple[str, str]:
        """A controller of traffic signals and a phase of it.

        Raises:
            ContentError: there is no such controller, or it has no such phase.
        """
        name = _known(node, "trafficSignalControllerRef", "controller", "controllers", self.phases)
        return name, _known(node, "phase", "phase", f"phases of '{name}'", self.phases[name])


def _known(node: Node, attribute: str, kind: str, kinds: str, names: Collection[str]) -> str:
    name = node.text(attribute)
    if name not in names:
        raise ContentError(
            f"{node.where} {attribute}: no {kind} '{name}'; {kinds}: {', '.join(names) or 'none'}"
        )
    return name


RecordT = TypeVar("RecordT", bound=Element)
Reader: TypeAlias = Callable[[Node, Context], Element]
ReaderT = TypeVar("ReaderT", bound=Reader)

_READERS: dict[type[Element], Reader] = {}


def reads(kind: type[Element]) -> Callable[[ReaderT], ReaderT]:
    """Register a function that reads a record which its declarations alone do not describe."""

    def register(reader: ReaderT) -> ReaderT:
        _READERS[kind] = reader
        return reader

    return register


def read(kind: type[RecordT], node: Node, context: Context) -> RecordT:
    """A record from its element: by its own reader, or else as it declares."""
    reader = _READERS.get(kind)
    if reader is not None:
        record = cast(RecordT, reader(node, context))
    else:
        allow(kind, node)
        record = declared(kind, node, context)
    return cast(RecordT, right_handed(record)) if context.of_carla else record


def allow(kind: type[Element], node: Node) -> None:
    """Refuse every attribute and child that a record does not declare.

    Raises:
        UnsupportedError: there is one.
    """
    plan = _plan(kind)
    node.allow(plan.attributes, plan.children)


def declared(kind: type[RecordT], node: Node, context: Context, /, **given: object) -> RecordT:
    """A record from its fields as declared, in their order, but for those that are given.

    Raises:
        ContentError: a field is missing, or has a value that it cannot have.
        UnsupportedError: a word is not known, or not carried out.
    """
    for name, value in _plan(kind).values:
        if name not in given:
            given[name] = value(node, context)
    make: Callable[..., RecordT] = kind
    return make(**given)


@dataclass(frozen=True, slots=True)
class _Options:
    """Records of a union.

    Args:
        tags: names of the elements, or of the groups that hold them (separated by blanks).
        kinds: records by the names of their elements.
        groups: records that a group holds, by its name.
    """

    tags: str
    kinds: dict[str, type[Element]]
    groups: dict[str, _Options]


@cache
def _options(kinds: object) -> _Options:
    members: dict[str, list[type[Element]]] = {}
    for kind in get_args(kinds):
        if kind is not type(None):
            members.setdefault(kind.xml.group or kind.xml.tag, []).append(kind)
    direct: dict[str, type[Element]] = {}
    groups: dict[str, _Options] = {}
    for name, held in members.items():
        if held[0].xml.group is None:
            direct[name] = held[0]
        else:
            by_tag = {kind.xml.tag: kind for kind in held}
            groups[name] = _Options(" ".join(by_tag), by_tag, {})
    return _Options(" ".join(members), direct, groups)


def one_of(kinds: object, node: Node, context: Context) -> Element:
    """The record of the only child of an element, which is of one of the types of a union."""
    return read(*chosen(kinds, node), context)


def chosen(kinds: object, node: Node) -> tuple[type[Element], Node]:
    """Which type of a union the only child of an element is of, and the child.

    Raises:
        ContentError: there is no child, or there are several.
        UnsupportedError: it is of none of them.
    """
    options = _options(kinds)
    child = node.one_of(options.tags)
    group = options.groups.get(child.tag)
    if group is not None:
        options, child = group, child.one_of(group.tags)
    return options.kinds[child.tag], child


ValueReader: TypeAlias = Callable[[Node, Context], object]
"""Reads the value of one field from the element of its record."""


@dataclass(frozen=True, slots=True)
class _Field:
    """A field of a record: its name, what is checked first, where it is read from, and how."""

    name: str
    checks: tuple[Check, ...]
    source: Source
    value: ValueReader


def _field(name: str, hint: object) -> _Field:
    kind, *metadata = get_args(hint)
    checks = tuple(part for part in metadata if isinstance(part, Only | Never))
    source = next(part for part in metadata if isinstance(part, Attribute | Reference | Child))
    if optional := type(None) in get_args(kind):
        kind = get_args(kind)[0] if len(get_args(kind)) == 2 else kind
    value = _reader_of(source, kind, optional)
    return _Field(name, checks, source, _checked(checks, value) if checks else value)


@dataclass(frozen=True, slots=True)
class _Plan:
    """How a record is read: its fields in the order of reading, the attributes and children that it knows."""

    values: tuple[tuple[str, ValueReader], ...]
    attributes: str
    children: str


_PLANS: dict[type[Element], _Plan] = {}


def _plan(kind: type[Element]) -> _Plan:
    plan = _PLANS.get(kind)
    if plan is None:
        plan = _PLANS[kind] = _made_plan(kind)
    return plan


def _made_plan(kind: type[Element]) -> _Plan:
    hints = get_type_hints(kind, include_extras=True)
    fields = [_field(name, hint) for name, hint in hints.items() if get_origin(hint) is Annotated]
    attributes = [check.name for field in fields for check in field.checks]
    tags: list[str] = []
    for source in (field.source for field in fields):
        if isinstance(source, Child):
            tags.append(source.name)
        else:
            older = source.older if isinstance(source, Attribute) else None
            attributes += [source.name] if older is None else [source.name, older]
    xml = kind.xml
    fields.sort(key=lambda field: field.name not in xml.first.split())
    return _Plan(
        tuple((field.name, field.value) for field in fields),
        " ".join(attributes) if xml.attributes is None else xml.attributes,
        " ".join(tags) if xml.children is None else xml.children,
    )


def _reader_of(source: Source, kind: object, optional: bool) -> ValueReader:
    """What reads a field from its source; decided once for a field, so that reading need not ask again.

    Args:
        source: where it is read from.
        kind: its type; without None if that and another one are all.
        optional: whether it may be None.
    """
    name = source.name
    if isinstance(source, Reference):
        return lambda node, context: context.entity(node, name)
    if isinstance(source, Child):
        return _child(source, kind, optional)
    read_name, older = _attribute(source, kind, name), source.older
    read_older = read_name if older is None else _attribute(source, kind, older)
    if optional and source.default is None:
        return lambda node, context: (
            read_name(node, context)
            if node.has(name)
            else read_older(node, context)
            if older is not None and node.has(older)
            else None
        )
    if older is None:
        return read_name
    return lambda node, context: (read_name if node.has(name) else read_older)(node, context)


def _child(source: Child, kind: object, optional: bool) -> ValueReader:
    name, default, needed = source.name, source.default, not optional and source.default is None
    is_record = isinstance(kind, type) and issubclass(kind, Element)
    read_child: Callable[[Any, Node, Context], Element] = read if is_record else one_of

    def value(node: Node, context: Context) -> object:
        child = node.need(name) if needed else node.get(name)
        return default if child is None else read_child(kind, child, context)

    return value


def _attribute(source: Attribute, kind: object, name: str) -> ValueReader:
    default, meanings, zero = source.default, source.values, source.sign == "not negative"
    if meanings is not None:
        words = " ".join(meanings)
        return lambda node, context: meanings[node.choice(name, words, default)]
    if get_origin(kind) is Literal:
        options = " ".join(get_args(kind))
        return lambda node, context: node.choice(name, options, default)
    if kind is str:
        return lambda node, context: node.text(name, default)
    if kind is bool:
        return lambda node, context: node.boolean(name, default)
    if kind is int:
        return lambda node, context: node.integer(name, default)
    if source.sign == "any":
        return lambda node, context: node.number(name, default)
    return lambda node, context: node.positive(name, default, zero)


def _checked(checks: tuple[Check, ...], value: ValueReader) -> ValueReader:
    def checked(node: Node, context: Context) -> object:
        for check in checks:
            _check(check, node)
        return value(node, context)

    return checked


def _check(check: Check, node: Node) -> None:
    if isinstance(check, Only):
        node.choice(check.name, check.words, check.default)
    elif node.boolean(check.name, check.default):
        raise UnsupportedError(f"{node.where} {check.name}='true' is not supported{check.instead}")
