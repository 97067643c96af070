"""Lane layers (since ASAM OpenDRIVE 1.9): one layer of lanes per road, before anything else is read.

A road may have several `<lanes>`, each of a layer. Lanes of another layer than the permanent one hold from
their first lane section to the end of the road, and links between lanes name the layer that they lead to.
Here one `<lanes>` per road is put together, with the links that lead to lanes of it; the others stay behind
it as text.
"""

from copy import deepcopy

from lxml import etree

from opendrive.errors import WarningKind
from opendrive.xml.values import Element, Values, children, first

PERMANENT = "permanent"


def choose_layer(values: Values, root: Element, layer: str) -> None:
    """Leave, for every road, the lanes of a layer first, and links between these lanes only.

    Links may name a layer in files of any revision.
    """
    roads = [(road, children(road, "lanes")) for road in root.iterchildren("road")]
    chosen: dict[str, list[tuple[Element, str]]] = {}
    is_there = False
    for road, lanes in roads:
        by_layer: dict[str, Element] = {}
        for part in lanes:
            by_layer.setdefault(part.get("layer", PERMANENT), part)
        if not by_layer:
            continue
        is_there |= layer in by_layer
        base = by_layer.get(PERMANENT)
        own = by_layer.get(layer)
        if base is None:
            base = own if own is not None else next(iter(by_layer.values()))
            message = f"no lanes of layer {PERMANENT!r}; those of {base.get('layer')!r:.40} are read"
            values.warn(WarningKind.LAYER, base, message)
        for name, part in by_layer.items():
            if part not in (base, own):
                message = f"lanes of layer {name!r:.40} are not read; a layer can be chosen in reading"
                values.warn(WarningKind.LAYER, part, message)
                values.left_out.add(part)
        placed = [(section, base.get("layer", PERMANENT)) for section in children(base, "laneSection")]
        if own is not None and own is not base:
            base, placed = _replaced(values, road, base, own, layer)
        if base is not lanes[0]:
            road.insert(road.index(lanes[0]), base)
        chosen.setdefault(road.get("id", ""), placed)
    if not is_there:
        message = f"no lanes of layer {layer!r:.40}; those of layer {PERMANENT!r} are read"
        values.warn(WarningKind.LAYER, root, message)
    for road, _ in roads:
        _keep_links(road, chosen)


def _replaced(
    values: Values, road: Element, base: Element, own: Element, layer: str
) -> tuple[Element, list[tuple[Element, str]]]:
    """Return the lanes of a road, those of a layer from its first section on, with their sections' layers."""
    sections = children(own, "laneSection")
    start_m = min((values.number(section, "s") for section in sections), default=float("inf"))
    lanes = etree.Element("lanes")
    placed: list[tuple[Element, str]] = []
    for tag in ("laneOffset", "laneSection"):
        for part, name in ((base, base.get("layer", PERMANENT)), (own, layer)):
            for record in children(part, tag):
                if part is own or values.number(record, "s") < start_m:
                    copied = deepcopy(record)
                    lanes.append(copied)
                    if tag == "laneSection":
                        placed.append((copied, name))
    values.left_out.update((base, own))
    return lanes, placed


def _keep_links(road: Element, chosen: dict[str, list[tuple[Element, str]]]) -> None:
    """Remove the links of a road's lanes that lead to lanes of other layers."""
    sections = chosen.get(road.get("id", ""), [])
    for k, (section, own) in enumerate(sections):
        for tag, beside in (("predecessor", k - 1), ("successor", k + 1)):
            if 0 <= beside < len(sections):
                target: str | None = sections[beside][1]
            else:
                target = _beyond(road, tag, chosen)
            for link in [link for group in section.iter("link") for link in children(group, tag)]:
                wanted = link.get("layer", own)
                if wanted != (own if target is None else target):
                    parent = link.getparent()
                    assert parent is not None
                    parent.remove(link)


def _beyond(road: Element, tag: str, chosen: dict[str, list[tuple[Element, str]]]) -> str | None:
    """Return the layer of the lanes where a road's link leads; None if it leads to no road."""
    link = first(first(road, "link"), tag)
    if link is None or link.get("elementType", "road") != "road":
        return None
    sections = chosen.get(link.get("elementId", ""))
    return sections[-1 if link.get("contactPoint") == "end" else 0][1] if sections else None
