"""Road users and obstacles from XML, with the trailers that are coupled to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scenarios.openscenario.errors import ContentError
from scenarios.openscenario.model import Controller, EntityDefinition, Performance
from scenarios.openscenario.reading.controllers import controller
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.elements import Context, read
from scenarios.openscenario.reading.positions import scoped

_VEHICLES = {
    "car": "car",
    "van": "car",
    "truck": "truck",
    "trailer": "truck",
    "semitrailer": "truck",
    "bus": "truck",
    "motorbike": "motorcycle",
    "bicycle": "cyclist",
    "train": "unknown",
    "tram": "unknown",
    "microMobility": "cyclist",
    "standupScooter": "cyclist",
    "wheelchair": "pedestrian",
}
_PEDESTRIANS = {"pedestrian": "pedestrian", "wheelchair": "pedestrian", "animal": "unknown"}
"""OpenSCENARIO's categories in terms of the detection categories."""


KINDS = "Vehicle Pedestrian MiscObject"


def scenario_objects(nodes: Sequence[Node], context: Context) -> tuple[EntityDefinition, ...]:
    """Entities of a scenario: each, and after it the trailers that its description holds.

    Args:
        nodes: the ScenarioObject elements.
        context: catalogs and notes.

    Raises:
        ContentError: two have the same name, or a trailer cannot be coupled.
    """
    entities: list[EntityDefinition] = []
    for node in nodes:
        entities += _entity(node, context, taken=[entity.name for entity in entities])
    names = [entity.name for entity in entities]
    for name in names:
        if names.count(name) > 1:
            raise ContentError(f"{nodes[0].where} two entities have the same name, '{name}'")
    if nodes:
        _coupled(entities, nodes[0].where)
    return tuple(entities)


def _entity(
    node: Node, context: Context, taken: Sequence[str], within: Sequence[tuple[str, str]] = ()
) -> list[EntityDefinition]:
    """An entity and the trailers in its description, which is `within` entries of catalogs."""
    name = node.text("name")
    kinds = KINDS
    node.allow("name", f"CatalogReference {kinds} ObjectController")
    child = node.without("ObjectController").one_of(f"CatalogReference {kinds}")
    controllers = tuple(controller(held, context) for held in node.all("ObjectController") if any(held))
    if child.tag == "CatalogReference":
        key = child.text("catalogName"), child.text("entryName")
        if key in within:
            raise ContentError(f"{child.where} the trailer of '{key[1]}' is that entry itself, without end")
        within, entry = (*within, key), context.catalogs.entry(child, kinds)
    else:
        entry = scoped(child)
    entity = _object(name, entry, context, controllers)
    trailer = entry.get("Trailer")
    inner = None
    if trailer is not None:
        trailer.allow(children="Trailer TrailerRef")
        reference, inner = trailer.get("TrailerRef"), trailer.get("Trailer")
        if reference is not None:
            entity = replace(entity, trailer=reference.text("entityRef", "") or None)
    hitch = entry.get("TrailerHitch")
    connects = node.element.getroottree().find(".//ConnectTrailerAction") is not None
    if hitch is not None and inner is None and entity.trailer is None and not connects:
        context.note(hitch, f"of '{name}' is not used: no trailer is coupled")
    if inner is None:
        return [entity]
    towed = _entity(_named(inner, name, taken), context, (*taken, name), within)
    return [replace(entity, trailer=towed[0].name), *towed]


def _named(trailer: Node, tower: str, taken: Sequence[str]) -> Node:
    """A trailer by its name, or, where another has that, with the name of its towing vehicle before it."""
    name = trailer.text("name", "trailer")
    node = trailer.without("")
    node.element.set("name", f"{tower}.{name}" if name in (tower, *taken) else name)
    return node


