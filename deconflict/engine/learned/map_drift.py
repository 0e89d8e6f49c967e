"""Whether a vendor's frame has drifted, measured at docks and chargers, where its robots come to rest again and again.

The first rests of a vendor's robots at a resource make its mark. How far they rest from the mark later, in the median
over all its resources, is the drift. A dock that was moved shifts only its own rests, a robot that parks badly only
its own.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import compress
from math import hypot
from statistics import median
from typing import Any

import numpy as np
import shapely
from shapely import Polygon

from deconflict.runtime.learned_state import Form, Part, UnreadableError
from deconflict.settings.shared_places import Resource
from ingest.batch import Basis, Batch
from ingest.measures.change_detection import ChangeDetector, ChangeLimits, LevelChange

MARK_RESTS = 10
"""This many first rests at a resource make its mark."""
NEWEST_RESTS, FEWEST_RESTS = 30, 10
"""The drift is the median of this many newest rests of a vendor; it is not known with fewer than the second."""
MARKED_KINDS = ("charger", "dock")
"""Kinds of resources at which robots come to rest at one spot."""

LIMITS = ChangeLimits(least_spread=0.05, least_change=0.15)
"""For changes of the offset, in metres along each axis."""

Point = tuple[float, float]
"""x and y in metres, or an offset."""
Bounds = tuple[float, float, float, float]
"""West, south, east and north in metres."""
MOST_OFFSET_M = 1e7
"""Offsets beyond are damage."""
FORM = Form(
    f"the first {MARK_RESTS} rests, then offsets from their median, in metres",
    {
        "marks": list[tuple[str, str, list[Point]]],
        "offsets": dict[str, list[Point]],
        "levels": dict[str, tuple[dict[str, Any], dict[str, Any]]],
    },
)


@dataclass(slots=True, eq=False)
class MapDrift:
    """Keeps, for each vendor, a mark at each resource and the newest offsets from the marks."""

    _places: dict[str, list[tuple[str, Polygon, Bounds]]]
    """By datum: id, outline and bounds of each resource on it."""
    _resting: set[str] = field(default_factory=set)
    """Robots that stand."""
    _first_rests: dict[tuple[str, str], list[Point]] = field(default_factory=dict)
    """By vendor and resource, the first rests: they make the mark."""
    _offsets: dict[str, deque[Point]] = field(default_factory=dict)
    """By vendor, the newest offsets from its marks."""
    _levels: dict[str, tuple[ChangeDetector, ChangeDetector]] = field(default_factory=dict)
    """By vendor, the change detection of the offsets' x and y."""

    @classmethod
    def at(cls, resources: Iterable[Resource]) -> "MapDrift":
        places: dict[str, list[tuple[str, Polygon, Bounds]]] = {}
        for resource in resources:
            if resource.kind in MARKED_KINDS:
                outline = Polygon(resource.polygon)
                places.setdefault(resource.datum, []).append((resource.id, outline, outline.bounds))
        return cls(places)

    def observe(self, batch: Batch) -> None:
        """Note which robots of a batch rest: those that are forecast to stay where they are."""
        if not self._places:
            return
        first, forecasts = batch.forecasts.start[:-1], batch.forecasts
        rests = (batch.basis == Basis.STATIONARY.value) & (forecasts.floor[first] >= 0)
        resting = set(compress(batch.robots, rests.tolist()))
        self._resting.difference_update(batch.gone, set(batch.robots) - resting)
        if resting <= self._resting:
            return
        for row in np.flatnonzero(rests).tolist():
            knot = first[row]
            point = float(forecasts.x_m[knot]), float(forecasts.y_m[knot])
            datum = batch.floors[forecasts.floor[knot]]
            self.begin_rest(batch.robots[row], batch.vendors[row], datum, point, float(batch.event_s[row]))

    def begin_rest(self, uuid: str, vendor: str, datum: str, point: Point, at_s: float) -> None:
        """The robot stands at a point in the datum's frame; counts once until it drives or leaves."""
        if uuid in self._resting:
            return
        self._resting.add(uuid)
        x, y = point
        for resource, outline, (west, south, east, north) in self._places.get(datum, ()):
            if west <= x <= east and south <= y <= north and outline.contains(shapely.Point(point)):
                self._add_rest(vendor, resource, point, at_s)

    def drift_m(self) -> dict[tuple[str, ...], float]:
        """By vendor, how far its robots now rest from the marks; only vendors with enough rests."""
        return {
            (vendor,): hypot(median(x for x, _ in offsets), median(y for _, y in offsets))
            for vendor, offsets in self._offsets.items()
            if len(offsets) >= FEWEST_RESTS
        }

    def changed(self) -> dict[str, LevelChange]:
        """By vendor whose robots rest elsewhere than before: since when, and by how many metres."""
        changed = {}
        for vendor, levels in self._levels.items():
            changes = [level.change for level in levels if level.change]
            if changes:
                since_s = min(change.since_s for change in changes)
                changed[vendor] = LevelChange(since_s, hypot(*(change.by for change in changes)))
        return changed

    def learned(self) -> Part:
        """The marks, and the newest offsets from them."""
        marks = [[vendor, resource, list(points)] for (vendor, resource), points in self._first_rests.items()]
        offsets = {vendor: list(offsets) for vendor, offsets in self._offsets.items()}
        levels = {vendor: [level.learned() for level in levels] for vendor, levels in self._levels.items()}
        return FORM.part({"marks": marks, "offsets": offsets, "levels": levels})

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave, but for resources that are no more. Raises `UnreadableError`."""
        state = FORM.checked(part)
        try:
            levels = {
                vendor: (
                    ChangeDetector.resumed(LIMITS, x, MOST_OFFSET_M),
                    ChangeDetector.resumed(LIMITS, y, MOST_OFFSET_M),
                )
                for vendor, (x, y) in state["levels"].items()
            }
        except ValueError as error:
            raise UnreadableError(f"levels are not as they are written here: {error}") from error
        known = {resource for places in self._places.values() for resource, *_ in places}
        for vendor, resource, points in state["marks"]:
            if resource in known:
                self._first_rests[vendor, resource] = points[:MARK_RESTS]
        for vendor, offsets in state["offsets"].items():
            self._offsets[vendor] = deque(offsets, maxlen=NEWEST_RESTS)
        self._levels |= levels

    def _add_rest(self, vendor: str, resource: str, point: Point, at_s: float) -> None:
        first_rests = self._first_rests.setdefault((vendor, resource), [])
        if len(first_rests) < MARK_RESTS:
            first_rests.append(point)
            return
        mark = (median(x for x, _ in first_rests), median(y for _, y in first_rests))
        offset = (point[0] - mark[0], point[1] - mark[1])
        self._offsets.setdefault(vendor, deque(maxlen=NEWEST_RESTS)).append(offset)
        levels = self._levels.setdefault(vendor, (ChangeDetector(LIMITS), ChangeDetector(LIMITS)))
        for level, metres in zip(levels, offset, strict=True):
            level.add(metres, at_s)
        if not all(level.seen for level in levels):
            self._forget_marks(vendor)

    def _forget_marks(self, vendor: str) -> None:
        """Learn a vendor's marks again: its frame has been elsewhere for so long that this is now usual."""
        for key in [key for key in self._first_rests if key[0] == vendor]:
            del self._first_rests[key]
        del self._offsets[vendor], self._levels[vendor]
