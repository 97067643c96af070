"""Runs a scenario: exact between events, whatever the step.

Within a step every state is a closed form of time. Where a condition changes, an action ends or outlines
touch inside a step, the instant is found by bisection and the step is split there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from scenarios.openscenario import model
from scenarios.openscenario.control import EgoController
from scenarios.openscenario.elements import referred
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.paths import Pose
from scenarios.openscenario.motion.positions import Locator
from scenarios.openscenario.motion.roads import Roads, load_roads
from scenarios.openscenario.motion.way_behind import with_way_behind
from scenarios.openscenario.running.actors import Actor, State
from scenarios.openscenario.running.conditions import Observed
from scenarios.openscenario.running.driving import controllers
from scenarios.openscenario.running.driving.background import Background, contact_of, strikes_from_behind
from scenarios.openscenario.running.driving.contacts import Contacts
from scenarios.openscenario.running.driving.criteria import Criteria, Criterion
from scenarios.openscenario.running.driving.leaps import gives_back, quiet_until_s
from scenarios.openscenario.running.driving.signals import Signals
from scenarios.openscenario.running.driving.trailers import couple_all
from scenarios.openscenario.running.initial import check_places, come_later, in_order, is_used, target_of
from scenarios.openscenario.running.results import Contact, Entities, Run, Samples, read_only
from scenarios.openscenario.running.storyboard import Storyboard
from scenarios.openscenario.running.world import Instant, World
from smartmot.types import Boxes, unchecked

STEP_S = 0.01
"""Step of a run: how often states are sampled and a synchronised entity looks at its master."""

TOLERANCE_S = 1e-9
"""Instants inside a step are found this exactly."""

TIME_DIGITS = 12
"""Ends of steps are rounded to so many decimals, so that 300 steps of 0.01 s end at 3 s."""

FINEST_S = 1e-5
"""What holds for a shorter time than this may be overlooked."""

MAX_LOOKS, MANY_LOOKS_S = 100, 1e-3
"""What stays close to its value all the time is, after so many looks into a step, looked at this often."""

MAX_SPLITS = 1000
"""More changes within one step are a fault of the scenario."""

ABSENT = model.EntityDefinition("an absent ego", "", "unknown", 1.0, 1.0, 1.0, 0.0, 0.0)
"""The ego of a scenario without entities, which is never there."""


class Engine:
    """One run of a scenario. A copy (`copy.deepcopy`, `pickle`) goes on with the same bytes.

    Copies share what is never changed: the scenario and the network. A pickle holds both, so that it goes on
    also where their files have changed or are missing.

    Args:
        definition: the scenario.
        ego_controller: drives the ego from the instant on that it says; None: the scenario does throughout.
        ego: name of the ego; the first entity if there is none of that name; without entities an absent one.
        step_s: step.
        roads: the network, if it is already loaded.
        until_contact: whether the ego's first contact ends the run.
        apply_performance: whether vehicles stay within their Performance, as in esmini; else that is noted.
        keeps_samples: whether states are kept step by step, for `result`; without, it has none.
        background: moves entities by a simulation of its own. One that strikes the ego from behind is noted
            in `struck` and leaves the run, which goes on: that is no contact of the ego's.

    Raises:
        RunError: an initial action cannot be carried out.
    """

    def __init__(
        self,
        definition: model.ScenarioDefinition,
        ego_controller: EgoController | None = None,
        ego: str = "Ego",
        step_s: float = STEP_S,
        roads: Roads | None = None,
        until_contact: bool = False,
        apply_performance: bool = False,
        keeps_samples: bool = True,
        background: Background | None = None,
    ) -> None:
        if not step_s > 0.0:
            raise RunError(f"step_s: expected a positive number, got {step_s}")
        self.definition, self.step_s, self.until_contact = definition, step_s, until_contact
        self._actors = {entity.name: Actor(entity) for entity in definition.entities}
        first = next(iter(self._actors.values()), None)
        self.ego = self._actors.get(ego) or first or Actor(ABSENT)
        locator = Locator(roads or load_roads(definition.map_path), self._pose_now)
        self.world = World(
            self._actors,
            locator,
            dict(definition.variables),
            apply_performance=apply_performance,
            ego=self.ego.name,
            parameters=dict(definition.parameters),
            signals=Signals(definition.signals),
        )
        if locator.roads.has_levels:
            for actor in self._actors.values():
                actor.levels = locator.roads
        controllers.check(definition, self.ego.name)
        self.storyboard = Storyboard(definition, self.world)
        self.time_s = 0.0
        self.contact: Contact | None = None
        self.struck: tuple[Contact, ...] = ()
        self._background = background
        self._names = tuple(entity.name for entity in definition.entities)
        self._categories = tuple(entity.category for entity in definition.entities)
        self._contacts = Contacts(self.ego, list(self._actors.values()))
        self._meets = False
        self._watching: list[Observed] = []
        self._open: list[Observed] = []
        self._looks = 0
        self._kink_s = math.inf
        self._samples, self._keeps_samples = Samples(), keeps_samples
        self._criteria = Criteria(definition.criteria, self.ego, locator.roads)
        # who is on which level, and what criteria of places see, follows from the step before
        self._may_leap = not (locator.roads.has_levels or self._criteria.looks)
        self._target_at_contact: float | None = None
        try:
            self._begin(ego_controller)
        except RunError as error:
            raise RunError(f"{definition.path}: {error}") from None
        self.target = target_of(definition, self.ego.name)
        if background and self.target in background.names:
            self.target = None

    # Start

    def _begin(self, controller: EgoController | None) -> None:
        instant = Instant(0.0, self._actors)
        couple_all(self.world)
        for event in self.definition.events():
            for named in event.actions:
                if isinstance(named.action, model.ConnectTrailerAction):
                    towers = [self._actors[name] for name in named.entities]
                    self._actors[named.action.trailer].unparted += towers
        for entity, action in in_order(self.definition.init):
            if not isinstance(action, model.SpeedAction):
                for name in sorted(referred(action)):
                    self._pose_now(name)  # refuses a place that is not known
            self.storyboard.execute(instant, action, () if entity is None else (entity,))
        if self._background is not None:
            self._background.begin(self.world, self.ego)
        added = come_later(self.definition)
        for actor in self._actors.values():
            if not actor.train().placed and actor.coupling is not None:
                actor.exists = False
            elif not actor.placed:
                if actor is self.ego or (actor.name not in added and is_used(self.definition, actor.name)):
                    raise RunError(f"entity '{actor.name}' is never given a position in Init")
                if actor.name not in added:
                    self.world.note(f"'{actor.name}' is never given a position, and nothing refers to it")
                elif not added[actor.name]:
                    self.world.note(
                        f"'{actor.name}' has no position in Init: it comes with its first teleport or "
                        "trajectory"
                    )
                actor.exists = False
        self.ego.controller = controller
        self.ego.exists = self.ego.exists and bool(self._actors)
        for actor in self._actors.values():
            actor.heed(0.0)
        check_places(self.definition, self.world.locator)
        self._now = Instant(0.0, self._actors)
        self._first_contact(self._now)
        self._process()
        self._sample(self._now)

    def _pose_now(self, name: str) -> Pose:
        actor = self._actors[name]
        if not actor.placed:
            raise RunError(f"a position refers to '{name}' before that has one")
        if not actor.exists and actor.left_pose is not None:
            return actor.left_pose
        return actor.pose(self.time_s)

    @property
    def notes(self) -> tuple[str, ...]:
        """Lines about what the file has and is not used, and what is not as it asks for it, so far."""
        return (*self.definition.notes, *self.world.notes, *map(str, self.criteria))

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """What the file judges the ego's run by (CARLA's `criteria_...`), so far."""
        driven_m = self._now.state(self.ego.name).travelled_m if self._actors else 0.0
        return self._criteria.judged(self.contact is not None, driven_m)

    # Stepping

    @property
    def over(self) -> bool:
        """Whether the storyboard has ended, or the contact that ends the run has come."""
        return self.storyboard.over or (self.until_contact and self.contact is not None)

    def advance(self, duration_s: float | None = None) -> None:
        """Move on by a duration (default: one step), or to the end of the storyboard if that comes first.

        Raises:
            RunError: an action cannot be carried out, or events start one another without end.
        """
        left_s = self.step_s if duration_s is None else duration_s
        try:
            while left_s > TOLERANCE_S and not self.over:
                steps = self._leap(int((left_s + TOLERANCE_S) / self.step_s))
                if steps == 0:
                    # sums of steps are rounded: what differs from a step by less than can be told is one
                    self._advance(self.step_s if left_s > self.step_s - TOLERANCE_S else left_s)
                left_s -= max(steps, 1) * self.step_s
        except RunError as error:
            raise RunError(f"{self.definition.path}: {error}") from None

    def _leap(self, most: int) -> int:
        """Carry out up to so many steps at once if nothing can change in them; how many (0: none).

        The same to the bit as step by step: who moves by a plan is where it is, looked at before or not, and
        who is commanded is moved in each; conditions and contacts are not looked at before they can change.
        """
        board, now_s = self.storyboard, self.time_s
        if most < 2 or board.again or board.adapts or not self._may_leap:
            return 0
        until_s = min(self._kink_s, now_s + (most + 1) * self.step_s)
        if self._background is not None:
            until_s = min(until_s, self._background.next_s)
        until_s = quiet_until_s(self._now, until_s, self._watching, self._contacts if self._meets else None)
        steps = min(most, int((until_s - FINEST_S - now_s) / self.step_s))
        ends_s: list[float] = []
        for _ in range(steps):
            now_s = round(now_s + self.step_s, TIME_DIGITS)
            ends_s.append(now_s)
        if steps < 2:
            return 0
        last = Instant(now_s, self._actors)
        if any(part.ended(last) for part in board.running):
            return 0
        commanded = [actor for actor in self._actors.values() if actor.commanded]
        if not (commanded or self._keeps_samples):
            ends_s = ends_s[-1:]
        for number, end_s in enumerate(ends_s, 1):
            last = Instant(end_s, self._actors)
            given_back = False
            for actor in commanded:
                actor.pass_on(end_s, last.state(actor.name))
                given_back = given_back or gives_back(actor, end_s)
            self._sample(last)
            if given_back:
                steps = number
                break
        if self._meets:
            self._contacts.wait(self._now, last.time_s)
        self._move(last, commanded)
        return steps

    def _advance(self, duration_s: float) -> None:
        """Move on by no more than a step."""
        end = round(self.time_s + duration_s, TIME_DIGITS)
        repeats = True
        for _ in range(MAX_SPLITS):
            if self.time_s >= end - TOLERANCE_S or self.over:
                break
            heeded = [actor.heed(self.time_s) for actor in self._driven()]
            if any(heeded) or (repeats and self.storyboard.again):
                self._process()
            repeats = False
            if self.storyboard.update(self._now):
                self._unsettle()
            if controllers.decide(self._driven(), self._now):
                self._unsettle()
            if self._background is not None and self._background.update(self._now):
                self._unsettle()
            if self._kink_s <= self.time_s + TOLERANCE_S:
                self._kink_s = self._next_kink_s()
            until = min(end, self._kink_s, self._command_s())
            if self._background is not None:
                until = min(until, self._background.next_s)
            ahead = Instant(until if until < end - TOLERANCE_S else end, self._actors)
            unsettled = [watch for watch in self._watching if watch.settled_s < ahead.time_s]
            contacts = self._contacts.may_change(self._now, ahead.time_s) if self._meets else []
            self._open = unsettled + contacts
            self._looks = 0
            change = self._first_change(self._now, ahead)
            if change is None:
                self._move(ahead)
                for watch in unsettled:
                    watch.settle(ahead)
            else:
                self._move(change)
                self._first_contact(self._now)
                self._process()
        else:
            raise RunError(f"at {self.time_s:.3f} s more than {MAX_SPLITS} changes within one step")
        self._sample(self._now)

    def _command_s(self) -> float:
        """When the next controller takes command, if that is to come."""
        times = [
            actor.controller.commands_from_s
            for actor in self._driven()
            if actor.controller is not None and not actor.commanded
        ]
        return min(times, default=math.inf)

    def _driven(self) -> Iterator[Actor]:
        """Who has a controller."""
        return (actor for actor in self._actors.values() if actor.controller is not None)

    def _move(self, instant: Instant, there: Sequence[Actor] = ()) -> None:
        """Let everybody be where an instant has them; some are there already."""
        self.time_s, self._now = instant.time_s, instant
        for actor in self._actors.values():
            if actor not in there:
                actor.pass_on(instant.time_s, instant.state(actor.name))
            if actor.unparted:
                actor.unparted = [o for o in actor.unparted if instant.gap_m(actor.name, o.name) <= 0.0]

    def _process(self) -> None:
        """Carry out what follows from a change, and note what to watch from now on."""
        self.storyboard.process(self._now)
        for actor in self._actors.values():
            if actor.profile.goes_back and actor.path.on_road and not actor.path.both_ways:
                actor.path = with_way_behind(self.world.locator.roads, actor.path)
        self._now = Instant(self.time_s, self._actors)
        self._first_contact(self._now)  # an action may have put somebody there
        self._watching = [watch for watch in self.storyboard.watches() if watch.varies]
        for watch in self._watching:
            watch.begin(self._now)
        self._meets = self.contact is None and self.ego.exists
        if self._meets:
            self._contacts.begin(self._now)
        self._kink_s = self._next_kink_s()

    def _unsettle(self) -> None:
        """Look at everything again: somebody moves in another way than before."""
        self._now = Instant(self.time_s, self._actors)
        for watch in self._watching:
            watch.unsettle()
        self._contacts.unsettle()
        self._kink_s = self._next_kink_s()

    def _next_kink_s(self) -> float:
        """The next time at which something stops to grow or to fall, or changes by the clock."""
        after = self.time_s + TOLERANCE_S
        times = [actor.next_kink_s(after) for actor in self._actors.values()]
        times += [watch.next_s(after) for watch in self._watching]
        return min(times, default=math.inf)

    # Changes inside a step

    def _first_change(self, a: Instant, b: Instant) -> Instant | None:
        """The first instant after one and up to another at which something differs; None if nothing does.

        An interval at whose ends all is the same is halved as long as something may have changed and changed
        back in it.
        """
        if self._differs(b):
            if not self._may_flip(a, b):
                # one change at most: the same before it, different after it
                return self._bisected(a.time_s, b)
            least = TOLERANCE_S
        elif self._may_flip(a, b):
            self._looks += 1
            least = FINEST_S if self._looks <= MAX_LOOKS else MANY_LOOKS_S
        else:
            return None
        if b.time_s - a.time_s <= least:
            return b if least == TOLERANCE_S else None
        # reaches shrink with the interval, so that near a value that is only approached this ends soon
        middle = Instant(0.5 * (a.time_s + b.time_s), self._actors)
        return self._first_change(a, middle) or self._first_change(middle, b)

    def _differs(self, instant: Instant) -> bool:
        """Whether something is not as it was after the last change."""
        for watch in self._open:
            if watch.changed(instant):
                return True
        for part in self.storyboard.running:  # noqa: SIM110 - asked at each step, where a generator costs twice
            if part.ended(instant):
                return True
        return False

    def _may_flip(self, a: Instant, b: Instant) -> bool:
        """Whether something that is the same at two instants may differ between them."""
        for watch in self._open:  # noqa: SIM110 - asked at each step, where a generator costs twice
            if watch.holding.flips(a, b) and not watch.changed(b):
                return True
        return False

    def _bisected(self, low_s: float, high: Instant) -> Instant:
        """The instant of a change before an instant at which something differs."""
        # nothing differs at the low end and something does at the high one, however often this is halved
        while high.time_s - low_s > TOLERANCE_S:
            middle = Instant(0.5 * (low_s + high.time_s), self._actors)
            if self._differs(middle):
                high = middle
            else:
                low_s = middle.time_s
        return high

    # Contact

    def _first_contact(self, instant: Instant) -> None:
        """Take note of the ego's first contact, if this is it."""
        if self.contact is not None or not self.ego.exists:
            return
        other = self._contacts.touched(instant)
        if other is None:
            return
        contact = contact_of(self.ego, other, instant)
        background = self._background
        if background and other.name in background.names and strikes_from_behind(self.ego, other, instant):
            self.struck += (contact,)
            other.exists = False
            return
        self.contact = contact
        self._target_at_contact = other.steady_since_s(instant.time_s)

    # Results

    def _sample(self, instant: Instant) -> None:
        if self._keeps_samples:
            states = [instant.state(name) for name in self._actors]
            self._samples.add(instant.time_s, states, [actor.exists for actor in self._actors.values()])
        if self._actors:
            self._criteria.look(instant.time_s, instant.state(self.ego.name))

    @property
    def ego_speed_mps(self) -> float:
        """The ego's speed now along its heading, negative in reverse."""
        return self._now.state(self.ego.name).speed_mps

    @property
    def entities(self) -> Entities:
        """All entities now."""
        actors, now = list(self._actors.values()), self._now
        states = [now.state(name) for name in self._actors]
        boxes = np.array([actor.box(state) for actor, state in zip(actors, states, strict=True)])
        boxes, table = boxes.reshape(-1, 5), np.array(states).reshape(-1, len(State._fields))
        return Entities(
            time_s=self.time_s,
            name=read_only(self._names),
            category=read_only(self._categories),
            reference_m=table[:, :2],
            boxes=unchecked(Boxes, boxes[:, :2], boxes[:, 2:4], boxes[:, 4]),
            speed_mps=table[:, 3],
            exists=np.array([actor.exists for actor in actors]),
            seen=np.array([actor.exists and actor.seen and not self._pulls(actor) for actor in actors]),
        )

    def _pulls(self, actor: Actor) -> bool:
        """Whether an entity is a trailer of the ego, which the ego's sensors do not take for another."""
        return actor.coupling is not None and actor.train() is self.ego.train()

    def run(self, time_limit_s: float = 120.0) -> Run:
        """Run to the end of the storyboard, or to the time limit."""
        while not self.over and self.time_s < time_limit_s - TOLERANCE_S:
            left = math.ceil((time_limit_s - TOLERANCE_S - self.time_s) / self.step_s)
            self.advance(left * self.step_s)
        return self.result()

    def result(self) -> Run:
        """What the run has come to so far."""
        contact = self.contact
        target = self._actors.get((contact.entity if contact else self.target) or "")
        steady = (
            self._target_at_contact if contact else target.steady_since_s(self.time_s) if target else None
        )
        time_s, table, exists = self._samples.columns(len(self._names))
        return Run(
            contact_time_s=contact.time_s if contact else None,
            contact_entity=contact.entity if contact else None,
            target=target.name if target else None,
            target_start_time_s=target.set_off_s if target else None,
            target_steady_time_s=steady,
            ego_speed_at_contact_kmh=3.6 * contact.ego_speed_mps if contact else None,
            target_speed_at_contact_kmh=3.6 * contact.entity_speed_mps if contact else None,
            impact_location_percent=contact.impact_location_percent if contact else None,
            end_time_s=self.time_s,
            stopped=self.over,
            names=read_only(self._names),
            time_s=time_s,
            x_m=table[..., 0],
            y_m=table[..., 1],
            yaw_rad=table[..., 2],
            speed_mps=table[..., 3],
            exists=exists,
        )
