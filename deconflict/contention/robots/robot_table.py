"""What contention knows of each robot: where it stands, what it has, where it goes next and by which way."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.ops import substring

from deconflict.contention.robots import record_kernels
from deconflict.contention.robots.announced_arrivals import ARRIVED_M
from deconflict.contention.robots.arrival_forecast import Arrivals, Corrections
from deconflict.contention.robots.batch_merging import Gathered
from deconflict.contention.robots.battery_use import Batteries
from deconflict.contention.robots.bounding_boxes import ROUNDING_M
from deconflict.contention.robots.destinations import Stop, expect, set_out
from deconflict.contention.robots.lookahead import STEP_S, STEPS, Ahead, Ways, ahead, corners, ways_ahead
from deconflict.contention.robots.place_geometry import Geometry, Passage
from deconflict.contention.robots.record_kernels import ROBOT, STANDS_M, STOP, STRAIGHT, WAY_M, Drawn, take_in
from deconflict.contention.robots.robot_view import Seen
from ingest.batch import Basis, Batch, Bools, Floats, Ints
from ingest.kernels import ready

RESTING = frozenset(("idle", "charging", "disabled", "offline"))
"""States of robots that want to go nowhere now."""


class Robots(Mapping[str, Seen]):
    """Every robot, by UUID; takes in those that changed."""

    def __init__(self, geometry: Geometry) -> None:
        self.arrivals, self.batteries = Arrivals(), Batteries()
        self._geometry = geometry
        self._slots: dict[str, int] = {}
        self._free: list[int] = []
        self.uuids: list[str] = []
        """By slot."""
        self.records = np.zeros(0, ROBOT)
        """By slot, and some to spare."""
        self.stops = np.zeros((0, 1), STOP)
        """By slot, as many of each robot as its record says."""
        self._ways = np.zeros((0, STEPS + 1, 2))
        """By slot, the way of a robot that goes, or that it was on last."""
        self.datums: list[str] = []
        """Floors by their numbers in records, stops and outlines; -1 is of what is compared with nothing."""
        self._resources = self._drawn(geometry.resource_boxes())
        self._zones = self._drawn(geometry.zone_boxes())
        self._places = list(geometry.resources)
        self._numbered = {place: number for number, place in enumerate(self._places)}
        self._words: dict[str, tuple[str, str, str]] = {}
        """Vendor, name and state."""
        self._here: dict[int, tuple[str, float]] = {}
        """By slot, the resource that a robot has, and since when."""
        self._passages: dict[int, dict[str, Passage]] = {}
        """By slot."""
        self._ways_left: dict[int, shapely.LineString] = {}
        """By slot, of those that wait on their way, until they are through or rest."""
        self._seen: dict[str, Seen] = {}
        """As they were asked for since robots were taken in."""

    def __getitem__(self, uuid: str) -> Seen:
        return self._seen.get(uuid) or self._seen.setdefault(uuid, self._told(uuid))

    def __iter__(self) -> Iterator[str]:
        return iter(self._slots)

    def __len__(self) -> int:
        return len(self._slots)

    def forget(self, uuids: Iterable[str]) -> None:
        for uuid in uuids:
            self.arrivals.forget(uuid)
            slot = self._slots.pop(uuid, None)
            if slot is not None:
                self.records[slot] = np.zeros((), ROBOT)
                self.batteries.forget(slot)
                for kept in (self._here, self._passages, self._ways_left):
                    kept.pop(slot, None)
                del self._words[uuid]
                self._free.append(slot)
        self._seen.clear()

    def look(self, gathered: Gathered) -> list[tuple[str, float]]:
        """Take in the robots of a batch; the resources that robots have left, and for how long they had them."""
        batch, now_s = gathered
        if not len(batch):
            return []
        self._seen.clear()
        view, told = ahead(batch.forecasts, now_s), batch.forecasts
        ways = ways_ahead(view, np.where(batch.basis == Basis.VELOCITY, STRAIGHT, STEPS))
        slots = self._slotted(batch.robots)
        numbers = np.array([self._number(floor) for floor in batch.floors], np.int64)
        self._words.update(zip(batch.robots, zip(batch.vendors, batch.names, batch.states, strict=True), strict=True))
        before_pct = self._levels(batch, slots)
        corrections = self.arrivals.hear(batch, now_s, (view.floor[:, 0], view.x_m[:, 0], view.y_m[:, 0]))
        counts, bound = self._set_out(batch, now_s, view, corrections, slots, numbers)
        asked = take_in(
            self.records,
            self._ways,
            slots,
            numbers,
            ready(batch.event_s),
            np.array([state in RESTING for state in batch.states], np.bool_),
            ready(batch.basis, np.int64),
            *(view.x_m, view.y_m, view.yaw_rad),
            view.floor,
            *(ways.lines_m, ways.boxes_m, ways.way_m),
            *(ready(told.length_m), ready(told.width_m), ready(told.bottom_m), ready(told.top_m)),
            counts,
            bound,
            *self._resources,
            *self._zones,
            ROUNDING_M,
        )
        left = self._ask(batch, view, ways, slots, asked, before_pct) if asked.any() else []
        if len(batch.destinations.t_s):
            expect(self.records, self.stops, slots, now_s, corrections)
        return left

    def _levels(self, batch: Batch, slots: Ints) -> Floats:
        """Take in levels of batteries, where there are chargers: (n,) those before, nan where they are not known."""
        if not self._geometry.chargers or np.isnan(batch.battery_pct).all():
            return np.full(len(batch), np.nan)
        told = (batch.event_s, batch.battery_pct, batch.run_time_left_s)
        return self.batteries.take_in(slots, batch.vendors, *told)

    def _ask(
        self, batch: Batch, view: Ahead, ways: Ways, slots: Ints, asked: Ints, before_pct: Floats
    ) -> list[tuple[str, float]]:
        """Ask shapes what is to be asked of them; the resources that robots have left, and for how long they had them.

        Of a robot that is there twice, where it goes is asked at the last.
        """
        newest = self.records["row"][slots] == np.arange(len(slots))
        passes = np.flatnonzero(asked & record_kernels.PASSES)
        for slot in slots[passes].tolist():
            self._passages.pop(slot, None)
        self._pass(batch, view, ways, slots, passes[newest[passes]])
        self._wait(batch, view, slots, asked)
        left = self._come(batch, view, slots, np.flatnonzero(asked & record_kernels.BESIDE), before_pct)
        self._name_stops(slots[newest & (asked & record_kernels.BOUND > 0)])
        ends = np.flatnonzero(newest & (asked & record_kernels.ENDS > 0))
        self._follow(batch, view, slots, ends[self.records["stops"][slots[ends]] == 0])
        return left

    def _come(self, batch: Batch, view: Ahead, slots: Ints, rows: Ints, before_pct: Floats) -> list[tuple[str, float]]:
        """Who has which resource."""
        if not len(rows):
            return []
        left = []
        here = self._geometry.resources_at(batch.datums(view.floor[rows, 0]), view.x_m[rows, 0], view.y_m[rows, 0])
        chargers = self._geometry.chargers
        for row, slot, place in zip(rows.tolist(), slots[rows].tolist(), here, strict=True):
            (had, came_s), event_s = self._here.get(slot, (None, 0.0)), float(batch.event_s[row])
            if place != had:
                if had:
                    left.append((had, event_s - came_s))
                    del self._here[slot]
                if had in chargers:
                    self.batteries.left(slot, batch.vendors[row], had, float(batch.battery_pct[row]))
                if place:
                    self._here[slot] = place, event_s
                if place in chargers:
                    self.batteries.came(slot, float(before_pct[row]))
                self.records["here"][slot] = place is not None
        return left

    def _pass(self, batch: Batch, view: Ahead, ways: Ways, slots: Ints, rows: Ints) -> None:
        """Which zones are on whose way."""
        if not len(rows):
            return
        datums, sizes = batch.datums(view.floor[rows, 0]), batch.forecasts
        found = self._geometry.passages(
            datums, view.take(rows), ways.take(rows), sizes.length_m[rows], sizes.width_m[rows]
        )
        self._passages |= {int(slots[rows[row]]): passages for row, passages in found.items()}

    def _wait(self, batch: Batch, view: Ahead, slots: Ints, asked: Ints) -> None:
        """What is left of whose way."""
        for row in np.flatnonzero(
            asked & (record_kernels.HALTS | record_kernels.MOVES | record_kernels.GOES_ON)
        ).tolist():
            slot = int(slots[row])
            way = self._ways_left.pop(slot, None)
            if asked[row] & record_kernels.HALTS:
                way = shapely.linestrings(self._ways[slot])
            if way is not None and not asked[row] & record_kernels.GOES_ON:
                way = _rest_of(way, shapely.Point(view.x_m[row, 0], view.y_m[row, 0]), batch.forecasts.length_m[row])
            if way is not None and not asked[row] & record_kernels.GOES_ON:
                self._ways_left[slot] = way
            self.records["waits"][slot] = slot in self._ways_left

    def _name_stops(self, slots: Ints) -> None:
        """Which resources stops are at, and who is at one already."""
        if not len(slots):
            return
        which, number = np.nonzero(np.arange(self.stops.shape[1]) < self.records["stops"][slots][:, None])
        stops = self.stops[slots[which], number]
        datums = [self.datum(floor) for floor in stops["floor"].tolist()]
        found = self._geometry.resources_at(datums, stops["x_m"].copy(), stops["y_m"].copy())
        self.stops["resource"][slots[which], number] = [
            -1 if place is None else self._numbered[place] for place in found
        ]
        for slot in slots.tolist():
            if slot in self._here:
                self._leave_out(slot, self._numbered[self._here[slot][0]])

    def _leave_out(self, slot: int, here: int) -> None:
        """The stops at the head that a robot which has the resource `here` is at already."""
        one, stops = self.records[slot], self.stops[slot]
        done, count = 0, int(one["stops"])
        while done < count and (stops["resource"][done] == here or _is_at(one, stops[done])):
            done += 1
        stops[: count - done] = stops[done:count].copy()
        one["stops"] = count - done

    def _follow(self, batch: Batch, view: Ahead, slots: Ints, rows: Ints) -> None:
        """Where those go that tell no destination: to the resource that their way ends in, unless they have it."""
        if not len(rows):
            return
        ends = self._geometry.resources_at(batch.datums(view.floor[rows, 0]), view.x_m[rows, -1], view.y_m[rows, -1])
        for row, slot, end in zip(rows.tolist(), slots[rows].tolist(), ends, strict=True):
            if end and end != self._here.get(slot, ("", 0.0))[0]:
                x_m, y_m = view.x_m[row, -1], view.y_m[row, -1]
                short_m = np.hypot(view.x_m[row] - x_m, view.y_m[row] - y_m)
                arrives_s, floor = view.t_s[row, int(np.argmax(short_m < STANDS_M))], self.records["floor"][slot]
                self.stops[slot, 0] = *[arrives_s] * 3, STEP_S, x_m, y_m, floor, self._numbered[end]
                self.records["stops"][slot], self.records["bound"][slot] = 1, True

    def _set_out(
        self, batch: Batch, now_s: Floats, view: Ahead, corrections: Corrections, slots: Ints, numbers: Ints
    ) -> tuple[Ints, Bools]:
        """Take in where robots go, as they say: (n,) how many stops each has, and whether any may be a resource."""
        told = batch.destinations
        if not len(told.t_s):
            return np.zeros(len(batch), np.int64), np.zeros(len(batch), np.bool_)
        spare = int((told.start[1:] - told.start[:-1]).max()) - self.stops.shape[1]
        if spare > 0:
            self.stops = np.pad(self.stops, ((0, 0), (0, spare)))
        return set_out(self.stops, slots, numbers, told, now_s, view, corrections, self._resources)

    def _slotted(self, uuids: Sequence[str]) -> Ints:
        slots = [self._slots.get(uuid, -1) for uuid in uuids]
        if -1 in slots:
            slots = [self._slot(uuid) for uuid in uuids]
        return np.array(slots, np.int64)

    def _slot(self, uuid: str) -> int:
        slot = self._slots.get(uuid)
        if slot is None:
            slot = self._slots[uuid] = self._free.pop() if self._free else len(self.uuids)
            if slot == len(self.uuids):
                self.uuids.append(uuid)
            self.uuids[slot] = uuid
            if slot >= len(self.records):
                more = (0, slot + 1)
                self.records, self.stops = np.pad(self.records, more), np.pad(self.stops, (more, (0, 0)))
                self._ways = np.pad(self._ways, (more, (0, 0), (0, 0)))
                self.batteries.make_room(len(self.records))
        return slot

    def datum(self, floor: int) -> str:
        return self.datums[floor] if floor >= 0 else ""

    def _number(self, datum: str) -> int:
        if datum not in self.datums:
            self.datums.append(datum)
        return self.datums.index(datum)

    def _drawn(self, boxes_m: Sequence[tuple[str, Floats]]) -> Drawn:
        floors = [self._number(datum) for datum, around_m in boxes_m for _ in around_m]
        return np.array(floors, np.int64), np.concatenate([np.empty((0, 4)), *(around_m for _, around_m in boxes_m)])

    def _told(self, uuid: str) -> Seen:
        slot = self._slots[uuid]
        numbers: tuple[Any, ...] = self.records[slot].item()
        *told, floor, count = numbers[: record_kernels.SEEN]
        stops = tuple(map(self._stop, self.stops[slot, :count].tolist())) if count else ()
        here, came_s = self._here.get(slot, (None, 0.0))
        passages = self._passages.get(slot, {})
        fields: tuple[Any, ...] = (*told, self.datum(floor), here, came_s, stops, passages)
        return Seen(uuid, *self._words[uuid], *fields)

    def _stop(self, told: tuple[float, float, float, float, float, float, int, int]) -> Stop:
        told_s, t_s, expected_s, spread_s, x_m, y_m, floor, number = told
        resource = self._places[number] if number >= 0 else None
        return Stop(told_s, t_s, expected_s, spread_s, self.datum(floor), x_m, y_m, resource)

    def vendors(self, slots: Ints) -> list[str]:
        """(n,)"""
        return [self._words[self.uuids[slot]][0] for slot in slots.tolist()]

    def passing(self) -> list[Seen]:
        """Those with a zone on their way."""
        return [self[self.uuids[slot]] for slot in self._passages]

    def placed(self) -> list[Seen]:
        """Those that have a resource."""
        return [self[self.uuids[slot]] for slot in self._here]

    def bound(self) -> list[Seen]:
        """Those that may go to a resource, and all that do."""
        return [self[self.uuids[slot]] for slot in np.flatnonzero(self.records["bound"]).tolist()]

    def outlines(self, slots: Sequence[int]) -> NDArray[np.object_]:
        """Envelopes of robots."""
        one = self.records[slots]
        found: NDArray[np.object_] = shapely.polygons(
            corners(one["x_m"], one["y_m"], one["yaw_rad"], one["length_m"], one["width_m"])
        )
        return found

    def ways(self, slots: Sequence[int]) -> list[shapely.LineString]:
        """Ways of robots, as far as they are forecast; of those that go nowhere, what is left of theirs."""
        left = [self._ways_left.get(slot) for slot in slots]
        lines = iter(shapely.linestrings(self._ways[[s for s, way in zip(slots, left, strict=True) if way is None]]))
        return [next(lines) if way is None else way for way in left]


def _is_at(one: np.void, stop: np.void) -> bool:
    away_m = np.hypot(stop["x_m"] - one["x_m"], stop["y_m"] - one["y_m"])
    return bool(stop["floor"] == one["floor"] and away_m <= ARRIVED_M)


def _rest_of(way: shapely.LineString, here: shapely.Point, length_m: float) -> shapely.LineString | None:
    """What is left of its way to a robot that has come to stand on it; None once it is through, or off it."""
    done_m = float(shapely.line_locate_point(way, here))
    if way.length - done_m < WAY_M or shapely.distance(way, here) > length_m:
        return None
    return way if done_m == 0 else substring(way, done_m, way.length)
