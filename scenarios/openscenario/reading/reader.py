"""OpenSCENARIO XML 1.0 to 1.3: a file and parameter values become a `ScenarioDefinition`.

Everything is read, resolved and checked before a run starts. What a file uses and the engine does not carry
out is refused with file, line and element.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path

from scenarios.openscenario.errors import ContentError, FileReadError, ParameterError, UnsupportedError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model import (
    Act,
    Action,
    Event,
    Maneuver,
    ManeuverGroup,
    NamedAction,
    ScenarioDefinition,
    SignalController,
    SignalPhase,
    Story,
    TrafficSignalCondition,
)
from scenarios.openscenario.reading import carla
from scenarios.openscenario.reading.actions import global_action, private_action
from scenarios.openscenario.reading.catalogs import Catalogs
from scenarios.openscenario.reading.conditions import entity_references, stop_trigger, trigger
from scenarios.openscenario.reading.document import MINOR, Node, parse
from scenarios.openscenario.reading.elements import Context
from scenarios.openscenario.reading.entities import scenario_objects, selections
from scenarios.openscenario.reading.parameters import Declarations, variables
from scenarios.openscenario.reading.positions import scoped
from scenarios.openscenario.reading.references import qualified

NEWEST_MINOR = 3
"""Of the versions 1.x that are known. What a later one adds is refused by name, as whatever is not known."""


def load(
    path: str | PathLike[str],
    parameters: Mapping[str, Value] | None = None,
    road: str | PathLike[str] | None = None,
) -> ScenarioDefinition:
    """Read a scenario.

    Args:
        path: the `.xosc` file.
        parameters: values in place of the declared ones, as text, number or truth value.
        road: OpenDRIVE file in place of one that is not there, or a folder with files by the names of levels
            (CARLA's scenarios name Town01, not a file).

    Raises:
        FileReadError: a file cannot be read or is no scenario.
        ParameterError: a parameter is unknown, circular, of the wrong type, or breaks its constraints.
        ContentError: something is missing or impossible.
        UnsupportedError: something is not known or not carried out by this engine.
        CatalogError: a catalog or an entry of it is missing.
        ExpressionError: an expression has no value.
    """
    file = Path(path)
    root = Node(parse(file), file, {})
    if root.get("ParameterValueDistribution") is not None:
        raise FileReadError(f"{file}: holds parameter variations, not a scenario; expand it first")
    if root.get("Catalog") is not None:
        raise FileReadError(f"{file}: holds a catalog, not a scenario")
    root.allow(
        "noNamespaceSchemaLocation",
        "FileHeader ParameterDeclarations VariableDeclarations MonitorDeclarations CatalogLocations "
        "RoadNetwork Entities Storyboard",
    )
    header = root.need("FileHeader")
    header.allow("revMajor revMinor date author description", "License Properties")
    try:
        notes: dict[str, None] = {}
        declared = Declarations(root.get("ParameterDeclarations"), parameters or {}, {}, notes)
    except ParameterError as error:
        raise ParameterError(
            f"{file}: {error}" if str(error).startswith("parameter ") else str(error)
        ) from None
    scope = declared.scope()
    root = root.within(scope)
    start_values = variables(root.get("VariableDeclarations"))
    catalogs = Catalogs(root.get("CatalogLocations"))
    catalogs.notes |= notes
    given = header.element.get("revMinor", "")
    digits = MINOR.match(given)
    minor = int(digits.group()) if digits else 0
    if minor > NEWEST_MINOR or str(minor) != given:
        read_as = min(minor, NEWEST_MINOR)
        catalogs.notes[f"{header.where} version 1.{given} is read as 1.{read_as}"] = None
    of_carla = header.text("description", "").startswith(carla.MARK)
    if of_carla:
        catalogs.notes[
            f"{header.where} description begins with '{carla.MARK}': y and offsets are to the right, "
            "headings clockwise; as in ScenarioRunner conditions have no edge and stay met, no event stops "
            "another, and a step lasts as long as its value says"
        ] = None
    bare = Context(catalogs, (), start_values, catalogs.notes, of_carla)
    there = root.need("Entities")
    there.allow(children="ScenarioObject EntitySelection")
    objects = there.all("ScenarioObject")
    if not objects:
        bare.note(there, "is empty: there is no road user, and nothing can meet")
    entities = scenario_objects(objects, bare)
    names = [entity.name for entity in entities]
    chosen = selections(there.all("EntitySelection"), entities)
    signals, grouped = _signals(root.need("RoadNetwork").get("TrafficSignals"))
    phases = {held.name: tuple(phase.name for phase in held.phases) for held in signals}
    context = Context(catalogs, names, start_values, catalogs.notes, of_carla, chosen, phases)
    storyboard = root.need("Storyboard")
    storyboard.allow(children="Init Story StopTrigger")
    stories = tuple(_story(node, context) for node in storyboard.all("Story"))
    stop, criteria = stop_trigger(storyboard.get("StopTrigger"), context)
    stories = qualified(file, stories, stop)
    map_path = _map_path(root.need("RoadNetwork"), None if road is None else Path(road))
    init = tuple(_init(storyboard.need("Init"), context))
    catalogs.note_missing()
    definition = ScenarioDefinition(
        path=file,
        description=header.text("description", ""),
        parameters=dict(scope),
        variables=start_values,
        map_path=map_path,
        entities=entities,
        init=init,
        stories=stories,
        stop=stop,
        files=(file, *catalogs.files, *(() if map_path is None else (map_path,))),
        notes=tuple(catalogs.notes),
        criteria=criteria,
        signals=signals,
    )
    asked = any(isinstance(condition.kind, TrafficSignalCondition) for condition in definition.conditions())
    if grouped is None:
        return definition
    if asked:
        raise UnsupportedError(
            f"{grouped.where} is not supported where a TrafficSignalCondition asks what a signal shows; "
            "give a TrafficSignalState for each signal"
        )
    return replace(definition, notes=(*definition.notes, f"{grouped.where} is not used: {GROUP}"))


def _map_path(node: Node, road: Path | None) -> Path | None:
    """The road network; None: the scenario takes place on a plane."""
    node.allow(children="LogicFile SceneGraphFile TrafficSignals UsedArea")
    file = node.get("LogicFile")
    if file is None:
        return None
    file.allow("filepath")
    if not file.text("filepath").strip():
        return road if road is not None and road.is_file() else None
    path = file.path("filepath")
    if path.is_file():
        return path
    level = path.name if path.suffix == ".xodr" else f"{path.name}.xodr"
    places = [path.with_name(level)]
    if road is not None:
        places.insert(0, road / level if road.is_dir() else road)
    for place in places:
        if place.is_file():
            return place
    raise FileReadError(
        f"{file.where} road network {path} does not exist; give its file, or a folder with {level}, by --road"
    )


GROUP = "which signals are of the group, the file does not say"


def _signals(node: Node | None) -> tuple[tuple[SignalController, ...], Node | None]:
    """Controllers of traffic signals, and the first state that a file gives to a group of them."""
    controllers: list[SignalController] = []
    grouped: Node | None = None
    if node is None:
        return (), None
    node.allow(children="TrafficSignalController")
    for child in node.all("TrafficSignalController"):
        child.allow("name delay reference", "Phase")
        phases: list[SignalPhase] = []
        for phase in child.all("Phase"):
            phase.allow("name duration", "TrafficSignalState TrafficSignalGroupState")
            grouped = grouped or phase.get("TrafficSignalGroupState")
            states = _signal_states(phase)
            phases.append(SignalPhase(phase.text("name"), phase.positive("duration"), states))
        reference = child.text("reference") if child.has("reference") else None
        controllers.append(
            SignalController(child.text("name"), child.positive("delay", 0.0), reference, tuple(phases))
        )
    by_name: dict[str, SignalController] = {}
    for held in controllers:
        if by_name.setdefault(held.name, held) is not held:
            raise ContentError(f"{node.where} has two controllers of the name '{held.name}'")
    for held in controllers:
        chain = [held.name]
        while (name := by_name[chain[-1]].reference) is not None:
            if name not in by_name:
                raise ContentError(f"{node.where} '{chain[-1]}' refers to '{name}', which is none")
            if name in chain:
                raise ContentError(f"{node.where} '{chain[-1]}' refers to '{name}', which waits for it")
            chain.append(name)
    return tuple(controllers), grouped


def _signal_states(phase: Node) -> tuple[tuple[str, str], ...]:
    """What each signal shows in a phase."""
    states: dict[str, str] = {}
    for child in phase.all("TrafficSignalState"):
        signal, state = child.text("trafficSignalId"), child.text("state")
        if not state.strip():
            raise ContentError(f"{child.where} state: expected a word for what '{signal}' shows, got ''")
        if states.setdefault(signal, state) != state:
            raise ContentError(f"{child.where} '{signal}' shows '{states[signal]}' in this phase already")
    return tuple(states.items())


# Storyboard


def _init(node: Node, context: Context) -> list[tuple[str | None, Action]]:
    node.allow(children="Actions")
    actions = node.need("Actions")
    actions.allow(children="GlobalAction Private")
    initial: list[tuple[str | None, Action]] = []
    for child in actions:
        if child.tag == "GlobalAction":
            initial.append((None, global_action(child, context)))
            continue
        child.allow("entityRef", "PrivateAction")
        for entity in context.members(child):
            initial.extend((entity, private_action(action, context)) for action in child)
    return initial


def _story(node: Node, context: Context) -> Story:
    node.allow("name", "ParameterDeclarations Act")
    inner = scoped(node)
    return Story(node.text("name"), tuple(_act(child, context) for child in inner.all("Act")))


def _act(node: Node, context: Context) -> Act:
    node.allow("name maximumExecutionCount", "ManeuverGroup StartTrigger StopTrigger")
    if node.has("maximumExecutionCount"):  # from before 1.0; an act takes place once
        if node.integer("maximumExecutionCount") != 1:
            raise UnsupportedError(f"{node.where} maximumExecutionCount is not supported; leave it out")
        context.note(node, "maximumExecutionCount is not used: an Act takes place once")
    return Act(
        node.text("name"),
        tuple(_group(child, context) for child in node.all("ManeuverGroup")),
        trigger(node.get("StartTrigger"), context),
        trigger(node.get("StopTrigger"), context),
    )


def _group(node: Node, context: Context) -> ManeuverGroup:
    node.allow("name maximumExecutionCount", "Actors CatalogReference Maneuver")
    actors = node.need("Actors")
    actors.allow("selectTriggeringEntities", "EntityRef")
    select = actors.boolean("selectTriggeringEntities")
    entities = entity_references(actors, context)
    maneuvers: list[Maneuver] = []
    for child in node:
        if child.tag == "CatalogReference":
            entry = context.catalogs.entry(child, "Maneuver")
            maneuvers.append(_maneuver(entry, entities, select, context))
        elif child.tag == "Maneuver":
            maneuvers.append(_maneuver(scoped(child), entities, select, context))
    return ManeuverGroup(node.text("name"), _count(node, context), tuple(maneuvers))


NO_LIMIT = 2**31 - 1
"""Of executions: the greatest number that the attribute can have."""


def _count(node: Node, context: Context) -> int:
    count = node.integer("maximumExecutionCount", 1)
    if count == -1:  # as in esmini's files
        context.note(node, "maximumExecutionCount -1 is taken as no limit")
        return NO_LIMIT
    if count < 1:
        raise ContentError(f"{node.where} maximumExecutionCount: expected 1 or more, got {count}")
    return count


def _maneuver(node: Node, entities: tuple[str, ...], select: bool, context: Context) -> Maneuver:
    node.allow("name", "ParameterDeclarations Event")
    events = [_event(child, entities, select, context) for child in node.all("Event")]
    return Maneuver(node.text("name"), tuple(events))


def _event(node: Node, entities: tuple[str, ...], select: bool, context: Context) -> Event:
    node.allow("name priority maximumExecutionCount", "Action StartTrigger")
    actions: list[NamedAction] = []
    for child in node.all("Action"):
        if not len(list(child)):
            child.allow("name")
            context.note(child, "has no action: it does nothing")
            continue
        kind = child.one_of("GlobalAction PrivateAction", "name")
        if kind.tag == "GlobalAction":
            actions.append(NamedAction(child.text("name"), global_action(kind, context), ()))
            continue
        if not entities and not select:
            raise ContentError(f"{kind.where} needs an actor, and its ManeuverGroup names none")
        actions.append(NamedAction(child.text("name"), private_action(kind, context), entities, True))
    if not node.all("Action"):
        raise ContentError(f"{node.where} needs at least one Action")
    priority = node.choice("priority", "override overwrite parallel skip")
    priority = "parallel" if context.of_carla else priority
    return Event(
        node.text("name"),
        "override" if priority == "overwrite" else priority,
        _count(node, context),
        tuple(actions),
        trigger(node.get("StartTrigger"), context),
        select,
    )
