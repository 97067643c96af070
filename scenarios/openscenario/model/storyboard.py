"""The storyboard, and the scenario as a whole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

from scenarios.openscenario.elements import Element
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model.actions import Action
from scenarios.openscenario.model.conditions import Condition, Trigger
from scenarios.openscenario.model.entities import EntityDefinition, SignalController


class NamedAction(Element):
    """An action of an event; `entities` are those that carry it out, none for a global action."""

    name: str
    action: Action
    entities: tuple[str, ...]
    is_private: bool = False


class Event(Element):
    """Actions started together. `start` None: as soon as the event may.

    `select`: who makes the trigger hold carries the actions out as well.
    """

    name: str
    priority: str
    max_executions: int
    actions: tuple[NamedAction, ...]
    start: Trigger | None
    select: bool = False


class Maneuver(Element):
    """Events."""

    name: str
    events: tuple[Event, ...]


class ManeuverGroup(Element):
    """Maneuvers of the same actors."""

    name: str
    max_executions: int
    maneuvers: tuple[Maneuver, ...]


class Act(Element):
    """Maneuver groups, started and stopped together."""

    name: str
    groups: tuple[ManeuverGroup, ...]
    start: Trigger | None
    stop: Trigger | None


class Story(Element):
    """Acts."""

    name: str
    acts: tuple[Act, ...]


class ScenarioDefinition(Element):
    """A scenario that can be run.

    Args:
        path: the scenario file.
        description: from its header.
        parameters: final values by name.
        variables: start values by name.
        map_path: the OpenDRIVE file; None: a plane without roads.
        entities: in the order of the file.
        init: actions before the start, with the entity that carries them out (None: global).
        stories: the storyboard.
        stop: stop trigger of the storyboard.
        files: every file that was read for it: the scenario, all files of its catalog directories, the map.
        notes: lines about what the file has and the run does not use.
        criteria: what CARLA's ScenarioRunner judges a run by: name and value.
        signals: controllers of traffic signals.
    """

    path: Path
    description: str
    parameters: Mapping[str, Value]
    variables: Mapping[str, Value]
    map_path: Path | None
    entities: tuple[EntityDefinition, ...]
    init: tuple[tuple[str | None, Action], ...]
    stories: tuple[Story, ...]
    stop: Trigger | None
    files: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()
    criteria: tuple[tuple[str, str], ...] = ()
    signals: tuple[SignalController, ...] = ()

    def events(self) -> Iterator[Event]:
        """All events, in the order of the file."""
        return (element for _, element in elements_of(self.stories) if isinstance(element, Event))

    def conditions(self) -> Iterator[Condition]:
        """All conditions: those of the stop trigger, then those of the stories in the order of the file."""
        return conditions_of(self.stories, self.stop)


StoryboardElement: TypeAlias = Story | Act | ManeuverGroup | Maneuver | Event | NamedAction

KINDS: dict[type[Element], str] = {
    Story: "story",
    Act: "act",
    ManeuverGroup: "maneuverGroup",
    Maneuver: "maneuver",
    Event: "event",
    NamedAction: "action",
}
"""Storyboard elements as conditions name them."""


def elements_of(
    elements: Sequence[StoryboardElement], above: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], StoryboardElement]]:
    """Storyboard elements and all below them, each after that which holds it, with their paths of names."""
    for element in elements:
        path = (*above, element.name)
        yield path, element
        match element:
            case Story(acts=inner) | Act(groups=inner) | ManeuverGroup(maneuvers=inner):
                yield from elements_of(inner, path)
            case Maneuver(events=inner) | Event(actions=inner):
                yield from elements_of(inner, path)


def conditions_of(stories: Sequence[Story], stop: Trigger | None) -> Iterator[Condition]:
    """All conditions of a stop trigger and of the triggers of stories."""
    triggers = [stop]
    for _, element in elements_of(stories):
        if isinstance(element, Act):
            triggers += [element.start, element.stop]
        elif isinstance(element, Event):
            triggers.append(element.start)
    return (condition for trigger in triggers for group in trigger or () for condition in group)
