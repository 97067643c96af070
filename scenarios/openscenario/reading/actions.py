"""Actions from XML, where their declarations alone do not say how."""

from __future__ import annotations

from typing import cast

from scenarios.openscenario.errors import ContentError, ParameterError
from scenarios.openscenario.model import (
    Action,
    AddEntityAction,
    AnimationAction,
    AssignRouteAction,
    DeleteEntityAction,
    Dimension,
    DynamicConstraints,
    Environment,
    EnvironmentAction,
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LightStateAction,
    LongitudinalDistanceAction,
    ModifyParameterAction,
    ModifyVariableAction,
    PrivateAction,
    RelativeLane,
    RelativeOffset,
    RelativeSpeed,
    SetMonitorAction,
    SetParameterAction,
    SetVariableAction,
    SignalPhaseAction,
    SignalStateAction,
    SpeedAction,
    SpeedEntry,
    SpeedProfileAction,
    SpeedShape,
    SteadyState,
    SynchronizeAction,
    TimeReference,
    VisibilityAction,
)
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.elements import Context, allow, declared, one_of, read, reads
from scenarios.openscenario.reading.parameters import typed
from scenarios.openscenario.reading.positions import position, referenced, route, trajectory

LIGHTS = (
    "daytimeRunningLights lowBeam highBeam fogLights fogLightsFront fogLightsRear brakeLights warningLights "
    "indicatorLeft indicatorRight reversingLights licensePlateIllumination specialPurposeLights"
)


def private_action(node: Node, context: Context) -> Action:
    """Action of an entity, from a PrivateAction element."""
    return cast(Action, one_of(PrivateAction, node, context))


def global_action(node: Node, context: Context) -> Action:
    """Action without actor, from a GlobalAction element."""
    child = node.one_of(
        "EnvironmentAction EntityAction VariableAction ParameterAction InfrastructureAction SetMonitorAction"
    )
    match child.tag:
        case "SetMonitorAction":
            child.allow("monitorRef value")
            context.note(child, "is not used: no condition reads a monitor")
            return SetMonitorAction(child.text("monitorRef"))
        case "EnvironmentAction":
            return EnvironmentAction(environment(referenced(child, "Environment", context), context))
        case "EntityAction":
            return _entity(child, context)
        case "ParameterAction":
            return _parameter(child)
        case "InfrastructureAction":
            return _signal(child.one_of("TrafficSignalAction"), context)
    return _variable(child, context)


def _parameter(node: Node) -> SetParameterAction | ModifyParameterAction:
    name = node.name("parameterRef")
    if name not in node.scope:
        raise ParameterError(f"{node.where} parameter '{name}' is not declared")
    child = node.one_of("SetAction ModifyAction", "parameterRef")
    if child.tag == "SetAction":
        child.allow("value")
        return SetParameterAction(name, child.value("value"))
    rule = child.need("Rule").one_of("AddValue MultiplyByValue")
    rule.allow("value")
    return ModifyParameterAction(name, "add" if rule.tag == "AddValue" else "multiply", rule.number("value"))


def _signal(node: Node, context: Context) -> SignalStateAction | SignalPhaseAction:
    child = node.one_of("TrafficSignalStateAction TrafficSignalControllerAction")
    if child.tag == "TrafficSignalStateAction":
        child.allow("name state")
        return SignalStateAction(child.text("name"), child.text("state"))
    child.allow("trafficSignalControllerRef phase", "Phase")
    return SignalPhaseAction(*context.phase(child))


@reads(SpeedAction)
def _speed(node: Node, context: Context) -> SpeedAction:
    allow(SpeedAction, node)
    dynamics = node.need("SpeedActionDynamics")
    dynamics.allow("dynamicsShape dynamicsDimension value followingMode")
    dynamics.choice("followingMode", "position follow", "position")
    shape = dynamics.choice("dynamicsShape", "step linear cubic sinusoidal")
    dimension = dynamics.choice("dynamicsDimension", "time rate distance")
    value = amount(dynamics, dimension)
    target = _speed_target(node.need("SpeedActionTarget"), context)
    lasts = context.of_carla and shape == "step" and dimension != "rate"
    return SpeedAction(cast(SpeedShape, shape), cast(Dimension, dimension), value, target, lasts)


