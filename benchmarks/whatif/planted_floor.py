"""Floors that are well made but for one planted fault.

Each floor has the same four parts, far from each other: two lanes, chargers, and a crossing of single lanes. One of
them has its fault.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from random import Random

import numpy as np
import shapely
from shapely.affinity import translate

from benchmarks.planned_floors.logs.messages import DATUM, Line
from benchmarks.whatif.crossing_yard import CROSSING, crossing_yard
from benchmarks.whatif.dock_yard import DOCK, dock_yard
from benchmarks.whatif.heard_lines import heard
from benchmarks.whatif.lane_yard import LANE, LaneChange, lane_yard
from benchmarks.whatif.yards import MAKES, MadeYard, reports
from deconflict.settings.shared_places import Point, Resource, Zone
from deconflict.settings.site import Site
from ingest.settings import Datum
from metrics.whatif.recorded_tracks import RecordedFloor

APART_M = 100.0
TWO_LANES = LaneChange(wider_m=2.0, two_lanes=True)
FAULTS = ("lane too narrow", "second charger missing", "one-way the wrong way", "crossing without order")
NO_FAULT = -1
PLACES = ("Lane 1", "Charger 1", "Lane 2", "Crossing 1")
"""Where each fault is planted."""


@dataclass(frozen=True, slots=True)
class PlantedFloor:
    """A floor with one fault. `parts` are those of `PLACES`, from west to east in `order`."""

    fault: str
    place: str
    parts: tuple[MadeYard, ...]
    order: tuple[int, ...]

    @property
    def site(self) -> Site:
        wide, charger, lane, crossing = (_corners(area, self._east_m(at)) for at, area in enumerate(AREAS))
        return Site(
            datums=(Datum(id=DATUM, name="Hall"),),
            resources=(Resource(id="charger-1", name=PLACES[1], kind="charger", datum=DATUM, polygon=charger),),
            zones=(
                Zone(id="lane-1", name=PLACES[0], kind="aisle", datum=DATUM, polygon=wide, axis=_axis(wide)),
                Zone(id="lane-2", name=PLACES[2], kind="aisle", datum=DATUM, polygon=lane, axis=_axis(lane)),
                Zone(id="crossing-1", name=PLACES[3], kind="crossing", datum=DATUM, polygon=crossing),
            ),
        )

    def recorded(self, seed: int, seconds: float) -> RecordedFloor:
        """The log of the floor, as the service hears it."""
        return heard(line for at in range(len(self.parts)) for line in self._lines(at, seed, seconds))

    def _lines(self, at: int, seed: int, seconds: float) -> Iterator[Line]:
        yard = self.parts[at](np.random.default_rng([seed, at]))
        return reports(yard, seconds, f"part-{at}", self._east_m(at))

    def _east_m(self, at: int) -> float:
        return APART_M * self.order[at]


AREAS = (LANE.outline, DOCK.outline, LANE.outline, CROSSING.outline)


def planted_floor(number: int, *, is_planted: bool = True) -> PlantedFloor:
    """The floor of this number: each fault in turn, all else at random. It can be had without its fault."""
    rng, at = Random(number), number % len(FAULTS) if is_planted else NO_FAULT
    turned = LaneChange(one_way=True, turned_make=rng.randrange(len(MAKES)) if at == 2 else None)
    parts = (
        lane_yard(rng.choice((4, 5, 6)), LaneChange() if at == 0 else TWO_LANES),
        dock_yard(rng.choice((5, 6)), 1) if at == 1 else dock_yard(rng.choice((3, 4)), 2),
        lane_yard(6, turned),
        crossing_yard(4, is_ordered=False) if at == 3 else crossing_yard(3, is_ordered=True),
    )
    fault, place = (FAULTS[at], PLACES[at]) if is_planted else ("no fault", "")
    return PlantedFloor(fault, place, parts, tuple(rng.sample(range(len(parts)), len(parts))))


def _corners(area: shapely.Polygon, east_m: float) -> tuple[Point, ...]:
    return tuple((x_m, y_m) for x_m, y_m in translate(area, east_m).exterior.coords[:-1])


def _axis(corners: tuple[Point, ...]) -> tuple[Point, Point]:
    west_m, east_m = (pick(x_m for x_m, _ in corners) for pick in (min, max))
    return (west_m, 0.0), (east_m, 0.0)
