"""Reads layouts in the Layout Interchange Format of the VDMA (LIF, JSON), of versions 0, 1 and 2.

Positions are in metres. A floor is a map: robots send the `mapId` of nodes as the `mapId` of VDA 5050. Edges have one
direction. What a station is for, the actions at its nodes say.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain, combinations
from math import dist, isfinite
from statistics import median
from typing import Any

import msgspec
import shapely

from deconflict.settings.importers.formats.directed_ways import Floor, PlanGraph, Way
from deconflict.settings.importers.formats.location_uses import use_of
from deconflict.settings.importers.plan import ImportedPlan, Node, PlanError, Spot, UnusedParts, unused
from ingest.languages.geometry.trajectories import polyline
from ingest.languages.vda5050.vda_messages import Trajectory

Table = Mapping[str, Any]
FIT_M = 0.5
"""A curve that ends farther from its nodes is not that of its edge."""
NOT_LIMITS = {"vehicleTypeId", "vehicleTypeIds", "mobileRobotTypes", "trajectory"}


def properties(table: Table, kind: str) -> list[Table]:
    """What holds for each type of robots at a node or an edge. LIF 2 has another name for it."""
    names = (f"{robot}Type{kind}Properties" for robot in ("vehicle", "mobileRobot"))
    return list(chain.from_iterable(table.get(name) or () for name in names))


class LifEdges:
    """The edges whose ends are known."""

    def __init__(self, edges: list[Table], nodes: Mapping[str, Node]) -> None:
        self._nodes = nodes
        self._lost = self._straightened = self._varying = self._limited = 0
        self._limits: set[str] = set()
        self.ways = tuple(way for edge in edges if (way := self._way(edge)))

    def left_out(self) -> Iterator[UnusedParts]:
        yield from unused(self._lost, "edge", "it leads from or to a node that is not in the file")
        reason = "no clamped NURBS from node to node; drawn straight"
        yield from unused(self._straightened, "curve of an edge", reason, "curves of edges")
        reason = "they differ by type of robots; drawn by the first"
        yield from unused(self._varying, "edge with several curves", reason, "edges with several curves")
        reason = (
            f"{', '.join(sorted(self._limits))}: the site file has no place for them; orders of VDA 5050 carry them"
        )
        yield from unused(self._limited, "edge with limits or actions", reason, "edges with limits or actions")

    def _way(self, edge: Table) -> Way | None:
        start, end = str(edge["startNodeId"]), str(edge["endNodeId"])
        if start not in self._nodes or end not in self._nodes:
            self._lost += 1
            return None
        limits = {key for each in properties(edge, "Edge") for key, value in each.items() if value is not None}
        limits -= NOT_LIMITS
        self._limits |= limits
        self._limited += bool(limits)
        return Way(start, end, self._bends(edge, self._nodes[start].at, self._nodes[end].at))

    def _bends(self, edge: Table, start: Spot, end: Spot) -> tuple[Spot, ...]:
        sent = [curve for each in properties(edge, "Edge") if (curve := each.get("trajectory"))]
        if not sent:
            return ()
        self._varying += any(curve != sent[0] for curve in sent)
        try:
            curve = polyline(msgspec.convert(sent[0], Trajectory, strict=False))
        except msgspec.ValidationError:
            curve = None
        if not curve or dist(curve[0], start) > FIT_M or dist(curve[-1], end) > FIT_M:
            self._straightened += 1
            return ()
        return curve[1:-1]


VERSIONS = ("0", "1", "2")
SAME_SPOT_M = 0.01
LONGEST_USUAL_M = 500.0
"""Half of the edges are shorter, or their unit is not the metre."""


def is_lif(document: object) -> bool:
    return isinstance(document, Mapping) and ("layouts" in document or "origins" in document)


def read_lif(document: Table) -> ImportedPlan:
    """Raises `PlanError` if places would not be where robots report them."""
    meta = document.get("metaInformation") or {}
    if (version := str(meta.get("lifVersion", "1"))).split(".")[0] not in VERSIONS:
        raise PlanError(f"metaInformation.lifVersion: {version!r} is not known; export the layout as LIF 1 or 2")
    layouts = list(_layouts(document))
    nodes, floor_of = _placed_nodes(layouts)
    if not nodes:
        raise PlanError("the LIF file has no nodes; expected the nodes of at least one layout")
    stations = LifStations(layouts, nodes, floor_of)
    edges = LifEdges([edge for layout in layouts for edge in layout.table.get("edges") or ()], stations.nodes)
    _check_unit(edges.ways, stations.nodes)
    graph = PlanGraph(_floors(layouts, nodes), stations.nodes, stations.floor_of, edges.ways)
    left_out = (*graph.ways_between_floors(), *edges.left_out(), *stations.left_out(), *_robot_types(layouts))
    name = str(meta.get("projectIdentification") or meta.get("lifId") or "site")
    return ImportedPlan(name, "a LIF layout", graph.levels(), left_out=left_out)


@dataclass(frozen=True, slots=True)
class _Layout:
    """A part of a floor."""

    table: Table
    origin: str
    level: str
    """Empty if the layout does not say it."""
    label: str
    maps: frozenset[str]
    """The maps that its nodes name."""

    def map_of(self, node: Table) -> str:
        """The map of a node; that of all others in the layout if it has none itself; empty if none has one."""
        if node.get("mapId") or len(self.maps) < 2:
            return str(node.get("mapId") or next(iter(self.maps), ""))
        named = ", ".join(sorted(self.maps))
        raise PlanError(f"node {node['nodeId']!r} has no mapId, and its layout has several ({named}); expected one")

    def floor_of(self, node: Table) -> str:
        """The key of the floor that a node is on. Ids of maps differ in more than case."""
        return self.map_of(node).casefold() or f"{self.origin} {self.level or self.label}"


def _layouts(document: Table) -> Iterator[_Layout]:
    """The layouts, from the lowest if their levels are numbers, else in the order of the file."""
    tables = [("", layout) for layout in document.get("layouts") or ()]
    for origin in document.get("origins") or ():
        tables += [(str(origin.get("originId", "")), layout) for layout in origin.get("layouts") or ()]
    layouts = []
    for origin, table in tables:
        level = str(table.get("layoutLevelId") or "")
        label = str(table.get("layoutName") or level or table["layoutId"])
        maps = frozenset(str(node["mapId"]) for node in table.get("nodes") or () if node.get("mapId"))
        layouts.append(_Layout(table, origin, level, label, maps))
    are_numbers = all(layout.level.removeprefix("-").isdecimal() for layout in layouts)
    yield from sorted(layouts, key=lambda layout: int(layout.level)) if are_numbers else layouts


def _placed_nodes(layouts: list[_Layout]) -> tuple[dict[str, Node], dict[str, str]]:
    """The nodes and their floors, by id."""
    nodes: dict[str, Node] = {}
    floor_of: dict[str, str] = {}
    for layout in layouts:
        for table in layout.table.get("nodes") or ():
            name, floor = str(table["nodeId"]), layout.floor_of(table)
            use = use_of(_actions(table))
            label = str(table.get("nodeName") or name)
            node = Node(name, _spot(table, "nodePosition", name), label, None if use == "station" else use)
            known = nodes.setdefault(name, node)
            if floor_of.setdefault(name, floor) != floor or dist(known.at, node.at) > SAME_SPOT_M:
                raise PlanError(f"node {name!r} is given twice, at different places; expected an id for each node")
    return nodes, floor_of


def _spot(table: Table, key: str, name: str) -> Spot:
    position = table.get(key)
    if not position:
        raise PlanError(f"node {name!r} has no {key}; export the layout with positions")
    spot = float(position["x"]), float(position["y"])
    if not all(map(isfinite, spot)):
        raise PlanError(f"node {name!r}: {key} is not finite; expected x and y in metres")
    return spot


def _actions(node: Table) -> str:
    """The types of the actions at a node. LIF 2 has them in two lists."""
    tables = [each for key in ("actions", "requiredActions", "feasibleActions") for each in _listed(node, key)]
    return " ".join(str(action.get("actionType", "")) for action in tables)


def _listed(node: Table, key: str) -> Iterator[Table]:
    return chain.from_iterable(each.get(key) or () for each in properties(node, "Node"))


def _floors(layouts: list[_Layout], nodes: Mapping[str, Node]) -> dict[str, Floor]:
    """The floors by key, each named by its layout or, if it has several, by its level."""
    by_floor: dict[str, list[tuple[_Layout, Table]]] = {}
    for layout in layouts:
        for node in layout.table.get("nodes") or ():
            by_floor.setdefault(layout.floor_of(node), []).append((layout, node))
    names: dict[str, str] = {}
    for key, found in by_floor.items():
        layout, node = found[0]
        is_only_layout = all(each is layout for each, _ in found)
        names[key] = layout.label if is_only_layout else layout.level or layout.label
        _check_is_one_floor(layout.map_of(node), [(each, nodes[str(table["nodeId"])].at) for each, table in found])
    given = Counter(names.values())
    datums = {key: found[0][0].map_of(found[0][1]) for key, found in by_floor.items()}
    return {
        key: Floor(name if given[name] == 1 else f"{name} {datums[key] or key}", datums[key])
        for key, name in names.items()
    }


def _check_is_one_floor(datum: str, spots: list[tuple[_Layout, Spot]]) -> None:
    """Two levels in one map may lie beside each other. If they overlap, robots on them can't be told apart."""
    by_place: dict[tuple[str, str], list[Spot]] = {}
    for layout, spot in spots:
        by_place.setdefault((layout.origin, layout.level), []).append(spot)
    outlines = {place: shapely.MultiPoint(found).convex_hull for place, found in by_place.items()}
    for a, b in combinations(outlines, 2):
        are_two = a[0] != b[0] or (a[1] != b[1] and a[1] and b[1])
        if are_two and outlines[a].intersects(outlines[b]):
            raise PlanError(
                f"levels {a[1] or a[0]!r} and {b[1] or b[0]!r} lie over each other in one map ({datum!r}): "
                "robots on them can't be told apart; export a mapId for each level"
            )


