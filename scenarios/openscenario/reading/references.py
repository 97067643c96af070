"""References of conditions to elements of the storyboard."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from scenarios.openscenario.errors import ContentError
from scenarios.openscenario.model import (
    KINDS,
    Act,
    Condition,
    Event,
    ManeuverGroup,
    Story,
    StoryboardElementStateCondition,
    Trigger,
    elements_of,
)


def ends_with(path: tuple[str, ...], tail: tuple[str, ...]) -> bool:
    """Whether a path of names ends with another."""
    return path[-len(tail) :] == tail


def qualified(file: Path, stories: tuple[Story, ...], stop: Trigger | None) -> tuple[Story, ...]:
    """Stories in which every reference to an element means one alone.

    Where several have the name, the nearest is meant: that which shares most of its path with the element
    whose trigger has the condition (a maneuver of a catalog that stands twice refers to its own events).

    Raises:
        ContentError: no element has the name, or none is the nearest.
    """
    paths = [(KINDS[type(element)], path) for path, element in elements_of(stories)]
    names = _Names(file, paths)
    names.trigger(stop, ())
    return tuple(_story(story, names) for story in stories)


class _Names:
    """Elements by kind and path."""

    def __init__(self, file: Path, paths: Sequence[tuple[str, tuple[str, ...]]]) -> None:
        self._file, self._paths = file, paths

    def trigger(self, trigger: Trigger | None, holder: tuple[str, ...]) -> Trigger | None:
        """A trigger of the element of a path."""
        if trigger is None or not any(_is_reference(c) for group in trigger for c in group):
            return trigger
        return tuple(tuple(self._condition(c, holder) for c in group) for group in trigger)

    def _condition(self, condition: Condition, holder: tuple[str, ...]) -> Condition:
        kind = condition.kind
        if not isinstance(kind, StoryboardElementStateCondition):
            return condition
        hits = [path for k, path in self._paths if k == kind.kind and ends_with(path, kind.path)]
        if len(hits) > 1:
            shared = [_shared(path, holder) for path in hits]
            nearest = [path for path, count in zip(hits, shared, strict=True) if count == max(shared)]
            if len(nearest) == 1:
                return replace(condition, kind=replace(kind, path=nearest[0]))
        if len(hits) != 1:
            raise ContentError(
                f"{self._file}: condition '{condition.name}' refers to {kind.kind} '{'/'.join(kind.path)}', "
                f"of which there are {len(hits)}; give its path from the story, separated by '::'"
            )
        return condition


def _is_reference(condition: Condition) -> bool:
    return isinstance(condition.kind, StoryboardElementStateCondition)


def _shared(path: tuple[str, ...], other: tuple[str, ...]) -> int:
    """How many names two paths begin with alike."""
    same = [a == b for a, b in zip(path, other, strict=False)]
    return same.index(False) if False in same else len(same)


def _story(story: Story, names: _Names) -> Story:
    return replace(story, acts=tuple(_act(act, names, (story.name, act.name)) for act in story.acts))


def _act(act: Act, names: _Names, holder: tuple[str, ...]) -> Act:
    groups = tuple(_group(group, names, (*holder, group.name)) for group in act.groups)
    return replace(
        act, groups=groups, start=names.trigger(act.start, holder), stop=names.trigger(act.stop, holder)
    )


def _group(group: ManeuverGroup, names: _Names, holder: tuple[str, ...]) -> ManeuverGroup:
    maneuvers = tuple(
        replace(
            maneuver,
            events=tuple(_event(e, names, (*holder, maneuver.name, e.name)) for e in maneuver.events),
        )
        for maneuver in group.maneuvers
    )
    return replace(group, maneuvers=maneuvers)


def _event(event: Event, names: _Names, holder: tuple[str, ...]) -> Event:
    return replace(event, start=names.trigger(event.start, holder))
