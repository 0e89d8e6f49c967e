"""What robots share, as the site file says it: resources that they go to, and zones that they pass."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Literal

import shapely
from pydantic import Field

from ingest.settings import Coordinate, DatumId, Seconds, Section

Point = tuple[Coordinate, Coordinate]
Polygon = Annotated[tuple[Point, ...], Field(min_length=3)]

PRIOR_SERVICE_S = {"dock": 45.0, "charger": 900.0, "station": 60.0, "lift": 45.0, "parking": 600.0}
"""How long a resource is kept, until its own dwells have been seen."""


class Landing(Section):
    """Where a lift opens on another floor."""

    datum: DatumId
    """The floor."""
    polygon: Polygon
    """Its outline there, metres in that floor's frame."""


class Place(Section):
    """A part of a floor that robots share."""

    id: str
    """Names it in advisories and metrics."""
    name: str = ""
    """What a person calls it; its id if absent."""
    datum: DatumId
    """The floor it is on."""
    polygon: Polygon
    """Its outline, metres in the floor's frame."""
    capacity: Annotated[int, Field(ge=1)] = 1
    """How many robots it takes at once."""

    @property
    def label(self) -> str:
        return self.name or self.id


class Resource(Place):
    """A place that robots go to and keep for a while: a robot has it while the middle of its envelope is inside."""

    kind: Literal["dock", "charger", "station", "lift", "parking"]
    """What it is for; it sets the service time that is assumed at first."""
    service_s: Seconds | None = None
    """How long a robot keeps it; learned from what is seen if absent."""
    group: str = ""
    """Resources of one group can stand in for each other, as either of two lifts."""
    floors: tuple[Landing, ...] = ()
    """Of a lift, where it opens on other floors."""


class Zone(Place):
    """A place that robots pass through: a robot is in it while its envelope touches it."""

    kind: Literal["crossing", "aisle", "door"]
    """An aisle is a single lane: two that enter it from both ends lock each other."""
    axis: tuple[Point, Point] | None = None
    """Of an aisle, from one end to the other."""


class ContentionSettings(Section):
    """What of contention is worth a person's attention."""

    least_wait_s: Seconds = 10.0
    """A queue whose longest wait is shorter raises no advisory. Too short and every crossing raises one."""
    stand_s: Seconds = 5.0
    """A robot that has stood this long where others will pass is a blockage. Too short names robots that only pause."""
    clear_after_s: Seconds = 3.0
    """An advisory is cleared when it has not held for this long. Too short makes advisories flicker."""


def outlines(place: Place) -> list[tuple[str, Sequence[Point]]]:
    """Each floor that the place is on, by datum, and its outline there."""
    landings = place.floors if isinstance(place, Resource) else ()
    return [(place.datum, place.polygon), *((one.datum, one.polygon) for one in landings)]


def place_problems(resources: Iterable[Resource], zones: Iterable[Zone], datums: Iterable[str]) -> Iterator[str]:
    """What no key of `[[resources]]` and `[[zones]]` shows alone, a sentence each."""
    known, seen = set(datums), dict[str, str]()
    resourced = [(f"resources[{row}]", one) for row, one in enumerate(resources)]
    zoned = [(f"zones[{row}]", one) for row, one in enumerate(zones)]
    places: list[tuple[str, Place]] = [*resourced, *zoned]
    choices = ", ".join(sorted(known)) or "none"
    for key, place in places:
        if place.id in seen:
            yield f"{key}.id: {place.id!r} is given by {seen[place.id]} too; expected it once"
        seen[place.id] = f"{key}.id"
        for datum, outline in outlines(place):
            if datum not in known:
                yield f"{key}.datum: no datum has the id {datum!r}; expected one of {choices}"
            if fault := _outline_fault(outline):
                yield f"{key}.polygon: {fault}"
    for key, resource in resourced:
        if resource.floors and resource.kind != "lift":
            yield f"{key}.floors: a {resource.kind} is on one floor; only a lift has others"
    for key, zone in zoned:
        if zone.kind == "aisle" and zone.axis is None:
            yield f"{key}.axis: is missing; an aisle needs [[x, y], [x, y]] from one end to the other"
        elif zone.kind != "aisle" and zone.axis is not None:
            yield f"{key}.axis: a {zone.kind} has none; only an aisle has"
        elif zone.axis is not None and zone.axis[0] == zone.axis[1]:
            yield f"{key}.axis: both ends are at {list(zone.axis[0])}; expected the two ends of the aisle"


def _outline_fault(outline: Sequence[Point]) -> str:
    shape = shapely.Polygon(outline)
    if not shape.is_valid:
        return f"{shapely.is_valid_reason(shape).lower()}; expected corners in order around the place"
    return "" if shape.area > 0 else "encloses nothing; expected corners around the place"