def _check_unit(ways: tuple[Way, ...], nodes: Mapping[str, Node]) -> None:
    lengths_m = [dist(nodes[way.start].at, nodes[way.end].at) for way in ways]
    if lengths_m and (usual_m := median(lengths_m)) > LONGEST_USUAL_M:
        raise PlanError(
            f"half of the edges are {usual_m:,.0f} m long or more: LIF is in metres, and these look like millimetres; "
            "export the layout in metres"
        )


class LifStations:
    """The stations of a LIF file, at the nodes where robots stand to use them."""

    def __init__(self, layouts: list[_Layout], nodes: Mapping[str, Node], floor_of: Mapping[str, str]) -> None:
        self.nodes = dict(nodes)
        """By id; where stations are, with their use and name."""
        self.floor_of = dict(floor_of)
        self._taken: set[str] = set()
        self._lost = self._shared = self._heights = 0
        actions = {
            str(node["nodeId"]): _actions(node) for layout in layouts for node in layout.table.get("nodes") or ()
        }
        for layout in layouts:
            for station in layout.table.get("stations") or ():
                self._heights += station.get("stationHeight") is not None
                self._place(station, layout, actions)

    def left_out(self) -> Iterator[UnusedParts]:
        yield from unused(self._lost, "station", "neither its nodes nor its position are in the file")
        yield from unused(self._shared, "name of a station", "at the node of another one", "names of stations")
        yield from unused(
            self._heights, "height of a station", "places are outlines on the floor", "heights of stations"
        )

    def _place(self, station: Table, layout: _Layout, actions: Mapping[str, str]) -> None:
        texts = [str(station.get(key) or "") for key in ("stationName", "stationDescription", "stationDescriptor")]
        name = texts[0] or str(station["stationId"])
        at = [node for each in station.get("interactionNodeIds") or () if (node := str(each)) in self.nodes]
        use = use_of(" ".join(actions.get(node, "") for node in at), " ".join(texts))
        if not at:
            self._place_without_node(station, layout, Node(f"station {station['stationId']}", (0.0, 0.0), name, use))
        self._shared += bool(at) and set(at) <= self._taken
        for node in set(at) - self._taken:
            self.nodes[node] = replace(self.nodes[node], name=name, use=use)
        self._taken.update(at)

    def _place_without_node(self, station: Table, layout: _Layout, node: Node) -> None:
        floors = {layout.floor_of(each) for each in layout.table.get("nodes") or ()}
        if station.get("stationPosition") and len(floors) == 1:
            self.nodes[node.id] = replace(node, at=_spot(station, "stationPosition", node.id))
            self.floor_of[node.id] = floors.pop()
        else:
            self._lost += 1


def _robot_types(layouts: list[_Layout]) -> Iterator[UnusedParts]:
    """A part of the lanes may be for some types of robots only."""
    kinds = {
        repr(kind)
        for layout in layouts
        for edge in layout.table.get("edges") or ()
        for each in properties(edge, "Edge")
        for kind in (each.get("vehicleTypeIds") or each.get("mobileRobotTypes") or [each.get("vehicleTypeId")])
    }
    if len(kinds) > 1:
        yield UnusedParts(f"which of {len(kinds)} types of robots use a lane", "places are for all robots")
