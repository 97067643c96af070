"""Runs and dataclasses of settings from the plain values that JSON holds."""

from __future__ import annotations

import dataclasses
import math
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any, TypeVar

from scenarios.reading import ReadError, shown
from scenarios.settings import Settings
from scenarios.spec import RunSpec
from smartmot.errors import SmartMotError
from smartmot.filters.motion_models import ConstantAcceleration, ConstantVelocity, LinearMotion
from smartmot.plugins import Plugin

_CLASSES_OF: Mapping[Any, tuple[type, ...]] = {LinearMotion: (ConstantVelocity, ConstantAcceleration)}
"""Dataclasses that stand where an annotation names a protocol."""

NO_LIMIT = "inf"
"""An infinite setting, which JSON has no number for."""

T = TypeVar("T")


def decode(kind: type[T], values: object, where: str, defaults: bool = False) -> T:
    """A dataclass from an object of JSON.

    An object of the user's own, where one may stand, is a `Plugin` by its name; nothing is imported.

    Args:
        kind: the dataclass; of numbers, texts, truth values, None, tuples and dataclasses.
        values: what JSON holds.
        where: what it is, for messages.
        defaults: whether fields that are not there have their default.

    Raises:
        ReadError: a field is missing, unknown, of another kind or out of range.
    """
    if not isinstance(values, Mapping):
        raise ReadError(f"{where} must be an object, got {shown(values)}")
    kinds = _kinds(kind)  # type: ignore[arg-type]
    fields = {field.name: field for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    unknown = [name for name in values if name not in fields]
    if unknown:
        raise ReadError(f"{where} has no {shown(unknown[0])} in this version")
    made: dict[str, Any] = {}
    for name, field in fields.items():
        if name in values:
            made[name] = _value(kinds[name], values[name], f"{where}.{name}", defaults)
        elif not defaults or _needed(field):
            raise ReadError(f"{where}.{name} is missing")
    try:
        return kind(**made)
    except (SmartMotError, ValueError, TypeError, OverflowError) as error:
        raise ReadError(f"{where}: {error}") from None


@cache
def _kinds(kind: Any) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def _needed(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _value(kind: Any, value: object, where: str, defaults: bool) -> Any:
    """A value of one of the kinds that an annotation allows."""
    kinds = typing.get_args(kind) if typing.get_origin(kind) in (typing.Union, types.UnionType) else (kind,)
    if value is None and type(None) in kinds:
        return None
    for option in kinds:
        if option is float and isinstance(value, (int, float)) and not isinstance(value, bool):
            if not math.isfinite(value):
                break
            return float(value)
        if option in (int, bool, str) and type(value) is option:
            return value
        if typing.get_origin(option) is tuple and isinstance(value, list):
            item = typing.get_args(option)[0]
            return tuple(_value(item, v, f"{where}[{k}]", defaults) for k, v in enumerate(value))
    if isinstance(value, Mapping):
        if set(value) == {"name", "digest"} and any(
            option is Plugin or _is_callable(option) for option in kinds
        ):
            return decode(Plugin, value, where)
        named = [own for option in kinds for own in _CLASSES_OF.get(option, (option,))]
        classes = [
            option for option in named if dataclasses.is_dataclass(option) and isinstance(option, type)
        ]
        if classes:
            # of several the one whose fields are most like those that are there
            best = max(
                classes, key=lambda option: -len(set(value) ^ {f.name for f in dataclasses.fields(option)})
            )
            return decode(best, value, where, defaults)
    names = " or ".join(_name(option) for option in kinds)
    raise ReadError(f"{where} must be {names}, got {shown(value)}")


def _is_callable(kind: Any) -> bool:
    return typing.get_origin(kind) is Callable or kind is Callable


def _name(kind: Any) -> str:
    names = {
        float: "a number",
        int: "a whole number",
        str: "a text",
        bool: "true or false",
        type(None): "null",
    }
    if typing.get_origin(kind) is tuple:
        return "a list"
    return names.get(kind, "an object")


def object_of(value: object, where: str) -> Mapping[str, Any]:
    """An object of JSON.

    Raises:
        ReadError: it is something else.
    """
    if not isinstance(value, Mapping):
        raise ReadError(f"{where} must be an object, got {shown(value)}")
    return value


def list_of(value: object, where: str) -> list[Any]:
    """A list of JSON; see `object_of`."""
    if not isinstance(value, list):
        raise ReadError(f"{where} must be a list, got {shown(value)}")
    return value


def texts_of(value: object, where: str) -> Mapping[str, str]:
    """An object of JSON that holds texts; see `object_of`."""
    for name, text in object_of(value, where).items():
        if not isinstance(text, str):
            raise ReadError(f"{where}.{name} must be a text, got {shown(text)}")
    return object_of(value, where)


def is_scalar(value: object) -> bool:
    """Whether a value may be that of a parameter: a text, a truth value or a finite number."""
    return isinstance(value, (bool, str)) or (isinstance(value, (int, float)) and math.isfinite(value))


def decoded_spec(values: Mapping[str, Any], where: str, defaults: bool = False) -> RunSpec:
    """A run whose files are still named as in the configuration."""
    plain = {name: value for name, value in values.items() if name not in ("parameters", "settings")}
    spec = decode(RunSpec, plain | {"parameters": [], "settings": []}, where, defaults)
    parameters = object_of(values.get("parameters"), f"{where}.parameters")
    known = decoded_settings(values.get("settings", {}), f"{where}.settings")
    return replace(spec, parameters=tuple(sorted(parameters.items())), settings=known)


def decoded_settings(values: object, where: str) -> Settings:
    """Settings from an object of JSON with their values by name.

    Raises:
        ReadError: a value is neither a number nor a text.
    """
    settings = object_of(values, where)
    for name, value in settings.items():
        if not is_scalar(value) or isinstance(value, bool):
            raise ReadError(f"{where}.{name} must be a number or a text, got {shown(value)}")
    return tuple((name, math.inf if value == NO_LIMIT else value) for name, value in settings.items())
