"""Road users, obstacles, light and weather."""

from __future__ import annotations

from typing import Annotated

from scenarios.openscenario.elements import Attribute, Element


class Performance(
    Element, attributes="maxSpeed maxAcceleration maxDeceleration maxAccelerationRate maxDecelerationRate"
):
    """Limits of a vehicle, none of them negative."""

    max_speed_mps: Annotated[float, Attribute("maxSpeed", sign="not negative")]
    max_acceleration_mps2: Annotated[float, Attribute("maxAcceleration", sign="not negative")]
    max_deceleration_mps2: Annotated[float, Attribute("maxDeceleration", sign="not negative")]


class Controller(Element):
    """A controller as a file describes it: a name, and properties that only its makers know."""

    name: str
    properties: tuple[tuple[str, str], ...] = ()


class EntityDefinition(Element):
    """A road user or obstacle. The reference point of a vehicle is the middle of its rear axle on the ground.

    Args:
        name: in the scenario.
        model: name of the vehicle, pedestrian or object.
        category: one of the detection categories.
        length_m, width_m, height_m: bounding box.
        center_x_m, center_y_m: centre of the box in front of and to the left of the reference point.
        performance: what a vehicle can do, if the file says so.
        controllers: those that the file gives it from the start, none of them active.
        flat: whether it is part of the road's surface, so that driving over it is no contact.
        hitch_m: of the hitch from the reference point, forward; None: there is none.
        coupler_m: of a trailer's coupler, the same.
        trailer: name of the trailer that is coupled at the start; None: none is.
        object_type: vehicle, pedestrian or miscellaneous.
    """

    name: str
    model: str
    category: str
    length_m: float
    width_m: float
    height_m: float
    center_x_m: float
    center_y_m: float
    performance: Performance | None = None
    controllers: tuple[Controller, ...] = ()
    flat: bool = False
    hitch_m: float | None = None
    coupler_m: float | None = None
    trailer: str | None = None
    object_type: str = "vehicle"


class SignalPhase(Element):
    """A phase of a controller of traffic signals: how long it lasts, and what the signals show."""

    name: str
    duration_s: float
    states: tuple[tuple[str, str], ...]


class SignalController(Element):
    """Traffic signals that go through phases again and again.

    `delay_s` counts from the start of the controller `reference`, or from that of the run.
    """

    name: str
    delay_s: float
    reference: str | None
    phases: tuple[SignalPhase, ...]


class Environment(Element):
    """Light and weather as far as the file gives them.

    Args:
        name: of the environment.
        illuminance_lx: of the sun (in night environments: of the moon).
        sun_elevation_rad: over the horizon.
        precipitation: dry, rain or snow.
        precipitation_mm_h: intensity; None in version 1.0, which gives a number from 0 to 1 without unit,
            unless that is 0.
        visual_range_m: in fog.
        friction_scale: factor on the road's friction.
        wetness: of the road: dry, moist, wetWithPuddles, lowFlooded or highFlooded.
        time_of_day_s: when the environment is set, in seconds since 1970; None: the file does not say.
        time_goes_on: whether the time of day goes on with the time of the run.
    """

    name: str
    illuminance_lx: float | None = None
    sun_elevation_rad: float | None = None
    precipitation: str | None = None
    precipitation_mm_h: float | None = None
    visual_range_m: float | None = None
    friction_scale: float | None = None
    wetness: str | None = None
    time_of_day_s: float | None = None
    time_goes_on: bool = False
