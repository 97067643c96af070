"""Elements become records by what the records declare."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias, TypeVar, cast, get_args, get_origin, get_type_hints

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
from scenarios.openscenario.reading.catalogs import Catalogs
from scenarios.openscenario.reading.document import Node


@dataclass(frozen=True, slots=True)
class Context:
    """What references in a scenario file are checked against.

    Args:
        catalogs: entries by name.
        entities: names of the entities.
        variables: start values by name.
    """

    catalogs: Catalogs
    entities: Collection[str]
    variables: Mapping[str, Value]

    def entity(self, node: Node, attribute: str = "entityRef") -> str:
        """Name of an entity that exists.

        Raises:
            ContentError: it does not.
        """
        return _known(node, attribute, "entity", "entities", self.entities)

    def variable(self, node: Node) -> str:
        """Name of a variable that exists.

        Raises:
            ContentError: it does not.
        """
        return _known(node, "variableRef", "variable", "variables", self.variables)


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
        return cast(RecordT, reader(node, context))
    allow(kind, node)
    return declared(kind, node, context)


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
    values = dict(given)
    for field in _plan(kind).fields:
        if field.name not in given:
            values[field.name] = _value(field, node, context)
    return cast(Callable[..., RecordT], kind)(**values)


_OPTIONS: dict[object, dict[str, list[type[Element]]]] = {}


def _options(kinds: object) -> dict[str, list[type[Element]]]:
    """Records of a union by the names of the elements, or of the groups that hold them."""
    options: dict[str, list[type[Element]]] = {}
    for kind in get_args(kinds):
        if kind is not type(None):
            options.setdefault(kind.xml.group or kind.xml.tag, []).append(kind)
    return options


def one_of(kinds: object, node: Node, context: Context) -> Element:
    """The record of the only child of an element, which is of one of the types of a union."""
    return read(*chosen(kinds, node), context)


def chosen(kinds: object, node: Node) -> tuple[type[Element], Node]:
    """Which type of a union the only child of an element is of, and the child.

    Raises:
        ContentError: there is no child, or there are several.
        UnsupportedError: it is of none of them.
    """
    options = _OPTIONS.get(kinds) or _OPTIONS.setdefault(kinds, _options(kinds))
    child = node.one_of(" ".join(options))
    members = options[child.tag]
    if members[0].xml.group is not None:
        child = child.one_of(" ".join(member.xml.tag for member in members))
    return next(member for member in members if member.xml.tag == child.tag), child


@dataclass(frozen=True, slots=True)
class _Field:
    """A field of a record: what is checked first, where it is read from, and as what.

    Args:
        name: of the field.
        checks: what is checked before.
        source: where it is read from.
        names: attributes or children that it may be read from.
        kind: its type; without None if that and another one are all.
        optional: whether it may be None.
        words: that its attribute may have (separated by blanks); None: it is no choice of words.
    """

    name: str
    checks: tuple[Check, ...]
    source: Source
    names: tuple[str, ...]
    kind: object
    optional: bool
    words: str | None


def _field(name: str, hint: object) -> _Field:
    kind, *metadata = get_args(hint)
    checks = tuple(part for part in metadata if isinstance(part, Only | Never))
    source = next(part for part in metadata if isinstance(part, Attribute | Reference | Child))
    names: tuple[str, ...] = (source.name,)
    if optional := type(None) in get_args(kind):
        kind = get_args(kind)[0] if len(get_args(kind)) == 2 else kind
    words = " ".join(get_args(kind)) if get_origin(kind) is Literal else None
    if isinstance(source, Attribute):
        names += () if source.older is None else (source.older,)
        words = words if source.values is None else " ".join(source.values)
    return _Field(name, checks, source, names, kind, optional, words)


@dataclass(frozen=True, slots=True)
class _Plan:
    """How a record is read: its fields in the order of reading, the attributes and children that it knows."""

    fields: tuple[_Field, ...]
    attributes: str
    children: str


_PLANS: dict[type[Element], _Plan] = {}


def _plan(kind: type[Element]) -> _Plan:
    if kind not in _PLANS:
        hints = get_type_hints(kind, include_extras=True)
        fields = [_field(name, hint) for name, hint in hints.items() if get_origin(hint) is Annotated]
        checked = [check.name for field in fields for check in field.checks]
        tags = [field.source.name for field in fields if isinstance(field.source, Child)]
        names = [name for field in fields for name in field.names if name not in tags]
        xml = kind.xml
        _PLANS[kind] = _Plan(
            tuple(sorted(fields, key=lambda field: field.name not in xml.first.split())),
            " ".join(checked + names) if xml.attributes is None else xml.attributes,
            " ".join(tags) if xml.children is None else xml.children,
        )
    return _PLANS[kind]


def _value(field: _Field, node: Node, context: Context) -> object:
    for check in field.checks:
        _check(check, node)
    source = field.source
    if isinstance(source, Reference):
        return context.entity(node, source.name)
    if isinstance(source, Child):
        needed = not field.optional and source.default is None
        child = node.need(source.name) if needed else node.get(source.name)
        if child is None:
            return source.default
        if isinstance(field.kind, type) and issubclass(field.kind, Element):
            return read(field.kind, child, context)
        return one_of(field.kind, child, context)
    if field.optional and source.default is None and not any(map(node.has, field.names)):
        return None
    return _attribute(field, source, node)


def _check(check: Check, node: Node) -> None:
    if isinstance(check, Only):
        node.choice(check.name, check.words, check.default)
    elif node.boolean(check.name, check.default):
        raise UnsupportedError(f"{node.where} {check.name}='true' is not supported{check.instead}")


def _attribute(field: _Field, source: Attribute, node: Node) -> object:
    name = source.name if source.older is None or node.has(source.name) else source.older
    default = source.default
    if field.words is not None:
        word = node.choice(name, field.words, default)
        return word if source.values is None else source.values[word]
    if field.kind is str:
        return node.text(name, default)
    if field.kind is bool:
        return node.boolean(name, default)
    if field.kind is int:
        return node.integer(name, default)
    if source.sign == "any":
        return node.number(name, default)
    return node.positive(name, default, zero=source.sign == "not negative")
