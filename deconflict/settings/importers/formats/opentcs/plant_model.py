"""Reads openTCS plant models (`NAME.xml`), with coordinates in millimetres.

Follows the plant model's schema of releases 4 to 7: positions are `positionX` or, before release 6, `xPosition`.
A plant model has no floors of its own. In this order, what tells them: the map of each point for VDA 5050, groups of
layers, and heights.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import pairwise
from math import dist, inf
from xml.etree.ElementTree import Element

from deconflict.settings.importers.formats.directed_ways import Floor, PlanGraph, Way
from deconflict.settings.importers.formats.location_uses import use_of
from deconflict.settings.importers.plan import Block, ImportedPlan, Node, PlanError, Spot, UnusedParts, Use, unused
from ingest.languages.geometry.trajectories import polyline
from ingest.languages.vda5050.vda_messages import ControlPoint, Trajectory

MAP = "vda5050:mapId"
"""The property that names the map of a point, or of the points where a vehicle drives."""
STOREY_MM = 1500.0
"""Points with a gap of height between them are on two floors."""
ONLY_FLOOR = "0"


class PlantFloors:
    """Which floor each point is on, and what the floors are."""

    def __init__(self, model: Element) -> None:
        self._points = {point.attrib["name"]: point for point in model.findall("point")}
        self._layers = {layer.get("id", ""): layer for layer in model.iter("layer")}
        self._groups = {group.get("id", ""): group.get("name", "") for group in model.iter("layerGroup")}
        maps = self._maps(model)
        groups = {} if maps else self._by_group()
        self.floor_of = maps or groups or self._by_height()
        """The key of each point's floor."""
        self.floors = {key: Floor(name, key if maps else "") for key, name in self._names(bool(maps)).items()}
        """By key, from the lowest."""
        self._sign = "" if maps else "groups of layers" if groups else "heights" if len(self.floors) > 1 else ""
        self._are_maps_given = bool(maps)

    def doubts(self) -> Iterator[str]:
        """What a person should look at, where no map of a point tells its floor."""
        if self._sign:
            yield f"{self._sign} tell the floors, for points have no {MAP}; compare them with the building"
        layers = {self._layer(point) for point in self._points.values()}
        if not self._are_maps_given and not self._sign and len(layers) > 1:
            yield f"{len(layers)} layers are one floor, for their points have neither {MAP} nor heights that differ"

    def _maps(self, model: Element) -> dict[str, str]:
        """The map of each point; empty if none is given.

        A point without one is in that of all vehicles, or else in that of the other points of its layer.
        """
        written: dict[str, str] = {}
        given = {name: found for name, point in self._points.items() if (found := _map_of(point, written))}
        usual = {found for vehicle in model.findall("vehicle") if (found := _map_of(vehicle, written))}
        if not given and len(usual) != 1:
            return {}
        by_layer: dict[str, set[str]] = {}
        for name, found in given.items():
            by_layer.setdefault(self._layer(self._points[name]), set()).add(found)
        maps = {}
        for name, point in self._points.items():
            near = usual if len(usual) == 1 else by_layer.get(self._layer(point)) or set(given.values())
            if name not in given and len(near) > 1:
                raise PlanError(
                    f"point {name!r} has no property {MAP}, and the points of its layer have several "
                    f"({', '.join(sorted(near))}); set it in the model editor"
                )
            maps[name] = given.get(name) or next(iter(near))
        return maps

    def _by_group(self) -> dict[str, str]:
        """The group of each point's layer; empty if there is only one."""
        found = {name: self._group(point) for name, point in self._points.items()}
        return found if len(set(found.values())) > 1 else {}

    def _by_height(self) -> dict[str, str]:
        heights = sorted({_height_mm(point) for point in self._points.values()})
        floor_of, row = {heights[0]: ONLY_FLOOR}, 0
        for below, above in pairwise(heights):
            row += above - below > STOREY_MM
            floor_of[above] = str(row)
        return {name: floor_of[_height_mm(point)] for name, point in self._points.items()}

    def _names(self, are_maps: bool) -> dict[str, str]:
        """The name of each floor, from the lowest: that of its group of layers if it is the only floor of the group."""
        heights: dict[str, list[tuple[float, int]]] = {}
        groups: dict[str, set[str]] = {}
        for name, key in self.floor_of.items():
            point = self._points[name]
            heights.setdefault(key, []).append((_height_mm(point), self._ordinal(point)))
            groups.setdefault(key, set()).add(self._group(point))
        owners = Counter(group for found in groups.values() for group in found)
        names = {key: key for key in sorted(heights, key=lambda key: min(heights[key]))}
        for key, found in groups.items():
            group = next(iter(found))
            if len(groups) > 1 and len(found) == owners[group] == 1 and self._groups.get(group):
                names[key] = self._groups[group]
        if len(names) == 1 and not are_maps:
            return dict.fromkeys(names, ONLY_FLOOR)
        given = Counter(names.values())
        return {key: name if given[name] == 1 else f"{name} {key}" for key, name in names.items()}

    def _layer(self, point: Element) -> str:
        layout = point.find("pointLayout")
        return "" if layout is None else layout.get("layerId", "")

    def _group(self, point: Element) -> str:
        layer = self._layers.get(self._layer(point))
        return "" if layer is None else layer.get("groupId", "")

    def _ordinal(self, point: Element) -> int:
        layer = self._layers.get(self._layer(point))
        return 0 if layer is None else int(layer.get("ordinal", "0"))


