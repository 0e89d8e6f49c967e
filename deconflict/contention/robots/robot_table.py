"""What contention knows of each robot: where it stands, what it has, where it goes next and by which path."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from deconflict.contention.robots import record_kernels
from deconflict.contention.robots.arrival_forecast import ArrivalCorrections, ArrivalForecast
from deconflict.contention.robots.battery_use import BatteryUse
from deconflict.contention.robots.bodies_ahead import bodies_ahead, reported_poses
from deconflict.contention.robots.bounding_boxes import ROUNDING_M
from deconflict.contention.robots.destinations import PlannedStop, begin_ways, is_at, postpone_overdue, write_stops
from deconflict.contention.robots.lookahead import (
    STEP_S,
    STEPS,
    Lookahead,
    PathsAhead,
    corners,
    look_ahead,
    paths_ahead,
)
from deconflict.contention.robots.place_geometry import PlaceGeometry, PlaceOutlines, ZonePassage
from deconflict.contention.robots.record_kernels import AT_REST, ROBOT, STANDS_M, STOP, STRAIGHT, Outlines, rest_of
from deconflict.contention.robots.robot_view import FirstFields, RobotView, first_fields
from deconflict.sweep.robot_slots import RobotSlots
from deconflict.sweep.shapes.trailers import rows_of_trains
from ingest.batch import Basis, Batch, Bools, Floats, Ints
from ingest.kernels import ready

RESTING = frozenset(("idle", "charging", "disabled", "offline"))
"""States of robots that are not on their way."""


class RobotTable(Mapping[str, RobotView]):
    """Every robot, by UUID."""

    def __init__(self, geometry: PlaceGeometry, slots: RobotSlots) -> None:
        self.slots, self._geometry = slots, geometry
        """Of these robots, and maybe of others. They are not freed here."""
        self.arrivals, self.batteries = ArrivalForecast(slots), BatteryUse()
        self.records = np.zeros(0, ROBOT)
        """By slot, with spare rows."""
        self.stops = np.zeros((0, 1), STOP)
        """By slot and number; a robot's record says how many it has."""
        self.steps_m = np.zeros((0, STEPS + 1, 2))
        """(slots, STEPS + 1, 2) the path of a robot that moves, or the last path it was on."""
        self.datums, self._numbers = list[str](), dict[str, int]()
        """Datums of floors by their numbers in records, stops and outlines, and the reverse; floor -1 is not known."""
        self._resources = self._outlines(geometry.resource_outlines)
        self._zones = self._outlines(geometry.zone_outlines)
        self._places = list(geometry.resources)
        self._place_number = {place: number for number, place in enumerate(self._places)}
        self._names: dict[str, FirstFields] = {}
        """By UUID, the first fields of its view."""
        self._here: dict[int, tuple[str, float]] = {}
        """By slot, the resource that a robot has, and since when."""
        self._passages: dict[int, dict[str, ZonePassage]] = {}
        """By slot and zone."""
        self._paths_left: dict[int, shapely.LineString] = {}
        """By slot, what is left of the path of a robot that has stopped on it."""
        self._views: dict[str, RobotView] = {}
        """Views that were asked for since the last update."""

    def __getitem__(self, uuid: str) -> RobotView:
        return self._views.get(uuid) or self._views.setdefault(uuid, self._view(uuid))

    def __contains__(self, uuid: object) -> bool:
        return uuid in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def forget(self, uuids: Iterable[str]) -> None:
        for uuid in uuids:
            if not self._names.pop(uuid, None):
                continue
            self.arrivals.forget(uuid)
            slot = self.slots.by_uuid[uuid]
            self.records[slot] = np.zeros((), ROBOT)
            self.batteries.forget(slot)
            for by_slot in (self._here, self._passages, self._paths_left):
                by_slot.pop(slot, None)
        self._views.clear()

    def update(self, batch: Batch) -> list[tuple[str, float]]:
        """Update the robots of a batch; return the resources that robots have left, and for how long they had them."""
        if not len(batch):
            return []
        self._views.clear()
        view, f = look_ahead(batch.forecasts, batch.now_s), batch.forecasts
        paths = paths_ahead(view, np.where(batch.basis == Basis.VELOCITY, STRAIGHT, STEPS))
        slots, _ = self.slots.assign(batch.robots)
        self._grow(len(self.slots))
        floor_numbers = np.array([self._floor_number(datum) for datum in batch.floors], np.int64)
        self._names.update(zip(batch.robots, first_fields(batch), strict=True))
        corrections = self.arrivals.add_batch(batch, (view.floor[:, 0], view.x_m[:, 0], view.y_m[:, 0]))
        counts, bound = self._add_stops(batch, view, corrections, slots, floor_numbers)
        is_new = ~self.records["known"][slots] & (batch.basis == Basis.VELOCITY) & (counts > 0)
        begin_ways(self.records, self.steps_m, self.stops, slots[is_new], paths.lines_m[is_new, 0])
        stale = record_kernels.update_records(
            self.records,
            self.steps_m,
            slots,
            floor_numbers,
            ready(batch.event_s),
            reported_poses(f),
            np.array([state in RESTING for state in batch.states], np.bool_),
            ready(batch.basis, np.int64),
            view,
            paths,
            (ready(f.length_m), ready(f.width_m), ready(f.bottom_m), ready(f.top_m)),
            counts,
            bound,
            self._resources,
            self._zones,
            ROUNDING_M,
        )
        stale[rows_of_trains(f)] |= record_kernels.PASSAGES
        left = self._update_places(batch, view, paths, slots, stale, self._add_levels(batch, slots))
        if len(batch.destinations.t_s):
            postpone_overdue(self.records, self.stops, slots, batch.now_s, corrections)
        return left

    def _add_levels(self, batch: Batch, slots: Ints) -> Floats:
        """Add levels of batteries, if there are chargers; (n,) the levels before, nan if not known."""
        if not self._geometry.chargers or np.isnan(batch.amounts["battery_pct"]).all():
            return np.full(len(batch), np.nan)
        levels = (batch.event_s, batch.amounts["battery_pct"], batch.amounts["run_time_left_s"])
        return self.batteries.add_levels(slots, batch.vendors, *levels)

    def _update_places(
        self, batch: Batch, view: Lookahead, paths: PathsAhead, slots: Ints, stale: Ints, level_before_pct: Floats
    ) -> list[tuple[str, float]]:
        """Find the places and zones of the robots whose bits in `stale` say so. Returns what `update` returns.

        If a robot is in the batch twice, its second row decides where it goes.
        """
        if not (stale & ~AT_REST).any():
            return []
        newest = self.records["row"][slots] == np.arange(len(slots))
        rows = np.flatnonzero(stale & record_kernels.PASSAGES)
        for slot in slots[rows].tolist():
            self._passages.pop(slot, None)
        self._update_passages(batch, view, paths, slots, rows[newest[rows]], stale)
        self._update_paths_left(batch, view, slots, stale)
        rows = np.flatnonzero(stale & record_kernels.RESOURCE)
        left = self._update_resources(batch, view, slots, rows, stale, level_before_pct)
        self._locate_stops(slots[newest & (stale & record_kernels.STOPS > 0)])
        ends = np.flatnonzero(newest & (stale & record_kernels.PATH_END > 0))
        self._infer_stops(batch, view, slots, ends[self.records["stops"][slots[ends]] == 0])
        return left

    def _update_resources(
        self, batch: Batch, view: Lookahead, slots: Ints, rows: Ints, stale: Ints, level_before_pct: Floats
    ) -> list[tuple[str, float]]:
        """Update which robot has which resource; for what it returns see `update`."""
        if not len(rows):
            return []
        left, chargers = list[tuple[str, float]](), self._geometry.chargers
        reported_m, believed_m = reported_poses(batch.forecasts)[rows].T, (view.x_m[rows, 0], view.y_m[rows, 0])
        x_m, y_m = (np.where(stale[rows] & AT_REST, *at_m) for at_m in zip(reported_m, believed_m, strict=False))
        here = self._geometry.resources_at(batch.datums(view.floor[rows, 0]), x_m, y_m)
        for row, slot, place in zip(rows.tolist(), slots[rows].tolist(), here, strict=True):
            (before, came_s), event_s = self._here.get(slot, (None, 0.0)), float(batch.event_s[row])
            if place != before:
                if before:
                    left.append((before, event_s - came_s))
                    del self._here[slot]
                if before in chargers:
                    self.batteries.leave_charger(
                        slot, batch.vendors[row], before, float(batch.amounts["battery_pct"][row])
                    )
                if place:
                    self._here[slot] = place, event_s
                if place in chargers:
                    self.batteries.arrive_at_charger(slot, float(level_before_pct[row]))
                self.records["here"][slot] = place is not None
        return left

    def _update_passages(
        self, batch: Batch, view: Lookahead, paths: PathsAhead, slots: Ints, rows: Ints, stale: Ints
    ) -> None:
        """Update which zones are on the way of the robots of `rows`."""
        if not len(rows):
            return
        bodies = bodies_ahead(batch.forecasts.take(rows), view.at_rows(rows), paths.at_rows(rows), batch.now_s)
        found = self._geometry.passages(batch.datums(view.floor[rows, 0]), bodies, stale[rows] & AT_REST > 0)
        self._passages |= {int(slots[rows[row]]): passages for row, passages in found.items()}

    def _update_paths_left(self, batch: Batch, view: Lookahead, slots: Ints, stale: Ints) -> None:
        """Update what is left of the paths of robots that have stopped on them."""
        halts, moves, ends = record_kernels.HALTS, record_kernels.MOVES, record_kernels.WAIT_ENDS
        for row in np.flatnonzero(stale & (halts | moves | ends)).tolist():
            slot = int(slots[row])
            path = self._paths_left.pop(slot, None)
            here, length_m = (view.x_m[row, 0], view.y_m[row, 0]), batch.forecasts.length_m[row]
            if stale[row] & halts:
                path = record_kernels.path_from(here, self.steps_m[slot], length_m)
            left = None if path is None or stale[row] & ends else rest_of(path, shapely.Point(here), length_m)
            if left is not None:
                self._paths_left[slot] = left
            self.records["waits"][slot] = slot in self._paths_left

    def _locate_stops(self, slots: Ints) -> None:
        """Set the resources of robots' stops, and drop stops that a robot is at already."""
        if not len(slots):
            return
        which, number = np.nonzero(np.arange(self.stops.shape[1]) < self.records["stops"][slots][:, None])
        stops = self.stops[slots[which], number]
        datums = list(map(self.datum, stops["floor"].tolist()))
        found = self._geometry.resources_at(datums, stops["x_m"].copy(), stops["y_m"].copy())
        numbers = [-1 if place is None else self._place_number[place] for place in found]
        self.stops["resource"][slots[which], number] = numbers
        for slot in slots.tolist():
            if slot in self._here:
                self._drop_reached_stops(slot, self._place_number[self._here[slot][0]])

    def _drop_reached_stops(self, slot: int, here: int) -> None:
        """Drop the first stops that a robot is at already, as it has the resource with the number `here`."""
        record, stops = self.records[slot], self.stops[slot]
        reached, count = 0, int(record["stops"])
        while reached < count and (stops["resource"][reached] == here or is_at(record, stops[reached])):
            reached += 1
        stops[: count - reached] = stops[reached:count].copy()
        record["stops"] = count - reached

    def _infer_stops(self, batch: Batch, view: Lookahead, slots: Ints, rows: Ints) -> None:
        """Set the stop of robots that announce none: the resource in which their path ends, if they do not have it."""
        if not len(rows):
            return
        ends = self._geometry.resources_at(batch.datums(view.floor[rows, 0]), view.x_m[rows, -1], view.y_m[rows, -1])
        for row, slot, end in zip(rows.tolist(), slots[rows].tolist(), ends, strict=True):
            if end and end != self._here.get(slot, ("", 0.0))[0]:
                x_m, y_m = view.x_m[row, -1], view.y_m[row, -1]
                short_m = np.hypot(view.x_m[row] - x_m, view.y_m[row] - y_m)
                arrives_s, floor = view.t_s[row, int(np.argmax(short_m < STANDS_M))], self.records["floor"][slot]
                self.stops[slot, 0] = *[arrives_s] * 3, STEP_S, x_m, y_m, floor, self._place_number[end]
                self.records["stops"][slot], self.records["bound"][slot] = 1, True

    def _add_stops(
        self,
        batch: Batch,
        view: Lookahead,
        corrections: ArrivalCorrections,
        slots: Ints,
        floor_numbers: Ints,
    ) -> tuple[Ints, Bools]:
        """Write the announced destinations: (n,) how many stops each robot has, and whether any may be a resource."""
        destinations = batch.destinations
        if not len(destinations.t_s):
            return np.zeros(len(batch), np.int64), np.zeros(len(batch), np.bool_)
        places = self._resources
        floor = floor_numbers, destinations, batch.now_s, view, corrections, places
        self.stops, counts, bound = write_stops(self.stops, slots, *floor)
        return counts, bound

    def _grow(self, slots: int) -> None:
        if slots > len(self.records):
            self.records, self.stops = np.pad(self.records, (0, slots)), np.pad(self.stops, ((0, slots), (0, 0)))
            self.steps_m = np.pad(self.steps_m, ((0, slots), (0, 0), (0, 0)))
            self.batteries.make_room(len(self.records))

    def datum(self, floor: int) -> str:
        return self.datums[floor] if floor >= 0 else ""

    def _floor_number(self, datum: str) -> int:
        if datum not in self._numbers:
            self.datums.append(datum)
        return self._numbers.setdefault(datum, len(self._numbers))

    def _outlines(self, places: Sequence[PlaceOutlines]) -> Outlines:
        """Of places, by the boxes around them."""
        floors = [self._floor_number(of_datum.datum) for of_datum in places for _ in of_datum.ids]
        all_m = np.concatenate([np.empty((0, 4)), *(of_datum.bounds_m for of_datum in places)])
        return Outlines(np.array(floors, np.int64), all_m)

    def _view(self, uuid: str) -> RobotView:
        names, slot = self._names[uuid], self.slots.by_uuid[uuid]
        record: tuple[Any, ...] = self.records[slot].item()
        *viewed, floor, count = record[: record_kernels.VIEWED_FIELDS]
        stops = tuple(map(self._stop, self.stops[slot, :count].tolist())) if count else ()
        here, came_s = self._here.get(slot, (None, 0.0))
        fields: tuple[Any, ...] = (*viewed, self.datum(floor), here, came_s, stops, self._passages.get(slot, {}))
        return RobotView(uuid, *names, *fields)

    def _stop(self, stop: tuple[float, float, float, float, float, float, int, int]) -> PlannedStop:
        announced_s, t_s, expected_s, spread_s, x_m, y_m, floor, number = stop
        resource = self._places[number] if number >= 0 else None
        return PlannedStop(announced_s, t_s, expected_s, spread_s, self.datum(floor), x_m, y_m, resource)

    def vendors(self, slots: Ints) -> list[str]:
        """The vendors of robots, in that order."""
        return [self._names[uuid][0] for uuid in self.slots.names(slots)]

    def passing(self) -> list[RobotView]:
        """Robots with a zone on their way."""
        return [self[self.slots.uuids[slot]] for slot in self._passages]

    def placed(self) -> list[RobotView]:
        """Robots that have a resource."""
        return [self[self.slots.uuids[slot]] for slot in self._here]

    def bound(self) -> list[RobotView]:
        """All robots that go to a resource, and some that may."""
        return [self[uuid] for uuid in self.slots.names(np.flatnonzero(self.records["bound"]))]

    def outlines(self, slots: Sequence[int]) -> NDArray[np.object_]:
        """The envelopes of robots."""
        records = self.records[slots]
        columns = (records[name] for name in ("x_m", "y_m", "yaw_rad", "length_m", "width_m"))
        outlines: NDArray[np.object_] = shapely.polygons(corners(*columns))
        return outlines

    def reported_pose(self, uuid: str) -> tuple[float, float, float]:
        """x, y and yaw of a robot in its newest report."""
        record = self.records[self.slots.by_uuid[uuid]]
        return float(record["reported_x_m"]), float(record["reported_y_m"]), float(record["reported_yaw_rad"])

    def rests_since_s(self, uuid: str) -> float:
        """Since when a robot is reported where it is."""
        return float(self.records["rests_s"][self.slots.by_uuid[uuid]])

    def paths(self, slots: Sequence[int]) -> list[shapely.LineString]:
        """The paths of robots as far as they are forecast; of robots that have stopped on theirs, what is left."""
        left = [self._paths_left.get(slot) for slot in slots]
        moving_m = self.steps_m[[slot for slot, path in zip(slots, left, strict=True) if path is None]]
        lines = iter(shapely.linestrings(moving_m))
        return [next(lines) if path is None else path for path in left]