def amount(dynamics: Node, dimension: str) -> float:
    """The value of dynamics: a duration, a distance, or a rate, whose sign follows from the change."""
    return abs(dynamics.number("value")) if dimension == "rate" else dynamics.positive("value")


def _speed_target(node: Node, context: Context) -> float | RelativeSpeed:
    target = node.one_of("AbsoluteTargetSpeed RelativeTargetSpeed")
    if target.tag == "AbsoluteTargetSpeed":
        target.allow("value")
        return target.number("value")
    target.allow("entityRef value speedTargetValueType continuous")
    kind = target.choice("speedTargetValueType", "delta factor")
    entity, continuous = context.entity(target), target.boolean("continuous")
    return RelativeSpeed(entity, target.number("value"), kind == "factor", continuous)


@reads(SpeedProfileAction)
def _speed_profile(node: Node, context: Context) -> SpeedProfileAction:
    allow(SpeedProfileAction, node)
    entries: list[SpeedEntry] = []
    for child in node.all("SpeedProfileEntry"):
        child.allow("speed time")
        time_s = child.positive("time") if child.has("time") else None
        entries.append(SpeedEntry(child.number("speed"), time_s))
    if not entries:
        raise ContentError(f"{node.where} needs at least one SpeedProfileEntry")
    limits = node.get("DynamicConstraints")
    constraints = DynamicConstraints() if limits is None else read(DynamicConstraints, limits, context)
    smooth = node.choice("followingMode", "position follow") == "follow"
    entity = context.entity(node) if node.has("entityRef") else None
    return SpeedProfileAction(entity, smooth, constraints, tuple(entries))


@reads(LaneChangeAction)
def _lane_change(node: Node, context: Context) -> LaneChangeAction:
    allow(LaneChangeAction, node)
    dynamics = node.need("LaneChangeActionDynamics")
    dynamics.allow("dynamicsShape dynamicsDimension value followingMode")
    dynamics.choice("followingMode", "position follow", "position")
    shape = dynamics.choice("dynamicsShape", "step linear cubic sinusoidal")
    dimension = dynamics.choice("dynamicsDimension", "time rate distance")
    goal = node.need("LaneChangeTarget").one_of("AbsoluteTargetLane RelativeTargetLane")
    target: int | RelativeLane
    if goal.tag == "AbsoluteTargetLane":
        goal.allow("value")
        target = goal.integer("value")
    else:
        goal.allow("entityRef value")
        lanes = goal.integer("value")
        target = RelativeLane(context.entity(goal), -lanes if context.of_carla else lanes)
    return LaneChangeAction(
        cast(SpeedShape, shape),
        cast(Dimension, dimension),
        amount(dynamics, dimension),
        target,
        sideways(node, "targetLaneOffset", context, 0.0),
    )


def sideways(node: Node, name: str, context: Context, default: float | None = None) -> float:
    """An attribute as a number to the left, which CARLA counts to the right."""
    value = node.number(name, default)
    return -value if context.of_carla else value


@reads(LaneOffsetAction)
def _lane_offset(node: Node, context: Context) -> LaneOffsetAction:
    allow(LaneOffsetAction, node)
    dynamics = node.need("LaneOffsetActionDynamics")
    dynamics.allow("dynamicsShape maxLateralAcc")
    shape = dynamics.choice("dynamicsShape", "step linear cubic sinusoidal")
    limit = dynamics.positive("maxLateralAcc", zero=False) if dynamics.has("maxLateralAcc") else None
    goal = node.need("LaneOffsetTarget").one_of("AbsoluteTargetLaneOffset RelativeTargetLaneOffset")
    target: float | RelativeOffset
    if goal.tag == "AbsoluteTargetLaneOffset":
        goal.allow("value")
        target = sideways(goal, "value", context)
    else:
        goal.allow("entityRef value")
        target = RelativeOffset(context.entity(goal), sideways(goal, "value", context))
    return LaneOffsetAction(cast(SpeedShape, shape), limit, target, node.boolean("continuous"))