def _map_of(element: Element, written: dict[str, str]) -> str:
    """The map as it was first written: ids of maps differ in more than case."""
    found = next((each.get("value", "") for each in element.findall("property") if each.get("name") == MAP), "")
    return written.setdefault(found.casefold(), found)


def _height_mm(point: Element) -> float:
    return float(point.get("positionZ") or point.get("zPosition") or 0.0)


USUAL_SCALE = 50.0
"""Millimetres of a step of the drawing's grid, if the file does not say it."""
FIT_M = 0.1
"""A point that is drawn farther from its position is drawn elsewhere."""
FARTHEST = 2.0
"""Control points are no farther from both ends than so many times the length between them."""
SPEEDS = {"maxVelocity": inf, "maxReverseVelocity": 0.0}
"""The speeds forth and back, and what they are if they are missing."""
DRAWN_ONLY = {"ELBOW", "SLANTED"}
"""Connections whose corners the file does not have."""


class PlantPaths:
    """The paths that vehicles may drive."""

    def __init__(self, model: Element, nodes: Mapping[str, Node]) -> None:
        layout = model.find("visualLayout")
        scales = {} if layout is None else layout.attrib
        self._scale_x, self._scale_y = (float(scales.get(key, USUAL_SCALE)) / 1000.0 for key in ("scaleX", "scaleY"))
        self._nodes = nodes
        self._drawn_elsewhere = {p.attrib["name"] for p in model.findall("point") if _is_elsewhere(p, nodes)}
        self._locked = self._speedless = self._lost = self._straightened = self._cornered = 0
        self.ways = {path.attrib["name"]: way for path in model.findall("path") if (way := self._way(path))}
        """By the path's name."""
        self._straightened += sum(
            prop.get("name") == "CONTROL_POINTS" for element in model.iter("modelLayoutElement") for prop in element
        )

    def left_out(self) -> Iterator[UnusedParts]:
        yield from unused(self._locked, "locked path", "vehicles do not use it")
        yield from unused(self._speedless, "path without a speed", "vehicles do not use it", "paths without a speed")
        yield from unused(self._lost, "path", "it leads from or to a point that is not in the file")
        reason = "their drawing does not fit the positions of their points; drawn straight"
        yield from unused(self._straightened, "curve of a path", reason, "curves of paths")
        reason = "the file does not say where they are; drawn straight"
        yield from unused(self._cornered, "path with corners", reason, "paths with corners")

    def _way(self, path: Element) -> Way | None:
        start, end = path.get("sourcePoint", ""), path.get("destinationPoint", "")
        forth, back = (float(path.get(key, usual)) > 0 for key, usual in SPEEDS.items())
        if start not in self._nodes or end not in self._nodes:
            self._lost += 1
        elif path.get("locked") == "true":
            self._locked += 1
        elif not forth and not back:
            self._speedless += 1
        else:
            bends = self._bends(path, start, end)
            return Way(start, end, bends, back) if forth else Way(end, start, bends[::-1])
        return None

    def _bends(self, path: Element, start: str, end: str) -> tuple[Spot, ...]:
        layout = path.find("pathLayout")
        if layout is None:
            return ()
        corners = tuple(self._spot(each) for each in layout.iter("controlPoint"))
        kind = layout.get("connectionType", "")
        if not corners:
            self._cornered += kind in DRAWN_ONLY
            return ()
        a, b = self._nodes[start].at, self._nodes[end].at
        most_m = FARTHEST * dist(a, b)
        fits = not {start, end} & self._drawn_elsewhere
        fits = fits and all(min(dist(a, corner), dist(b, corner)) <= most_m for corner in corners)
        curve = corners if kind == "POLYPATH" else _curve((a, *corners, b))
        if not fits or curve is None:
            self._straightened += 1
            return ()
        return curve

    def _spot(self, point: Element) -> Spot:
        """A point of the drawing, whose y is downwards, in metres."""
        return float(point.attrib["x"]) * self._scale_x, -float(point.attrib["y"]) * self._scale_y


