"""The storyboard as a state machine: stories, acts, maneuver groups, maneuvers, events."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from scenarios.openscenario import model
from scenarios.openscenario.elements import referred
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.reading.reader import ends_with
from scenarios.openscenario.running import following
from scenarios.openscenario.running.actions import LongitudinalDistance, RunningAction, Speed, Switch
from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.conditions import Watch
from scenarios.openscenario.running.synchronize import Synchronize
from scenarios.openscenario.running.world import Instant, World

STANDBY, RUNNING, COMPLETE = "standbyState", "runningState", "completeState"
MAX_ROUNDS = 1000
"""Changes that may follow from one another at one instant; more is a circle in the scenario."""


Running: TypeAlias = RunningAction[model.Action]


def running(world: World, actor: Actor | None, action: model.Action) -> Running:
    """The action as it is carried out by an entity (None: a global action)."""
    if actor is not None:
        match action:
            case model.SpeedAction():
                return Speed(world, actor, action)
            case model.LongitudinalDistanceAction():
                return LongitudinalDistance(world, actor, action)
            case model.FollowTrajectoryAction():
                return following.FollowTrajectory(world, actor, action)
            case model.AssignRouteAction():
                return following.AssignRoute(world, actor, action)
            case model.TeleportAction():
                return following.Teleport(world, actor, action)
            case model.SynchronizeAction():
                return Synchronize(world, actor, action)
    return Switch(world, actor, action)


class TriggerWatch:
    """A trigger under observation; `missing` is what a trigger that is not there comes to."""

    def __init__(self, trigger: model.Trigger | None, world: World, missing: bool) -> None:
        self._missing = missing if trigger is None else None
        self.groups = [[Watch(condition, world) for condition in group] for group in trigger or ()]

    def look(self, instant: Instant) -> bool:
        """Whether it holds; every condition is looked at, so that no edge is overlooked."""
        if self._missing is not None:
            return self._missing
        values = [[watch.look(instant) for watch in group] for group in self.groups]
        return any(all(group) for group in values)

    def forget(self) -> None:
        """Begin to look again."""
        for watch in self.watches():
            watch.forget()

    def watches(self) -> Iterator[Watch]:
        """All its conditions."""
        for group in self.groups:
            yield from group


class Element:
    """What all storyboard elements share: state, transitions, children.

    Args:
        kind: act, event ... as conditions name it.
        path: names from the story down.
    """

    def __init__(self, kind: str, path: tuple[str, ...]) -> None:
        self.kind, self.path = kind, path
        self.state = STANDBY
        self.transition: str | None = None
        self.children: list[Element] = []

    def begin(self) -> None:
        """Start transition."""
        self.state, self.transition = RUNNING, "startTransition"

    def end(self) -> None:
        """End transition."""
        self.state, self.transition = COMPLETE, "endTransition"

    def halt(self, time_s: float) -> None:
        """Stop transition, of everything below as well."""
        if self.state != COMPLETE:
            self.state, self.transition = COMPLETE, "stopTransition"
        for child in self.children:
            child.halt(time_s)

    def reset(self) -> None:
        """Back to standby for another execution."""
        self.state = STANDBY
        for child in self.children:
            child.reset()

    def everything(self) -> Iterator[Element]:
        """It and all elements below."""
        yield self
        for child in self.children:
            yield from child.everything()


class ActionElement(Element):
    """An action of an event, carried out by each actor."""

    def __init__(self, path: tuple[str, ...], action: model.NamedAction) -> None:
        super().__init__("action", path)
        self.action = action
        self.running: list[Running] = []

    def halt(self, time_s: float) -> None:
        """Stop what is running."""
        for part in self.running:
            if not part.over:
                part.stop(time_s)
        super().halt(time_s)


class EventElement(Element):
    """An event."""

    def __init__(self, path: tuple[str, ...], event: model.Event, world: World) -> None:
        super().__init__("event", path)
        self.event = event
        self.start = TriggerWatch(event.start, world, missing=True)
        self.executions = 0
        self.children = [ActionElement((*path, action.name), action) for action in event.actions]

    @property
    def actions(self) -> list[ActionElement]:
        """Its actions."""
        return [child for child in self.children if isinstance(child, ActionElement)]

    def reset(self) -> None:
        """Ready for another execution of the maneuver group."""
        super().reset()
        self.executions = 0
        self.start.forget()


class ActElement(Element):
    """An act."""

    def __init__(self, path: tuple[str, ...], act: model.Act, world: World) -> None:
        super().__init__("act", path)
        self.start = TriggerWatch(act.start, world, missing=True)
        self.stop = TriggerWatch(act.stop, world, missing=False)
        for group in act.groups:
            self.children.append(GroupElement((*path, group.name), group, world))


class GroupElement(Element):
    """A maneuver group."""

    def __init__(self, path: tuple[str, ...], group: model.ManeuverGroup, world: World) -> None:
        super().__init__("maneuverGroup", path)
        self.max_executions = group.max_executions
        self.executions = 0
        for maneuver in group.maneuvers:
            element = Element("maneuver", (*path, maneuver.name))
            element.children = [EventElement((*element.path, e.name), e, world) for e in maneuver.events]
            self.children.append(element)


class Storyboard:
    """Runs a scenario's stories.

    Args:
        definition: the scenario.
        world: what they act on.
    """

    def __init__(self, definition: model.ScenarioDefinition, world: World) -> None:
        self._world = world
        self._stop = TriggerWatch(definition.stop, world, missing=False)
        self._stories: list[Element] = []
        for story in definition.stories:
            element = Element("story", (story.name,))
            element.children = [ActElement((story.name, act.name), act, world) for act in story.acts]
            self._stories.append(element)
        self._elements = [element for story in self._stories for element in story.everything()]
        self._running: list[Running] = []
        self._named: dict[tuple[str, tuple[str, ...]], Element] = {}
        self.over = False
        world.element_state = self._element_state

    def _element_state(self, kind: str, path: tuple[str, ...], state: str) -> bool:
        element = self._named.get((kind, path))
        if element is None:
            element = next(e for e in self._elements if e.kind == kind and ends_with(e.path, path))
            self._named[kind, path] = element
        return element.transition == state if state.endswith("Transition") else element.state == state

    # Actions

    def execute(self, instant: Instant, action: model.Action, entities: tuple[str, ...]) -> list[Running]:
        """Start an action for its actors; what they do in the same domain ends."""
        actors: list[Actor | None] = [self._world.actors[name] for name in entities]
        started: list[Running] = []
        for actor in actors or [None]:
            if actor is not None and not actor.exists:
                continue
            part = running(self._world, actor, action)
            missing = sorted(name for name in referred(action) if not self._world.actors[name].exists)
            if missing:
                self._world.note(
                    f"{type(action).__name__} of '{part.who.name}' at {instant.time_s:.3f} s is not carried "
                    f"out: it refers to '{missing[0]}', which is deleted"
                )
                part.over = part.stopped = True
                started.append(part)
                continue
            for other in self._running:
                if (
                    not other.over
                    and actor is not None
                    and other.actor is actor
                    and other.domains & part.domains
                ):
                    other.stop(instant.time_s)
            part.start(instant.time_s)
            part.over = part.ended(Instant(instant.time_s, self._world.actors))
            started.append(part)
        self._running = [part for part in (*self._running, *started) if not part.over]
        return started

    def update(self, instant: Instant) -> bool:
        """Let running actions adapt at the beginning of a step; whether something is new."""
        new = False
        for part in self._running:
            new |= part.update(instant)
        return new

    # Observation

    def watches(self) -> list[Watch]:
        """Conditions that matter now."""
        watches = list(self._stop.watches())
        for story in self._stories:
            for act in story.children:
                if not isinstance(act, ActElement):
                    continue
                if act.state == STANDBY:
                    watches.extend(act.start.watches())
                if act.state != COMPLETE:
                    watches.extend(act.stop.watches())
                if act.state == RUNNING:
                    for element in act.everything():
                        if isinstance(element, EventElement) and element.state == STANDBY:
                            watches.extend(element.start.watches())
        return watches

    @property
    def elements(self) -> list[Element]:
        """Everything from the stories down to the actions."""
        return self._elements

    @property
    def running(self) -> list[Running]:
        """Actions that go on."""
        return self._running

    # Progress

    def process(self, instant: Instant) -> None:
        """Carry out everything that follows at an instant.

        Raises:
            RunError: events start one another without end.
        """
        for element in self._elements:
            element.transition = None
        for _ in range(MAX_ROUNDS):
            if not self._round(Instant(instant.time_s, self._world.actors)):
                return
        raise RunError(f"at {instant.time_s:.3f} s events start one another without end")

    def _round(self, instant: Instant) -> bool:
        """One look at everything; whether anything changed."""
        if self.over:
            return False
        changed = False
        actors = self._world.actors
        for part in self._running:
            if part.over:
                continue
            alone = part.actor is not None and not part.actor.exists
            if alone or not all(actors[name].exists for name in part.needs()):
                part.stop(instant.time_s)
                changed = True
            elif part.ended(instant):
                part.finish(instant.time_s)
                changed = True
        self._running = [part for part in self._running if not part.over]
        for story in self._stories:
            changed |= self._story(story, instant)
        if self._stop.look(instant):
            self.over = True
            for story in self._stories:
                story.halt(instant.time_s)
            return True
        return changed

    def _story(self, story: Element, instant: Instant) -> bool:
        changed = False
        if story.state == STANDBY:
            story.begin()
            changed = True
        for act in story.children:
            assert isinstance(act, ActElement)
            changed |= self._act(act, instant)
        return changed | _completed(story)

    def _act(self, act: ActElement, instant: Instant) -> bool:
        if act.state == COMPLETE:
            return False
        if act.stop.look(instant):
            act.halt(instant.time_s)
            return True
        changed = False
        if act.state == STANDBY:
            if not act.start.look(instant):
                return False
            act.begin()
            changed = True
        for group in act.children:
            assert isinstance(group, GroupElement)
            changed |= self._group(group, instant)
        return changed | _completed(act)

    def _group(self, group: GroupElement, instant: Instant) -> bool:
        if group.state == COMPLETE:
            return False
        changed = group.state == STANDBY
        if changed:
            group.begin()
        for maneuver in group.children:
            if maneuver.state == STANDBY:
                maneuver.begin()
                changed = True
            events = [child for child in maneuver.children if isinstance(child, EventElement)]
            for event in events:
                changed |= self._event(event, events, instant)
            changed |= _completed(maneuver)
        if all(child.state == COMPLETE for child in group.children):
            group.executions += 1
            if group.executions < group.max_executions:
                for maneuver in group.children:
                    maneuver.reset()
            else:
                group.end()
            changed = True
        return changed

    def _event(self, event: EventElement, siblings: list[EventElement], instant: Instant) -> bool:
        if event.state == RUNNING:
            changed = False
            for action in event.actions:
                if action.state == RUNNING and all(part.over for part in action.running):
                    if any(part.stopped for part in action.running):
                        action.halt(instant.time_s)
                    else:
                        action.end()
                    changed = True
            if all(action.state == COMPLETE for action in event.actions):
                event.executions += 1
                event.end()
                if event.executions < event.event.max_executions:
                    event.state = STANDBY
                    event.start.forget()
                changed = True
            return changed
        if event.state == COMPLETE or not event.start.look(instant):
            return False
        rivals = [other for other in siblings if other is not event and other.state == RUNNING]
        if event.event.priority == "skip" and rivals:
            event.executions += 1
            event.transition = "skipTransition"
            if event.executions >= event.event.max_executions:
                event.state = COMPLETE
            return True
        if event.event.priority == "override":
            for other in rivals:
                other.halt(instant.time_s)
        event.begin()
        for action in event.actions:
            action.begin()
            action.running = self.execute(instant, action.action.action, action.action.entities)
        return True


def _completed(element: Element) -> bool:
    """End a running element whose children are all complete; whether it did."""
    if element.state == RUNNING and all(child.state == COMPLETE for child in element.children):
        element.end()
        return True
    return False