@reads(LongitudinalDistanceAction)
def _distance(node: Node, context: Context) -> LongitudinalDistanceAction:
    allow(LongitudinalDistanceAction, node)
    if node.has("distance") == node.has("timeGap"):
        raise ContentError(f"{node.where} needs either 'distance' or 'timeGap'")
    limits = node.get("DynamicConstraints")
    for name in ("maxAcceleration", "maxDeceleration"):
        if limits is not None and limits.has(name):
            limits.positive(name, zero=False)  # who can not speed up or slow down can not take up a distance
    return declared(LongitudinalDistanceAction, node, context)


@reads(SynchronizeAction)
def _synchronize(node: Node, context: Context) -> SynchronizeAction:
    allow(SynchronizeAction, node)
    node.positive("targetToleranceMaster", 0.0)  # both arrive at the same instant: within any tolerance
    tolerance_m = node.positive("targetTolerance", 0.0)
    speed: float | RelativeSpeed | None = None
    steady: SteadyState | None = None
    final = node.get("FinalSpeed")
    if final is not None:
        kind = final.one_of("AbsoluteSpeed RelativeSpeedToMaster")
        states = "TargetDistanceSteadyState TargetTimeSteadyState"
        if kind.tag == "AbsoluteSpeed":
            kind.allow("value", states)
            speed = kind.positive("value")
        else:
            kind.allow("value speedTargetValueType", states)
            factor = kind.choice("speedTargetValueType", "delta factor") == "factor"
            speed = RelativeSpeed(context.entity(node, "masterEntityRef"), kind.number("value"), factor)
        distance, time = kind.get("TargetDistanceSteadyState"), kind.get("TargetTimeSteadyState")
        if distance is not None and time is not None:
            raise ContentError(f"{time.where} stands beside TargetDistanceSteadyState; give one")
        if distance is not None:
            distance.allow("distance")
            steady = SteadyState(distance.positive("distance"), None)
        elif time is not None:
            time.allow("time")
            steady = SteadyState(None, time.positive("time"))
    return SynchronizeAction(
        context.entity(node, "masterEntityRef"),
        position(node.need("TargetPositionMaster"), context),
        position(node.need("TargetPosition"), context),
        speed,
        steady,
        tolerance_m,
    )


@reads(FollowTrajectoryAction)
def _follow_trajectory(node: Node, context: Context) -> FollowTrajectoryAction:
    allow(FollowTrajectoryAction, node)
    mode = node.need("TrajectoryFollowingMode")
    mode.allow("followingMode")
    steers = mode.choice("followingMode", "position follow") == "follow"
    reference = node.get("TrajectoryRef")
    if reference is None:  # 1.0: the trajectory or its catalog reference stands in the action itself
        reference = node.without("TimeReference TrajectoryFollowingMode")
    times = node.get("TimeReference")
    curve = trajectory(reference, context, timed=times is not None and times.get("Timing") is not None)
    initial_distance_m = node.positive("initialDistanceOffset", 0.0)
    timing = node.need("TimeReference").one_of("None Timing")
    by_time = None if timing.tag == "None" else read(TimeReference, timing, context)
    if by_time is not None and not curve.shape.has_times:
        context.note(
            timing, f"is not used: trajectory '{curve.name}' has no times; the entity's speed counts"
        )
        by_time = None
    return FollowTrajectoryAction(curve, initial_distance_m, by_time, steers)


@reads(VisibilityAction)
def _visibility(node: Node, context: Context) -> VisibilityAction:
    node.allow("graphics sensors traffic", "SensorReferenceSet")
    if node.get("SensorReferenceSet") is not None:
        context.note(node, "names sensors: it holds for all that the ego has")
    return declared(VisibilityAction, node, context)


@reads(AssignRouteAction)
def _assign_route(node: Node, context: Context) -> AssignRouteAction:
    return AssignRouteAction(route(node, context))