def _curve(spots: tuple[Spot, ...]) -> tuple[Spot, ...] | None:
    """The bends of Bézier curves of the third degree, each of which begins where the one before ends."""
    curves, rest = divmod(len(spots) - 1, 3)
    if rest:
        return None
    knots = [0.0, *(float(row) for row in range(curves + 1) for _ in range(3)), float(curves)]
    points = [ControlPoint(x, y) for x, y in spots]
    curve = polyline(Trajectory(control_points=points, degree=3, knot_vector=knots))
    return curve and curve[1:-1]


def _is_elsewhere(point: Element, nodes: Mapping[str, Node]) -> bool:
    at = _drawn_at(point)
    return at is not None and dist(at, nodes[point.attrib["name"]].at) > FIT_M


def _drawn_at(point: Element) -> Spot | None:
    """Where a point is drawn, in metres; None if that is its position, as from release 7 on."""
    layout = point.find("pointLayout")
    for keys in (("positionX", "positionY"), ("xPosition", "yPosition")):
        if layout is not None and all(key in layout.attrib for key in keys):
            x, y = (float(layout.attrib[key]) / 1000.0 for key in keys)
            return x, y
    return None


SINGLE = "SINGLE_VEHICLE_ONLY"
"""The type of a block that only one robot at a time may use."""


def read_plant(model: Element) -> ImportedPlan:
    """Raises `PlanError` if points or positions are missing."""
    if model.find("point") is None:
        raise PlanError("the model has no points; draw it in the model editor, and save it")
    locations = PlantLocations(model)
    nodes = {point.attrib["name"]: locations.node(point) for point in model.findall("point")}
    floors = PlantFloors(model)
    _check_positions(nodes, floors.floor_of)
    paths = PlantPaths(model, nodes)
    graph = PlanGraph(floors.floors, nodes, floors.floor_of, tuple(paths.ways.values()))
    blocks = tuple(_blocks(model, nodes, paths))
    left_out = (
        *graph.ways_between_floors(),
        *paths.left_out(),
        *locations.left_out(),
        *_undrawn_blocks(model, len(blocks)),
        *_envelopes(model),
    )
    levels, doubts = graph.levels(blocks), tuple(floors.doubts())
    return ImportedPlan(model.get("name", "site"), "an openTCS plant model", levels, left_out=left_out, doubts=doubts)


