"""Whether a vendor's frame has drifted: docks and chargers are marks that its robots come to rest at again and again.

Where robots of a vendor rest at a resource at first is the mark; how far they later rest from it, in the middle over
all its resources, is the drift. A dock that was moved shifts only its own rests, a robot that parks badly only one.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import compress
from math import hypot
from statistics import median

import numpy as np
import shapely
from shapely import Polygon

from deconflict.runtime.learned_state import Part, UnreadableError
from deconflict.settings.shared_places import Resource
from ingest.batch import Basis, Batch
from ingest.measures.change_detection import Change, Level, Limits

FIRST = 10
"""Rests at one resource that make its mark."""
LATER, FEWEST = 30, 10
"""Of a vendor's rests after that, so many of the newest count, and from so many on."""
MARKS = ("charger", "dock")

LIMITS = Limits(least_spread=0.05, least_change=0.15)
"""Metres along each axis."""

Spot = tuple[float, float]
Bounds = tuple[float, float, float, float]
"""West, south, east and north."""


@dataclass(slots=True, eq=False)
class Rests:
    """Keeps, for each vendor, a mark at each resource and the newest offsets from it."""

    _places: dict[str, list[tuple[str, Polygon, Bounds]]]
    """Datum to the resources on it, and the bounds of each."""
    _resting: set[str] = field(default_factory=set)
    _firsts: dict[tuple[str, str], list[Spot]] = field(default_factory=dict)
    """Vendor and resource to its first rests."""
    _offsets: dict[str, deque[Spot]] = field(default_factory=dict)
    _levels: dict[str, tuple[Level, Level]] = field(default_factory=dict)
    """Of x and of y, by vendor."""

    @classmethod
    def at(cls, resources: Iterable[Resource]) -> "Rests":
        places: dict[str, list[tuple[str, Polygon, Bounds]]] = {}
        for one in resources:
            if one.kind in MARKS:
                outline = Polygon(one.polygon)
                places.setdefault(one.datum, []).append((one.id, outline, outline.bounds))
        return cls(places)

    def see(self, batch: Batch) -> None:
        """Robots that reported: one that is forecast to stay where it is rests; those that are gone rest no more."""
        if not self._places:
            return
        first, told = batch.forecasts.start[:-1], batch.forecasts
        stand = (batch.basis == Basis.STATIONARY.value) & (told.floor[first] >= 0)
        standing = set(compress(batch.robots, stand.tolist()))
        self._resting.difference_update(batch.gone, set(batch.robots) - standing)
        if standing <= self._resting:
            return
        for row in np.flatnonzero(stand).tolist():
            knot = first[row]
            at, datum = (float(told.x_m[knot]), float(told.y_m[knot])), batch.floors[told.floor[knot]]
            self.stands(batch.robots[row], batch.vendors[row], datum, at, float(batch.event_s[row]))

    def moves(self, uuid: str) -> None:
        """The robot drives, or has left."""
        self._resting.discard(uuid)

    def stands(self, uuid: str, vendor: str, datum: str, at: Spot, at_s: float) -> None:
        """The robot stands at a place, metres in the datum's frame; counts once until it moves."""
        if uuid in self._resting:
            return
        self._resting.add(uuid)
        x, y = at
        for resource, outline, (west, south, east, north) in self._places.get(datum, ()):
            if west <= x <= east and south <= y <= north and outline.contains(shapely.Point(at)):
                self._rested(vendor, resource, at, at_s)

    def drift_m(self) -> dict[tuple[str, ...], float]:
        """By vendor, how far its robots now rest from the marks; only those that rested often enough."""
        return {
            (vendor,): hypot(median(x for x, _ in offsets), median(y for _, y in offsets))
            for vendor, offsets in self._offsets.items()
            if len(offsets) >= FEWEST
        }

    def learned(self) -> Part:
        """The marks, and the newest offsets from them."""
        marks = [[vendor, resource, list(at)] for (vendor, resource), at in self._firsts.items()]
        return {
            "marks": marks,
            "offsets": {vendor: list(seen) for vendor, seen in self._offsets.items()},
            "levels": {vendor: [level.learned() for level in axes] for vendor, axes in self._levels.items()},
        }

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told; marks of resources that are no more are dropped. Raises `UnreadableError`."""
        known = {resource for places in self._places.values() for resource, *_ in places}
        try:
            for vendor, resource, at in part.get("marks", ()):
                if resource in known:
                    self._firsts[vendor, resource] = [(float(x), float(y)) for x, y in at[:FIRST]]
            for vendor, seen in part.get("offsets", {}).items():
                self._offsets[vendor] = deque(((float(x), float(y)) for x, y in seen), maxlen=LATER)
            for vendor, (x, y) in part.get("levels", {}).items():
                self._levels[vendor] = (Level.resumed(LIMITS, x), Level.resumed(LIMITS, y))
        except (TypeError, ValueError, AttributeError) as error:
            raise UnreadableError(f"marks of docks and chargers are not told: {error}") from error

    def changed(self) -> dict[str, Change]:
        """Since when robots rest elsewhere than they did, and by how many metres, of vendors of which that is so."""
        told = {}
        for vendor, axes in self._levels.items():
            changes = [level.change for level in axes if level.change]
            if changes:
                told[vendor] = Change(min(one.since_s for one in changes), hypot(*(one.by for one in changes)))
        return told

    def _rested(self, vendor: str, resource: str, at: Spot, at_s: float) -> None:
        firsts = self._firsts.setdefault((vendor, resource), [])
        if len(firsts) < FIRST:
            firsts.append(at)
            return
        mark = (median(x for x, _ in firsts), median(y for _, y in firsts))
        offsets = self._offsets.setdefault(vendor, deque(maxlen=LATER))
        off = (at[0] - mark[0], at[1] - mark[1])
        offsets.append(off)
        axes = self._levels.setdefault(vendor, _levels())
        for level, metres in zip(axes, off, strict=True):
            level.take(metres, at_s)
        if not all(level.seen for level in axes):
            self._mark_anew(vendor)

    def _mark_anew(self, vendor: str) -> None:
        """Its frame has been elsewhere for so long that it is usual there."""
        for key in [one for one in self._firsts if one[0] == vendor]:
            del self._firsts[key]
        del self._offsets[vendor], self._levels[vendor]


def _levels() -> tuple[Level, Level]:
    return Level(LIMITS), Level(LIMITS)
