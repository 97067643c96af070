"""SUMO's plain XML: nodes, edges with lanes, connections.

https://sumo.dlr.de/docs/Networks/PlainXML.html
"""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from lxml import etree

from opendrive.arrays import FloatArray
from opendrive.formats.contents import LIGHTS, USERS
from opendrive.formats.lanelets import Lanelet, Lanelets, lanelets_of
from opendrive.network import RoadNetwork

METRE_DECIMALS = 4

_CLASSES = {
    "vehicle": "",
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
    "bus": "bus",
    "taxi": "taxi",
    "train": "tram rail_urban rail",
}
"""SUMO's vehicle classes of CommonRoad's users; all but pedestrians where a lane is for vehicles."""

_NO_PEDESTRIANS = "pedestrian tram rail_urban rail rail_electric rail_fast ship"
_DEFAULT_SPEED_MPS = 50.0 / 3.6
"""SUMO has no lane without speed limit: that of towns (netconvert's own default is 13.89 m/s too)."""

_LEAST_EDGE_M = 1.0
"""Shorter pieces are parts of nodes: netconvert cannot end edges on lanes that are shorter than the node."""

_MAX_WAYS = 64
"""More ways through a junction from one lane than any real one has."""


@dataclass(slots=True, eq=False)
class _Edge:
    """An edge: lanelets side by side in one direction, from the right to the left."""

    id: str
    from_node: str
    to_node: str
    lanelets: list[int]
    start: str
    end: str


@dataclass(frozen=True, slots=True, eq=False)
class PlainNetwork:
    """SUMO's plain XML.

    Attributes:
        nodes: file of the nodes.
        edges: file of the edges.
        connections: file of the connections.
        is_left_hand: whether traffic keeps left.
        counts: how many of what they hold.
        left_out: what they cannot hold, and how often.
    """

    nodes: bytes
    edges: bytes
    connections: bytes
    is_left_hand: bool
    counts: dict[str, int]
    left_out: Counter[str]


def plain_network(network: RoadNetwork) -> PlainNetwork:
    """Return the traffic lanes of a network as SUMO's plain XML."""
    return _Plain(network, lanelets_of(network)).written()


