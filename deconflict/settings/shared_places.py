"""The places that robots share: resources, which they go to, and zones, which they pass; and obstacles between them."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Literal

import shapely
from pydantic import Field

from ingest.settings import MOST_COUNTED, Coordinate, Datum, DatumId, Seconds, Section

Point = tuple[Coordinate, Coordinate]
Polygon = Annotated[tuple[Point, ...], Field(min_length=3)]

PRIOR_SERVICE_S = {"dock": 45.0, "charger": 900.0, "station": 60.0, "lift": 45.0, "parking": 600.0}
"""Service times that are assumed until dwells have been observed."""


class Landing(Section):
    """The door of a lift on another floor."""

    datum: DatumId
    """The floor."""
    polygon: Polygon
    """Outline of the cabin there, metres in that floor's frame."""


class Place(Section):
    """A part of a floor that robots share."""

    id: str
    """Identifies the place in advisories and metrics."""
    name: str = ""
    """Name for people; the id if absent."""
    datum: DatumId
    """The floor it is on."""
    polygon: Polygon
    """Outline, metres in the floor's frame."""
    capacity: Annotated[int, Field(ge=1, le=MOST_COUNTED)] = 1
    """Number of robots that it holds at once."""

    @property
    def label(self) -> str:
        return self.name or self.id


class Resource(Place):
    """A place that robots go to and occupy for a while: as long as the centre of the envelope is inside."""

    kind: Literal["dock", "charger", "station", "lift", "parking"]
    """Use of the resource; it sets the service time that is assumed at first."""
    service_s: Seconds | None = None
    """How long a robot occupies it; learned from observed dwells if absent."""
    group: str = ""
    """Resources of one group can replace each other, such as two lifts."""
    floors: tuple[Landing, ...] = ()
    """The doors of a lift on other floors."""


class Zone(Place):
    """A place that robots pass through: a robot is in it as long as its envelope touches it."""

    kind: Literal["crossing", "aisle", "door"]
    """An aisle is a single lane: two robots that enter it from both ends block each other."""
    axis: tuple[Point, Point] | None = None
    """The two ends of an aisle."""


class FloorPart(Section):
    """A part of a floor of which predictions know nothing."""

    name: str = ""
    """Name for people."""
    floor: DatumId = ""
    """Id of the datum that it is on; may be absent if there is only one."""
    outline_m: Polygon
    """Outline, metres in the floor's frame."""


class NamedArea(FloorPart):
    """A part of a floor that people have a name for. Texts name places by it, and the map shows it."""

    name: str
    """Name for people."""
    keep_clear: bool = False
    """Whether advice sends no robot onto it: ground for people, or in front of a fire door."""
    refuge: bool = False
    """Whether advice may send robots of every size onto it, also where none was seen: to make room for others."""


class Obstacle(FloorPart):
    """A rack, a wall or a machine that stands on a floor. The map draws it, texts name places by it, and advice sends
    no robot onto it."""

    kind: Literal["rack", "wall", "machine"]
    """What it is."""


class ContentionSettings(Section):
    """When queues, deadlocks and blockages are published."""

    least_wait_s: Seconds = 10.0
    """A queue or blockage with a shorter longest wait raises no advisory. If too short, every crossing raises one."""
    fleet_wait_s: Seconds = 30.0
    """Robots of one vendor may wait so long for each other without an advisory, or as long as is usual at the place and
    hour. If too short, a fleet's own order is reported."""
    stand_s: Seconds = 5.0
    """A robot that stands this long in the way of others is a blockage. If too short, pausing robots are reported."""
    clear_after_s: Seconds = 3.0
    """An advisory is cleared once it has not held for this long. If too short, advisories flicker."""


def outlines(place: Place) -> list[tuple[str, Sequence[Point]]]:
    """The datum of each floor that the place is on, and its outline there."""
    landings = place.floors if isinstance(place, Resource) else ()
    return [(place.datum, place.polygon), *((landing.datum, landing.polygon) for landing in landings)]


def place_problems(resources: Iterable[Resource], zones: Iterable[Zone], datums: Iterable[str]) -> Iterator[str]:
    """A sentence for each contradiction between keys of `[[resources]]` and `[[zones]]`."""
    known, seen = set(datums), dict[str, str]()
    keyed_resources = [(f"resources[{row}]", resource) for row, resource in enumerate(resources)]
    keyed_zones = [(f"zones[{row}]", zone) for row, zone in enumerate(zones)]
    places: list[tuple[str, Place]] = [*keyed_resources, *keyed_zones]
    choices = ", ".join(sorted(known)) or "none"
    for key, place in places:
        if place.id in seen:
            yield f"{key}.id: {place.id!r} is given by {seen[place.id]} too; expected it once"
        seen[place.id] = f"{key}.id"
        for datum, outline in outlines(place):
            if datum not in known:
                yield f"{key}.datum: no datum has the id {datum!r}; expected one of {choices}"
            if problem := _outline_problem(outline):
                yield f"{key}.polygon: {problem}"
    for key, resource in keyed_resources:
        if resource.floors and resource.kind != "lift":
            yield f"{key}.floors: a {resource.kind} is on one floor; only a lift has others"
    for key, zone in keyed_zones:
        if zone.kind == "aisle" and zone.axis is None:
            yield f"{key}.axis: is missing; an aisle needs [[x, y], [x, y]] from one end to the other"
        elif zone.kind != "aisle" and zone.axis is not None:
            yield f"{key}.axis: a {zone.kind} has none; only an aisle has"
        elif zone.axis is not None and zone.axis[0] == zone.axis[1]:
            yield f"{key}.axis: both ends are at {list(zone.axis[0])}; expected the two ends of the aisle"


def floor_part_problems(
    areas: Sequence[NamedArea], obstacles: Sequence[Obstacle], datums: Sequence[Datum]
) -> Iterator[str]:
    """A sentence for each area or obstacle whose floor is unknown, or whose outline encloses nothing."""
    choices = ", ".join(datum.id for datum in datums) or "none"
    keyed: list[tuple[str, FloorPart]] = [(f"areas[{row}]", area) for row, area in enumerate(areas)]
    keyed += [(f"obstacles[{row}]", obstacle) for row, obstacle in enumerate(obstacles)]
    for key, part in keyed:
        if not part.floor and len(datums) != 1:
            yield f"{key}.floor: is missing; expected one of {choices}"
        elif part.floor and all(datum.id != part.floor for datum in datums):
            yield f"{key}.floor: no datum has the id {part.floor!r}; expected one of {choices}"
        if isinstance(part, NamedArea) and part.keep_clear and part.refuge:
            yield f"{key}.refuge: no robot is sent onto an area with keep_clear; expected only one of the two"
        if problem := _outline_problem(part.outline_m):
            yield f"{key}.outline_m: {problem}"


def _outline_problem(outline: Sequence[Point]) -> str:
    """What is wrong with an outline; empty if nothing is."""
    shape = shapely.Polygon(outline)
    if not shape.is_valid:
        return f"{shapely.is_valid_reason(shape).lower()}; expected corners in order around the place"
    return "" if shape.area > 0 else "encloses nothing; expected corners around the place"
