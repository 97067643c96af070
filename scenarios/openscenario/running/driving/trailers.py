"""Trailers: coupled at the start, connected and let go of by actions."""

from __future__ import annotations

import math

from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.paths import Pose
from scenarios.openscenario.running import following
from scenarios.openscenario.running.actions import RunningAction
from scenarios.openscenario.running.actors import Actor, Coupling
from scenarios.openscenario.running.world import World

REACH_M = 0.5
"""A trailer that is connected moves onto the hitch; over a longer way that is noted."""


def moves_itself(action: model.Action) -> bool:
    """Whether an action moves the entity, which a trailer that is towed cannot do."""
    return not isinstance(
        action,
        model.VisibilityAction
        | model.LightStateAction
        | model.AnimationAction
        | model.ControllerAction
        | model.ActivateControllerAction
        | model.ConnectTrailerAction
        | model.DisconnectTrailerAction,
    )


def couple_all(world: World) -> None:
    """Couple the trailers of the start, each straight behind its towing vehicle."""
    for actor in world.actors.values():
        trailer = actor.definition.trailer
        if trailer is not None:
            coupling = _coupling(actor, world.actors[trailer])
            world.actors[trailer].couple(0.0, coupling, coupling.behind(actor.state(0.0).pose))


def _coupling(tower: Actor, trailer: Actor) -> Coupling:
    hitch_m, coupler_m = tower.definition.hitch_m, trailer.definition.coupler_m
    if hitch_m is None or coupler_m is None or coupler_m <= 0.0:
        raise RunError(
            f"'{trailer.name}' cannot be coupled to '{tower.name}': a TrailerHitch there and a "
            "TrailerCoupler with dx > 0 here are needed"
        )
    return Coupling(tower, hitch_m, coupler_m)


class TrailerChange(RunningAction["model.ConnectTrailerAction | model.DisconnectTrailerAction"]):
    """ConnectTrailerAction and DisconnectTrailerAction, over at once."""

    def start(self, time_s: float) -> None:
        """Couple the trailer, which keeps its heading; or let go of it, whatever it is."""
        if isinstance(self.action, model.ConnectTrailerAction):
            self._connect(time_s, self.world.actors[self.action.trailer])
            return
        trailer = self.who.trailer
        if trailer is None:
            self.world.note(f"'{self.who.name}' is to let go of a trailer and has none")
            return
        trailer.uncouple(time_s)
        following.go_on(trailer, self.world, time_s)

    def _connect(self, time_s: float, trailer: Actor) -> None:
        tower = self.who
        if tower.trailer is not None or trailer.coupling is not None or tower.train() is trailer:
            raise RunError(
                f"'{trailer.name}' cannot be coupled to '{tower.name}': one of them already is coupled"
            )
        coupling = _coupling(tower, trailer)
        x, y = coupling.hitch(tower.state(time_s).pose)
        state = trailer.state(time_s)
        coupler = state.pose.moved(coupling.coupler_m, 0.0)
        apart_m = math.dist((x, y), (coupler.x_m, coupler.y_m))
        if apart_m > REACH_M:
            self.world.note(
                f"'{trailer.name}' is coupled to '{tower.name}' from {apart_m:.2f} m away: it jumps there"
            )
        pose = Pose(x, y, state.yaw_rad).moved(-coupling.coupler_m, 0.0)
        trailer.couple(time_s, coupling, pose)