def _object(
    name: str, node: Node, context: Context, controllers: tuple[Controller, ...] = ()
) -> EntityDefinition:
    if node.tag == "Vehicle":
        node.allow(
            "name vehicleCategory mass role model3d",
            "ParameterDeclarations BoundingBox Performance Axles Properties "
            "TrailerHitch TrailerCoupler Trailer",
        )
        for tag in ("TrailerHitch", "TrailerCoupler"):
            part = node.get(tag)
            if part is not None:
                part.allow("dx dz")
        category = _VEHICLES[node.choice("vehicleCategory", " ".join(_VEHICLES))]
    elif node.tag == "Pedestrian":
        node.allow(
            "name pedestrianCategory mass model model3d role", "ParameterDeclarations BoundingBox Properties"
        )
        category = _PEDESTRIANS[node.choice("pedestrianCategory", " ".join(_PEDESTRIANS))]
    else:
        node.allow("name miscObjectCategory mass model3d", "ParameterDeclarations BoundingBox Properties")
        category = "unknown"
    box = node.need("BoundingBox")
    box.allow(children="Center Dimensions")
    center, size = box.need("Center"), box.need("Dimensions")
    center.allow("x y z")
    size.allow("length width height")
    limits = node.get("Performance")
    return EntityDefinition(
        name=name,
        model=node.text("name"),
        category=category,
        length_m=_extent(size, "length", name, context),
        width_m=_extent(size, "width", name, context),
        height_m=size.positive("height"),
        center_x_m=center.number("x"),
        center_y_m=center.number("y"),
        performance=None if limits is None else read(Performance, limits, context),
        controllers=controllers,
        flat=node.tag == "MiscObject" and node.text("miscObjectCategory", "") in _FLAT,
        hitch_m=_forward(node.get("TrailerHitch")),
        coupler_m=_forward(node.get("TrailerCoupler")),
        object_type={"Vehicle": "vehicle", "Pedestrian": "pedestrian"}.get(node.tag, "miscellaneous"),
    )


def _forward(node: Node | None) -> float | None:
    return None if node is None else node.number("dx")


LEAST_M = 0.01
"""An outline that has no extent in the file (the standard allows 0) gets this one: outlines have an area."""


def _extent(size: Node, attribute: str, name: str, context: Context) -> float:
    extent_m = size.positive(attribute)
    if extent_m == 0.0:
        context.note(size, f"of '{name}' has {attribute} 0: it is taken for {LEAST_M:g} m")
    return max(extent_m, LEAST_M)


_FLAT = ("crosswalk", "parkingSpace", "patch", "roadMark")
"""Categories of what lies in the road's surface: marks, and a patch of other material."""


# Trailers


def _coupled(entities: list[EntityDefinition], where: str) -> None:
    """Check the couplings of entities with their trailers.

    Raises:
        ContentError: a trailer is not there, has two towing vehicles or tows itself, or a part is missing.
    """
    by_name = {entity.name: entity for entity in entities}
    towers: dict[str, str] = {}
    for entity in entities:
        if entity.trailer is None:
            continue
        trailer = by_name.get(entity.trailer)
        if trailer is None:
            raise ContentError(f"{where} the trailer '{entity.trailer}' of '{entity.name}' is no entity")
        check_coupling(entity, trailer, where)
        if trailer.name in towers:
            pair = f"'{towers[trailer.name]}' and '{entity.name}'"
            raise ContentError(f"{where} '{trailer.name}' is the trailer of {pair}")
        towers[trailer.name] = entity.name
        front: str | None = entity.name
        while front is not None:
            if front == trailer.name:
                raise ContentError(f"{where} '{trailer.name}' is towed by itself")
            front = towers.get(front)


def check_coupling(tower: EntityDefinition, trailer: EntityDefinition, where: str) -> None:
    """Find out whether a trailer can be coupled.

    Raises:
        ContentError: there is no hitch or no coupler, or it is not ahead of the trailer's axle.
    """
    if tower.hitch_m is None:
        raise ContentError(f"{where} '{tower.name}' has a trailer and no TrailerHitch")
    if trailer.coupler_m is None or trailer.coupler_m <= 0.0:
        raise ContentError(
            f"{where} '{trailer.name}' is a trailer and has no TrailerCoupler ahead of its axle (dx > 0)"
        )


def selections(nodes: Sequence[Node], entities: Sequence[EntityDefinition]) -> dict[str, tuple[str, ...]]:
    """Names of the entities of each EntitySelection, by its name.

    Raises:
        ContentError: a name is there twice, or a member is no entity.
    """
    names = [entity.name for entity in entities]
    chosen: dict[str, tuple[str, ...]] = {}
    for node in nodes:
        node.allow("name", "Members")
        name, members = node.text("name"), list[str]()
        if name in names or name in chosen:
            raise ContentError(f"{node.where} name: '{name}' is there already")
        for child in node.need("Members").some("EntityRef ByType ByObjectType"):
            if child.tag == "EntityRef":
                child.allow("entityRef")
                if child.text("entityRef") not in names:
                    raise ContentError(
                        f"{child.where} entityRef: no entity '{child.text('entityRef')}'; "
                        f"entities: {', '.join(names)}"
                    )
                members.append(child.text("entityRef"))
                continue
            attribute = "objectType" if child.tag == "ByType" else "type"
            child.allow(attribute)
            kind = child.choice(attribute, "vehicle pedestrian miscellaneous")
            members += [entity.name for entity in entities if entity.object_type == kind]
        chosen[name] = tuple(dict.fromkeys(members))
    return chosen
