"""Reads openTCS plant models (`NAME.xml`), with coordinates in millimetres.

Follows the plant model's schema of releases 4 to 7: positions are `positionX` or, before release 6, `xPosition`.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element

from deconflict.settings.importers.formats.directed_ways import PlanGraph
from deconflict.settings.importers.formats.location_uses import use_of
from deconflict.settings.importers.formats.opentcs.plant_floors import PlantFloors
from deconflict.settings.importers.formats.opentcs.plant_paths import PlantPaths
from deconflict.settings.importers.plan import Block, ImportedPlan, Node, PlanError, UnusedParts, Use, unused

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
