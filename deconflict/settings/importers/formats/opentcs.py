"""Reads openTCS plant models (`NAME.xml`), with coordinates in millimetres.

Follows the plant model's schema of releases 4 to 6: positions are `positionX` or, before release 6, `xPosition`.
"""

from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element

from deconflict.settings.importers.formats.location_uses import use_of
from deconflict.settings.importers.plan import Block, ImportedPlan, Lane, Level, Node, PlanError, Use

SINGLE = "SINGLE_VEHICLE_ONLY"
"""The type of a block that only one robot at a time may use."""


def read_plant(model: Element) -> ImportedPlan:
    """Raises `PlanError` if a position is missing."""
    uses = dict(_uses(model))
    nodes = tuple(_node(point, uses) for point in model.iter("point"))
    ends = {
        path.attrib["name"]: (path.attrib["sourcePoint"], path.attrib["destinationPoint"])
        for path in model.iter("path")
    }
    ends |= {node.id: (node.id, node.id) for node in nodes}
    blocks = (
        Block(
            block.attrib["name"],
            tuple(ends[name] for member in block.iter("member") if (name := member.get("name", "")) in ends),
        )
        for block in model.iter("block")
        if block.get("type", SINGLE) == SINGLE
    )
    level = Level("0", nodes, _lanes(model), blocks=tuple(block for block in blocks if block.lanes))
    return ImportedPlan(model.get("name", "site"), "an openTCS plant model", (level,))


def _lanes(model: Element) -> tuple[Lane, ...]:
    """The lanes. A path is two-way if it may be driven backwards, or if another path leads in the other direction."""
    paths = {
        (path.attrib["sourcePoint"], path.attrib["destinationPoint"]): float(path.get("maxReverseVelocity", 0)) > 0
        for path in model.iter("path")
    }
    return tuple(
        Lane(start, end, reversible or (end, start) in paths)
        for (start, end), reversible in paths.items()
        if start <= end or (end, start) not in paths
    )


def _uses(model: Element) -> Iterator[tuple[str, tuple[Use, str]]]:
    """For each point from which a location is reached: the location's use and name."""
    operations = {
        kind.attrib["name"]: " ".join(operation.get("name", "") for operation in kind.iter("allowedOperation"))
        for kind in model.iter("locationType")
    }
    for location in model.iter("location"):
        kind = location.get("type", "")
        for link in location.iter("link"):
            yield link.attrib["point"], (use_of(f"{kind} {operations.get(kind, '')}"), location.attrib["name"])


def _node(point: Element, uses: Mapping[str, tuple[Use, str]]) -> Node:
    name = point.attrib["name"]
    at = (_metres(point, "positionX", "xPosition"), _metres(point, "positionY", "yPosition"))
    use, label = uses.get(name, (None, name))
    if use is None and point.get("type") == "PARK_POSITION":
        use = "parking"
    return Node(name, at, label, use)


def _metres(point: Element, *keys: str) -> float:
    for key in keys:
        if key in point.attrib:
            return float(point.attrib[key]) / 1000.0
    raise PlanError(f"point {point.get('name')!r} has no {keys[0]}; save the model with positions")