@reads(LightStateAction)
def _light(node: Node, context: Context) -> LightStateAction:
    allow(LightStateAction, node)
    light = node.need("LightType").one_of("VehicleLight UserDefinedLight")
    own = light.tag == "UserDefinedLight"
    light.allow("userDefinedLightType" if own else "vehicleLightType")
    state = node.need("LightState")
    state.allow("mode luminousIntensity flashingOnDuration flashingOffDuration", "Color")
    name = light.text("userDefinedLightType") if own else light.choice("vehicleLightType", LIGHTS)
    return LightStateAction(name, state.choice("mode", "on off flashing"))


@reads(AnimationAction)
def _animation(node: Node, context: Context) -> AnimationAction:
    allow(AnimationAction, node)
    context.note(node, "is not shown: of it the duration alone is carried out")
    return declared(AnimationAction, node, context)


def environment(node: Node, context: Context) -> Environment:
    """Light and weather from an Environment element."""
    node.allow("name", "ParameterDeclarations TimeOfDay Weather RoadCondition")
    values: dict[str, float | str | bool] = {}
    day = node.get("TimeOfDay")
    if day is not None:
        day.allow("animation dateTime")
        try:
            values["time_of_day_s"] = day.date_time("dateTime")
            values["time_goes_on"] = day.boolean("animation")
        except ContentError as error:
            context.note(day, f"is not used: {str(error).removeprefix(day.where).strip()}")
    weather = node.get("Weather")
    if weather is not None:
        weather.allow(
            "cloudState fractionalCloudCover atmosphericPressure temperature",
            "Sun Fog Precipitation Wind DomeImage",
        )
        sun, fog, rain = weather.get("Sun"), weather.get("Fog"), weather.get("Precipitation")
        if sun is not None:
            sun.allow("elevation azimuth illuminance intensity")
            elevation = sun.number("elevation")
            name = next((name for name in ("illuminance", "intensity") if sun.has(name)), None)
            if name is not None:  # 1.2 and later: neither has to be there
                light = sun.positive(name)
                # CARLA's files of 1.0 give the intensity as a share of full sunlight
                if name == "illuminance" or light > 1.0 or elevation <= 0.0:
                    values["illuminance_lx"] = light
            values["sun_elevation_rad"] = elevation
        if fog is not None:
            fog.allow("visualRange", "BoundingBox")
            values["visual_range_m"] = fog.positive("visualRange")
        if rain is not None:
            rain.allow("precipitationType intensity precipitationIntensity")
            values["precipitation"] = rain.choice("precipitationType", "dry rain snow")
            if rain.has("precipitationIntensity"):
                values["precipitation_mm_h"] = rain.positive("precipitationIntensity")
            elif (
                rain.has("intensity") and rain.positive("intensity") == 0.0
            ):  # 1.0 has a share of an unknown greatest intensity
                values["precipitation_mm_h"] = 0.0
    road = node.get("RoadCondition")
    if road is not None:
        road.allow("frictionScaleFactor wetness", "Properties")
        values["friction_scale"] = road.positive("frictionScaleFactor")
        if road.has("wetness"):
            values["wetness"] = road.choice("wetness", "dry moist wetWithPuddles lowFlooded highFlooded")
    return Environment(node.text("name"), **values)  # type: ignore[arg-type]


def _entity(node: Node, context: Context) -> AddEntityAction | DeleteEntityAction:
    child = node.one_of("AddEntityAction DeleteEntityAction", "entityRef")
    if child.tag == "DeleteEntityAction":
        child.allow()
        return DeleteEntityAction(context.entity(node))
    child.allow(children="Position")
    return AddEntityAction(context.entity(node), position(child.need("Position"), context))


def _variable(node: Node, context: Context) -> SetVariableAction | ModifyVariableAction:
    name = context.variable(node)
    child = node.one_of("SetAction ModifyAction", "variableRef")
    if child.tag == "SetAction":
        child.allow("value")
        start = context.variables[name]
        kind = "boolean" if isinstance(start, bool) else "double" if isinstance(start, float) else "string"
        try:
            return SetVariableAction(name, typed(child.value("value"), kind))
        except ParameterError as error:
            raise ParameterError(f"{child.where} of '{name}': {error}") from None
    rule = child.need("Rule").one_of("AddValue MultiplyByValue")
    rule.allow("value")
    return ModifyVariableAction(name, "add" if rule.tag == "AddValue" else "multiply", rule.number("value"))
