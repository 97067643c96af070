"""How records declare the XML that they are read from.

    class LanePosition(Element):
        road_id: Annotated[str, Attribute("roadId")]
        offset_m: Annotated[float, Attribute("offset", 0.0)]
        orientation: Annotated[Orientation, Child("Orientation", Orientation())]

The type of a field says what its attribute is: text, number, whole number, truth value, or one word of a
Literal; one that may be None need not be there. `reading.elements` reads by these declarations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import (
    Annotated,
    ClassVar,
    Literal,
    Self,
    TypeAlias,
    dataclass_transform,
    get_args,
    get_type_hints,
)

from scenarios.openscenario.expressions import Value


class Immutable:
    """What is never changed once it is made, so that copies of a run share it."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self


@dataclass(frozen=True, slots=True)
class Attribute:
    """A field read from an attribute.

    Args:
        name: of the attribute.
        default: where it is missing; None: it is needed, unless the field may be None.
        values: words that it may have, with what each means for the field; None: as the type says.
        sign: which numbers it may be.
        older: its name in an older version, or another attribute that may stand in its place.
    """

    name: str
    default: Value | None = None
    values: Mapping[str, object] | None = None
    sign: Literal["any", "not negative", "positive"] = "any"
    older: str | None = None


@dataclass(frozen=True, slots=True)
class Reference:
    """A field read from an attribute that names an entity of the scenario."""

    name: str = "entityRef"


@dataclass(frozen=True, slots=True)
class Child:
    """A field read from a child element: one of the field's type, or one that holds one of its types.

    Args:
        name: of the element.
        default: where it is missing; None: it is needed, unless the field may be None.
    """

    name: str
    default: Immutable | None = None


@dataclass(frozen=True, slots=True)
class Only:
    """An attribute that may only have some words (separated by blanks), which make no difference."""

    name: str
    words: str
    default: str | None = None


@dataclass(frozen=True, slots=True)
class Never:
    """An attribute that must not be true; `instead` says what to do."""

    name: str
    default: bool | None = None
    instead: str = ""


Source: TypeAlias = Attribute | Reference | Child
Check: TypeAlias = Only | Never
"""What stands before the source of a field is checked before it is read."""


@dataclass(frozen=True, slots=True)
class Declaration:
    """What an Element class says of its XML beside its fields.

    Args:
        tag: name of the element; usually that of the class.
        group: name of the element that holds it alone.
        attributes: all that may stand there, also what is not used; None: those of the fields.
        children: elements that may stand there; None: those of the fields.
        first: fields that are read before the others (names separated by blanks).
    """

    tag: str
    group: str | None
    attributes: str | None
    children: str | None
    first: str


@dataclass_transform(frozen_default=True)
class Element(Immutable):
    """A record read from an XML element: a frozen dataclass; see `Declaration` for the class arguments."""

    xml: ClassVar[Declaration]

    def __init_subclass__(
        cls,
        *,
        tag: str | None = None,
        group: str | None = None,
        attributes: str | None = None,
        children: str | None = None,
        first: str = "",
    ) -> None:
        cls.xml = Declaration(tag or cls.__name__, group, attributes, children, first)
        dataclass(frozen=True)(cls)


EntityName: TypeAlias = Annotated[str, Reference()]
"""The entity that an attribute `entityRef` names."""

_REFERENCES: dict[type[Element], tuple[str, ...]] = {}


def referred(record: object) -> frozenset[str]:
    """Entities that a record, and the records in it, refer to."""
    if isinstance(record, tuple):
        return frozenset[str]().union(*map(referred, record))
    if not isinstance(record, Element):
        return frozenset()
    kind = type(record)
    if kind not in _REFERENCES:
        hints = get_type_hints(kind, include_extras=True).items()
        _REFERENCES[kind] = tuple(
            name for name, hint in hints if any(isinstance(part, Reference) for part in get_args(hint)[1:])
        )
    held = (getattr(record, name) for name in _REFERENCES[kind])
    names = frozenset(name for name in held if name is not None)
    return names.union(*map(referred, vars(record).values()))