class _Plain:
    """Plain XML in the making."""

    def __init__(self, network: RoadNetwork, pieces: Lanelets) -> None:
        self.network = network
        self.pieces = pieces
        self.left_out: Counter[str] = Counter(pieces.left_out)
        self.users = [USERS.get(str(network.lanes.lane_type[p.lane])) for p in pieces.lanelets]
        self.inside = [self._passed(p) for p in pieces.lanelets]
        self.place: dict[int, tuple[_Edge, int]] = {}

    def _passed(self, piece: Lanelet) -> str | None:
        """Return the node that a lanelet is a part of: its junction, or a piece too short for an edge."""
        junction = self.network.lanes.junction_id[piece.lane]
        if junction is not None:
            return f"junction {junction}"
        if piece.s_end_m - piece.s_start_m >= _LEAST_EDGE_M:
            return None
        key = self.network.lanes.key[piece.lane]
        return f"{key.road_id}.{key.section}.{piece.s_start_m:.2f}"

    def written(self) -> PlainNetwork:
        pieces, lanes = self.pieces, self.network.lanes
        ends = _Ends()
        groups: dict[tuple[int, float, bool], list[int]] = {}
        for i, lanelet in enumerate(pieces.lanelets):
            if self.users[i] is None:
                self.left_out[f"lanelets of type {lanes.lane_type[lanelet.lane]}"] += 1
            elif self.inside[i] is None:
                section = int(lanes.section[lanelet.lane])
                groups.setdefault((section, lanelet.s_start_m, lanelet.forward), []).append(i)
        left_hand = self._is_left_hand(groups)
        edges = [self._edge(group, ends, left_hand) for group in groups.values()]
        links = self._links(ends)
        for edge in edges:
            edge.from_node, edge.to_node = ends.root(edge.from_node), ends.root(edge.to_node)
        nodes_element, edges_element = etree.Element("nodes"), etree.Element("edges")
        connections_element = etree.Element("connections")
        self._nodes(nodes_element, edges, ends)
        loops = [edge for edge in edges if edge.from_node == edge.to_node]
        if loops:
            self.left_out["edges from a node to itself"] += len(loops)
            edges = [edge for edge in edges if edge not in loops]
            links = [
                (i, j, way)
                for i, j, way in links
                if self.place[i][0] not in loops and self.place[j][0] not in loops
            ]
        for edge in edges:
            self._lanes(edges_element, edge)
        connected = self._connections(connections_element, links)
        for edge in edges:
            if edge.id not in connected:
                # Without this netconvert would guess.
                etree.SubElement(connections_element, "connection", {"from": edge.id})
        if self.network.crosswalks:
            self.left_out["crosswalks"] += len(self.network.crosswalks)
        counts = {
            "edges": len(edges),
            "lanes": sum(len(edge.lanelets) for edge in edges),
            "nodes": len(nodes_element),
            "connections": len(links),
        }
        return PlainNetwork(
            _xml(nodes_element),
            _xml(edges_element),
            _xml(connections_element),
            left_hand,
            counts,
            self.left_out,
        )

    def _is_left_hand(self, groups: dict[tuple[int, float, bool], list[int]]) -> bool:
        rules = Counter(road.record.rule for road in self.network.roads.values())
        left_hand = rules["LHT"] > rules["RHT"]
        others = rules["RHT"] if left_hand else rules["LHT"]
        if others:
            side = "right" if left_hand else "left"
            self.left_out[f"roads with {side}-hand traffic among the others"] += others
        return left_hand

    def _edge(self, group: list[int], ends: "_Ends", left_hand: bool) -> _Edge:
        """Return the edge of lanelets side by side."""
        pieces, lanes = self.pieces.lanelets, self.network.lanes
        first = pieces[group[0]]
        key = lanes.key[first.lane]
        # Lane ids grow to the left of the road; SUMO counts from the outside, which is right, or left.
        ordered = sorted(group, key=lambda i: lanes.key[pieces[i].lane].lane_id, reverse=not first.forward)
        if left_hand:
            ordered.reverse()
        number = f"{key.road_id}.{key.section}.{first.s_start_m:.2f}".replace(".00", "")
        name = ends.named(("-" if not first.forward else "") + number)
        low = f"{lanes.section[first.lane]}:{first.s_start_m!r}"
        high = f"{lanes.section[first.lane]}:{first.s_end_m!r}:end"
        start, end = (low, high) if first.forward else (high, low)
        edge = _Edge(name, start, end, ordered, start, end)
        for k, i in enumerate(ordered):
            self.place[i] = (edge, k)
        return edge

    def _links(self, ends: "_Ends") -> list[tuple[int, int, list[int]]]:
        """Return the links between lanelets of edges, with the lanelets of the junction in between."""
        links: list[tuple[int, int, list[int]]] = []
        for i, (edge, _) in self.place.items():
            stack: list[tuple[int, list[int]]] = [(j, []) for j in self.pieces.lanelets[i].successors]
            ways = 0
            while stack and ways < _MAX_WAYS:
                j, through = stack.pop()
                if j in self.place:
                    ends.join(edge.to_node, self.place[j][0].from_node)
                    links.append((i, j, through))
                    ways += 1
                elif self.inside[j] is not None and j not in through:
                    if self.users[j] is None:
                        continue
                    ends.join(edge.to_node, self.inside[j] or "")
                    stack += [(k, [*through, j]) for k in self.pieces.lanelets[j].successors]
        for i, node in enumerate(self.inside):
            for j in self.pieces.lanelets[i].successors:
                if node is not None and j in self.place:
                    ends.join(node, self.place[j][0].from_node)
        return links

    # Files

    def _nodes(self, root: etree._Element, edges: list[_Edge], ends: "_Ends") -> None:
        points: dict[str, list[FloatArray]] = {}
        mouths: dict[str, dict[str, list[FloatArray]]] = {}
        for edge in edges:
            for i in edge.lanelets:
                left, right = self.pieces.bounds(self.pieces.lanelets[i])
                for node, end, k in ((edge.from_node, edge.start, 0), (edge.to_node, edge.end, -1)):
                    points.setdefault(node, []).append(0.5 * (left[k] + right[k]))
                    mouths.setdefault(node, {}).setdefault(end, []).extend((left[k], right[k]))
        lit = {ends.root(f"junction {junction}") for junction in self._lit_junctions()}
        for node, members in points.items():
            x, y, z = np.mean(members, axis=0).tolist()
            kind = "traffic_light" if node in lit else "priority"
            attributes = {"x": _metres(x), "y": _metres(y), "z": _metres(z), "type": kind}
            attributes["id"] = ends.node_id(node)
            shape = _outline(list(mouths[node].values()))
            if shape is not None:
                attributes["shape"] = _shape(shape)
            etree.SubElement(root, "node", attributes)

    def _lit_junctions(self) -> set[str]:
        """Return the junctions that roads with traffic lights lead to."""
        lit = set()
        for road_id, road in self.network.roads.items():
            lights = [s for s in self.network.signals_of(road_id) if s.dynamic or s.type in LIGHTS]
            if lights:
                record = road.record
                lit |= {record.junction_id} if record.junction_id is not None else set()
                for light in lights:
                    ahead = {"+": (record.successor,), "-": (record.predecessor,)}.get(
                        light.orientation, (record.predecessor, record.successor)
                    )
                    lit |= {link.element_id for link in ahead if link and link.element_type == "junction"}
        return lit

    def _lanes(self, root: etree._Element, edge: _Edge) -> None:
        pieces = self.pieces
        leftmost = pieces.bounds(pieces.lanelets[edge.lanelets[-1]])[0]
        element = etree.SubElement(
            root,
            "edge",
            {
                "id": edge.id,
                "from": _Ends.node_id(edge.from_node),
                "to": _Ends.node_id(edge.to_node),
                "numLanes": str(len(edge.lanelets)),
                "shape": _shape(leftmost),
                "spreadType": "right",
            },
        )
        for k, i in enumerate(edge.lanelets):
            lanelet = pieces.lanelets[i]
            if lanelet.speed_mps is None:
                self.left_out["lanelets without speed limit (50 km/h)"] += 1
            left, right = pieces.bounds(lanelet)
            widths_m = np.linalg.norm(left[:, :2] - right[:, :2], axis=1)
            middle = self._centre(i)
            steps_m = np.linalg.norm(np.diff(middle[:, :2], axis=0), axis=1)
            width_m = float(np.average(0.5 * (widths_m[1:] + widths_m[:-1]), weights=steps_m + 1e-9))
            lane = etree.SubElement(
                element,
                "lane",
                index=str(k),
                speed=f"{lanelet.speed_mps or _DEFAULT_SPEED_MPS:.4f}",
                width=f"{width_m:.3f}",
                shape=_shape(middle),
            )
            key = self.network.lanes.key[lanelet.lane]
            name = f"{key.road_id}/{key.section}/{key.lane_id}"
            etree.SubElement(lane, "param", key="opendrive", value=name)
            allowed = _CLASSES[self.users[i] or ""]
            if allowed:
                lane.set("allow", allowed)
            else:
                lane.set("disallow", _NO_PEDESTRIANS)
            for side, neighbour, may in (
                ("changeLeft", lanelet.left_neighbour, lanelet.may_change_left),
                ("changeRight", lanelet.right_neighbour, lanelet.may_change_right),
            ):
                if neighbour is not None and not may and neighbour in edge.lanelets:
                    lane.set(side, "emergency")

    def _connections(self, root: etree._Element, links: list[tuple[int, int, list[int]]]) -> set[str]:
        connected = set()
        for i, j, through in links:
            (from_edge, from_lane), (to_edge, to_lane) = self.place[i], self.place[j]
            connected.add(from_edge.id)
            connection = etree.SubElement(
                root,
                "connection",
                {
                    "from": from_edge.id,
                    "to": to_edge.id,
                    "fromLane": str(from_lane),
                    "toLane": str(to_lane),
                },
            )
            if through:
                connection.set("shape", _shape(np.concatenate([self._centre(k) for k in through])))
                speeds = [s for k in through if (s := self.pieces.lanelets[k].speed_mps) is not None]
                if speeds:
                    connection.set("speed", f"{min(speeds):.4f}")
        return connected

    def _centre(self, i: int) -> FloatArray:
        left, right = self.pieces.bounds(self.pieces.lanelets[i])
        return 0.5 * (left + right)


