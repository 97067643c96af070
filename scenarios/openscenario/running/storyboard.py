"""The storyboard as a state machine: stories, acts, maneuver groups, maneuvers, events."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TypeAlias

from scenarios.openscenario import model
from scenarios.openscenario.elements import referred
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.reading.references import ends_with
from scenarios.openscenario.running import following
from scenarios.openscenario.running.actions import (
    Animation,
    RunningAction,
    Speed,
    Switch,
)
from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.conditions import Watch
from scenarios.openscenario.running.driving import distances, lateral, speeds
from scenarios.openscenario.running.driving.controllers import Control
from scenarios.openscenario.running.driving.lateral_distance import LateralDistance
from scenarios.openscenario.running.driving.trailers import TrailerChange, moves_itself
from scenarios.openscenario.running.initial import brings
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
            case model.SpeedAction(target=model.RelativeSpeed(continuous=True)):
                return speeds.ContinuousSpeed(world, actor, action)
            case model.SpeedAction():
                return Speed(world, actor, action)
            case model.SpeedProfileAction():
                return speeds.FollowSpeedProfile(world, actor, action)
            case model.LongitudinalDistanceAction() if distances.limited(action.constraints):
                return distances.Approach(world, actor, action)
            case model.LongitudinalDistanceAction():
                return distances.LongitudinalDistance(world, actor, action)
            case model.FollowTrajectoryAction():
                return following.FollowTrajectory(world, actor, action)
            case model.AssignRouteAction():
                return following.AssignRoute(world, actor, action)
            case model.LaneChangeAction():
                return lateral.LaneChange(world, actor, action)
            case model.LaneOffsetAction():
                return lateral.LaneOffset(world, actor, action)
            case model.LateralDistanceAction():
                return LateralDistance(world, actor, action)
            case model.AcquirePositionAction():
                return following.AcquirePosition(world, actor, action)
            case model.AnimationAction():
                return Animation(world, actor, action)
            case model.TeleportAction():
                return following.Teleport(world, actor, action)
            case model.SynchronizeAction():
                return Synchronize(world, actor, action)
            case model.ConnectTrailerAction() | model.DisconnectTrailerAction():
                return TrailerChange(world, actor, action)
            case model.ControllerAction() | model.ActivateControllerAction():
                return Control(world, actor, action)
    if isinstance(action, model.AddEntityAction):
        return following.AddEntity(world, None, action)
    return Switch(world, actor, action)


class TriggerWatch:
    """A trigger under observation; `missing` is what one that is not there, or empty, comes to."""

    def __init__(self, trigger: model.Trigger | None, world: World, missing: bool) -> None:
        self._missing = missing if not trigger else None
        self.groups = [[Watch(condition, world) for condition in group] for group in trigger or ()]

    def look(self, instant: Instant) -> bool:
        """Whether it holds; every condition is looked at, so that no edge is overlooked."""
        if self._missing is not None:
            return self._missing
        values = [[watch.look(instant) for watch in group] for group in self.groups]
        return any(all(group) for group in values)

    def entities(self, instant: Instant) -> list[str]:
        """Who makes it hold: the triggering entities on which a condition of it does."""
        return [name for watch in self.watches() for name in watch.triggering(instant)]

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
        self.children: Sequence[Element] = ()

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

    def watches(self) -> Iterator[Watch]:
        """Conditions in it that matter now."""
        for child in self.children:
            yield from child.watches()

    def advance(self, storyboard: Storyboard, instant: Instant) -> bool:
        """Begin if it has not yet, let the children go on, and end with them; whether anything changed."""
        if self.state == COMPLETE:
            return False
        changed = self.state == STANDBY
        if changed:
            self.begin()
        for child in self.children:
            changed |= child.advance(storyboard, instant)
        if all(child.state == COMPLETE for child in self.children):
            self.children_completed()
            changed = True
        return changed

    def children_completed(self) -> None:
        """What follows when all children are complete."""
        self.end()


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

    def advance(self, storyboard: Storyboard, instant: Instant) -> bool:
        """End when all actors are done with it."""
        if self.state != RUNNING or not all(part.over for part in self.running):
            return False
        if any(part.stopped for part in self.running):
            self.halt(instant.time_s)
        else:
            self.end()
        return True


class EventElement(Element):
    """An event.

    Args:
        path: names from the story down.
        event: as read.
        world: what its trigger refers to.
        maneuver: that it is one of.
    """

    def __init__(self, path: tuple[str, ...], event: model.Event, world: World, maneuver: Element) -> None:
        super().__init__("event", path)
        self.event, self.maneuver = event, maneuver
        self.start = TriggerWatch(event.start, world, missing=True)
        self.executions = 0
        self._began_s = -math.inf
        self.actions = [ActionElement((*path, action.name), action) for action in event.actions]
        self.children = self.actions

    def reset(self) -> None:
        """Ready for another execution of the maneuver group."""
        super().reset()
        self.executions = 0
        self._began_s = -math.inf
        self.start.forget()

    def watches(self) -> Iterator[Watch]:
        """What it waits for."""
        if self.state == STANDBY:
            yield from self.start.watches()

    def advance(self, storyboard: Storyboard, instant: Instant) -> bool:
        """Start when triggered, as the priority allows; end with the actions, and wait again if it may."""
        if self.state == RUNNING:
            return super().advance(storyboard, instant)
        if self.state == COMPLETE or not self.start.look(instant):
            return False
        if self._began_s == instant.time_s:  # it has no duration: once at an instant, then at the next step
            storyboard.again = True
            return False
        self._began_s = instant.time_s
        rivals = [other for other in self.maneuver.children if other is not self and other.state == RUNNING]
        if self.event.priority == "skip" and rivals:
            self.executions += 1
            self.transition = "skipTransition"
            if self.executions >= self.event.max_executions:
                self.state = COMPLETE
            return True
        if self.event.priority == "override":
            for other in rivals:
                other.halt(instant.time_s)
        self.begin()
        for action in self.actions:
            action.begin()
            named = action.action
            entities = named.entities
            if self.event.select and named.is_private:
                entities = tuple(dict.fromkeys((*entities, *self.start.entities(instant))))
            action.running = (
                storyboard.execute(instant, named.action, entities)
                if entities or not (named.is_private)
                else []
            )
        return True

    def children_completed(self) -> None:
        """The end of an execution."""
        self.executions += 1
        self.end()
        if self.executions < self.event.max_executions:
            self.state = STANDBY
            self.start.forget()


class ActElement(Element):
    """An act."""

    def __init__(self, path: tuple[str, ...], act: model.Act, world: World) -> None:
        super().__init__("act", path)
        self.start = TriggerWatch(act.start, world, missing=True)
        self.stop = TriggerWatch(act.stop, world, missing=False)
        self.children = [GroupElement((*path, group.name), group, world) for group in act.groups]

    def watches(self) -> Iterator[Watch]:
        """What it waits for, what stops it, and what its events wait for."""
        if self.state == STANDBY:
            yield from self.start.watches()
        if self.state != COMPLETE:
            yield from self.stop.watches()
        if self.state == RUNNING:
            yield from super().watches()

    def advance(self, storyboard: Storyboard, instant: Instant) -> bool:
        """Stop or begin when triggered."""
        if self.state == COMPLETE:
            return False
        if self.stop.look(instant):
            self.halt(instant.time_s)
            return True
        if self.state == STANDBY and not self.start.look(instant):
            return False
        return super().advance(storyboard, instant)


class GroupElement(Element):
    """A maneuver group."""

    def __init__(self, path: tuple[str, ...], group: model.ManeuverGroup, world: World) -> None:
        super().__init__("maneuverGroup", path)
        self.max_executions = group.max_executions
        self.executions = 0
        self.children = [Element("maneuver", (*path, maneuver.name)) for maneuver in group.maneuvers]
        for element, maneuver in zip(self.children, group.maneuvers, strict=True):
            element.children = [
                EventElement((*element.path, e.name), e, world, element) for e in maneuver.events
            ]

    def children_completed(self) -> None:
        """The end of an execution."""
        self.executions += 1
        if self.executions < self.max_executions:
            for maneuver in self.children:
                maneuver.reset()
        else:
            self.end()


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
        self.again = False
        """Whether an event is to begin again at the next step."""
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
            if actor is not None and not actor.placed and brings(action):
                for part_of_train in actor.towed():
                    part_of_train.exists = True
            if actor is not None and not actor.exists:
                continue
            part = running(self._world, actor, action)
            if actor is not None and actor.coupling is not None and moves_itself(action):
                self._world.note(
                    f"{type(action).__name__} of '{actor.name}' is not carried out: it is towed by "
                    f"'{actor.coupling.tower.name}'"
                )
                part.over = part.stopped = True
                started.append(part)
                continue
            missing = sorted(name for name in referred(action) if not self._world.actors[name].exists)
            if isinstance(action, model.AddEntityAction) and self._world.actors[action.entity].placed:
                missing = [name for name in missing if name != action.entity]  # from where it was deleted
            if missing:
                whose = "" if actor is None else f" of '{actor.name}'"
                self._world.note(
                    f"{type(action).__name__}{whose} at {instant.time_s:.3f} s is not carried out: it refers "
                    f"to '{missing[0]}', which is deleted"
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
                    if other.outlasts_routes and isinstance(part, following.Routing):
                        part.waits = True
                    else:
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
            if part.update(instant):
                new = True
                if not part.goes_on:  # those that follow it see what it has changed
                    instant = Instant(instant.time_s, self._world.actors)
        return new

    # Observation

    def watches(self) -> list[Watch]:
        """Conditions that matter now."""
        return [*self._stop.watches(), *(watch for story in self._stories for watch in story.watches())]

    @property
    def elements(self) -> list[Element]:
        """Everything from the stories down to the actions."""
        return self._elements

    @property
    def adapts(self) -> bool:
        """Whether an action that goes on looks at each step what it has to do."""
        return any(part.adapts for part in self._running)

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
        self.again = False
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
            changed |= story.advance(self, instant)
        if self._stop.look(instant):
            self.over = True
            for story in self._stories:
                story.halt(instant.time_s)
            return True
        return changed