def _check_positions(nodes: Mapping[str, Node], floor_of: Mapping[str, str]) -> None:
    """Points that were only drawn, and have no positions of their own, are all at one place."""
    (at, _), count = Counter((node.at, floor_of[name]) for name, node in nodes.items()).most_common(1)[0]
    if count > max(len(nodes) / 2, 1):
        raise PlanError(
            f"{count} of {len(nodes)} points are at x {at[0]:g} and y {at[1]:g}, as points are that were only drawn; "
            "choose Actions, Copy layout values to model in the model editor, compare with where robots are, and save"
        )


def _blocks(model: Element, nodes: Mapping[str, Node], paths: PlantPaths) -> Iterator[Block]:
    ends = {name: (way.start, way.end) for name, way in paths.ways.items()}
    ends |= {name: (name, name) for name in nodes}
    for block in model.findall("block"):
        lanes = tuple(ends[name] for member in block.iter("member") if (name := member.get("name", "")) in ends)
        if lanes and block.get("type", SINGLE) == SINGLE:
            yield Block(block.attrib["name"], lanes)


def _undrawn_blocks(model: Element, drawn: int) -> Iterator[UnusedParts]:
    blocks = model.findall("block")
    shared = sum(block.get("type", SINGLE) != SINGLE for block in blocks)
    yield from unused(shared, "block for one direction at a time", "robots may be in it together", SHARED_BLOCKS)
    yield from unused(len(blocks) - shared - drawn, "block", "it has no point and no path that is used")


SHARED_BLOCKS = "blocks for one direction at a time"


def _envelopes(model: Element) -> Iterator[UnusedParts]:
    found = sum(
        1 for parent in ("point", "path") for each in model.findall(parent) for _ in each.iter("vehicleEnvelope")
    )
    yield from unused(
        found, "envelope of vehicles", "robots' own messages say how large they are", "envelopes of vehicles"
    )


class PlantLocations:
    """The locations, each at the points from which vehicles reach it."""

    def __init__(self, model: Element) -> None:
        self._at: dict[str, tuple[str, Use]] = {}
        """By point, the name of its location and the location's use."""
        self._unlinked = self._shared = 0
        kinds = {kind.get("name", ""): kind for kind in model.findall("locationType")}
        for location in model.findall("location"):
            kind, links = kinds.get(location.get("type", "")), location.findall("link")
            self._unlinked += not links
            for link in links:
                found = location.attrib["name"], _use(location, link, kind)
                self._shared += self._at.setdefault(link.attrib["point"], found) is not found

    def left_out(self) -> Iterator[UnusedParts]:
        yield from unused(self._unlinked, "location", "it has no link to a point where vehicles stand")
        yield from unused(self._shared, "link of a location", "to the point of another one", "links of locations")

    def node(self, point: Element) -> Node:
        name = point.attrib["name"]
        at = (_metres(point, "positionX", "xPosition"), _metres(point, "positionY", "yPosition"))
        if location := self._at.get(name):
            return Node(name, at, *location)
        return Node(name, at, name, "parking" if point.get("type") == "PARK_POSITION" else None)


def _use(location: Element, link: Element, kind: Element | None) -> Use:
    """The use of a location by the operations of its link or its type and by its type's name, else by its symbol."""
    operations = link.findall("allowedOperation") or ([] if kind is None else kind.findall("allowedOperation"))
    names = [location.get("type", ""), *(each.get("name", "") for each in operations)]
    symbols = [
        layout.get("locationRepresentation", "")
        for element in (location, kind)
        if element is not None
        for layout in element
    ]
    return use_of(" ".join(names), " ".join(symbols))


def _metres(point: Element, *keys: str) -> float:
    for key in keys:
        if key in point.attrib:
            return float(point.attrib[key]) / 1000.0
    raise PlanError(f"point {point.get('name')!r} has no {keys[0]}; save the model with positions")