@dataclass(slots=True)
class _Ends:
    """Ends of edges, of which some are one node; and names that SUMO allows."""

    parent: dict[str, str] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)

    def root(self, end: str) -> str:
        while (above := self.parent.get(end, end)) != end:
            end = above
        return end

    def join(self, a: str, b: str) -> None:
        first, second = self.root(a), self.root(b)
        if first != second:
            # Junctions give nodes their names.
            if second.startswith("junction "):
                first, second = second, first
            self.parent[second] = first

    def named(self, name: str) -> str:
        """Return a name without the characters that SUMO forbids, and that is not taken."""
        plain = "".join("_" if c.isspace() or c in "|\\'\";,<>&!:" else c for c in name)
        unique, number = plain, 1
        while unique in self.names:
            number += 1
            unique = f"{plain}_{number}"
        self.names.add(unique)
        return unique

    @staticmethod
    def node_id(end: str) -> str:
        return "".join("_" if c.isspace() or c in "|\\'\";,<>&!:" else c for c in end)


def _outline(mouths: list[list[FloatArray]]) -> FloatArray | None:
    """Return the outline (K, 3) of a node through the mouths of its roads, counter-clockwise.

    Lanes end where they cross the outline: it runs along the mouths, so that they stay as they are.
    """
    ends = []
    for mouth in mouths:
        corners = np.array(mouth)
        # The two corners that are farthest apart are the outer ones.
        apart = np.linalg.norm(corners[:, None, :2] - corners[None, :, :2], axis=2)
        a, b = np.unravel_index(int(np.argmax(apart)), apart.shape)
        ends.append(corners[[a, b]])
    if len(ends) < 2:
        return None
    middle = np.concatenate(ends).mean(axis=0)

    def around(points: FloatArray) -> FloatArray:
        angle: FloatArray = np.arctan2(points[..., 1] - middle[1], points[..., 0] - middle[0])
        return angle

    order = np.argsort([float(around(pair.mean(axis=0))) for pair in ends], kind="stable")
    rings = []
    for k in order.tolist():
        first, second = around(ends[k])
        rings.append(ends[k] if (second - first) % (2.0 * np.pi) <= np.pi else ends[k][::-1])
    return np.concatenate(rings)


def _xml(element: etree._Element) -> bytes:
    content: bytes = etree.tostring(element, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return content


def _metres(value: float) -> str:
    return f"{value:.{METRE_DECIMALS}f}"


def _shape(xyz_m: FloatArray) -> str:
    return " ".join(",".join(map(_metres, point)) for point in xyz_m.tolist())
