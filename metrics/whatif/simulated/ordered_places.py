"""Places into which robots are let from one side at a time, whoever comes first."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from deconflict.foresight.losses.loss import Loss
from deconflict.settings.site import Site
from deconflict.simulation.driving.crossings import CrossingPassage, passage_of
from deconflict.simulation.driving.routes import Drive
from metrics.whatif.change import Change, ChangeError, NamedOutline, jammed, named_outlines
from metrics.whatif.demand import Demand, Stop, Trip, demand_of, simplified, without_loops
from metrics.whatif.recorded_tracks import RecordedFloor
from metrics.whatif.road_crossings import direction
from metrics.whatif.roads import sampled_way

LONGEST_WAIT_S = 60.0
"""A robot that stands in a crossing for longer has a reason of its own."""
LEAST_WAYS = 3
"""So few ways through a place need no order."""


def ordered(places: Sequence[NamedOutline], demand: Demand, losses: Iterable[Loss]) -> Change:
    """Robots enter a place from one side at a time. Raises `ChangeError` if hardly anybody drives through it.

    If robots stand for each other there in the log, nobody has kept an order: it is compared with a place without one.
    """
    ways = [(trip.floor, sampled_way(np.array(trip.corners))) for robot in demand.robots for trip in robot.trips]
    through = sum(any(place.floor == floor and place.holds(*way.T).any() for place in places) for floor, way in ways)
    if through < LEAST_WAYS:
        raise ChangeError(f"{through} trips lead through {places[0].name} in the log: {LEAST_WAYS} are needed")
    jams = jammed(places, losses)
    is_jammed = any(jam.jam_s for jam in jams)
    before = Change(wider=jams, unordered=tuple(places)) if is_jammed else None
    text = f"robots are let into {places[0].name} from one side at a time"
    return Change(text, ordered=tuple(places), wider=jams if is_jammed else (), before=before)


def with_order(
    drive: Drive, floor: int, found: Sequence[CrossingPassage], places: Sequence[NamedOutline], first_node: int
) -> tuple[CrossingPassage, ...]:
    """The crossings of a drive with these places, numbered from `first_node` on, instead of what they hold."""
    for number, place in enumerate(places):
        passage = place_passage(drive, first_node + number, place) if place.floor == floor else None
        if passage:
            kept = [each for each in found if each.leave_m <= passage.enter_m or each.enter_m >= passage.leave_m]
            found = sorted([*kept, passage], key=lambda each: each.enter_m)
    return tuple(found)


def demand_past_crossings(floor: RecordedFloor, site: Site) -> Demand:
    """The demand of a log. Who stands for a while in a zone of kind `crossing` has no goal there."""
    zones = [zone for zone in site.zones if zone.kind == "crossing" and zone.datum in floor.floors]
    places = [place for zone in zones for place in named_outlines(site, floor.floors, zone.id)]
    return without_stops(demand_of(floor), places)


def without_stops(demand: Demand, places: Sequence[NamedOutline]) -> Demand:
    """The demand without short stops in these places: the robots only waited there."""
    robots = [replace(robot, trips=tuple(_through(robot.trips, places))) for robot in demand.robots]
    return replace(demand, robots=tuple(robots))


def _through(trips: Sequence[Trip], places: Sequence[NamedOutline]) -> Iterable[Trip]:
    """Trips, each joined with the next one if it ends in one of these places."""
    before: Trip | None = None
    for trip in trips:
        joined = _joined(before, trip) if before else trip
        if before and joined is None:
            yield before
        before = joined or trip
        if not _waits_in(before.stop, places):
            yield before
            before = None
    if before:
        yield before


def _waits_in(stop: Stop, places: Sequence[NamedOutline]) -> bool:
    x_m, y_m = np.array([stop.place]).T
    is_inside = any(place.floor == stop.floor and place.holds(x_m, y_m)[0] for place in places)
    return is_inside and stop.stay_s <= LONGEST_WAIT_S


def _joined(before: Trip, after: Trip) -> Trip | None:
    """Two trips as one; None if the second one does not begin where the first one ends."""
    if before.floor != after.floor or before.corners[-1] != after.corners[0]:
        return None
    corners = simplified(without_loops(np.array([*before.corners, *after.corners[1:]])))
    ways = tuple(map(tuple, corners.tolist()))
    return replace(after, corners=ways, departs_s=before.departs_s, free_s=before.free_s + after.free_s)


def without_order(
    drive: Drive, floor: int, found: Sequence[CrossingPassage], places: Sequence[NamedOutline]
) -> tuple[CrossingPassage, ...]:
    """The crossings of a drive that lie in none of these places."""
    inside = np.zeros(len(drive.x_m), np.bool_)
    for place in places:
        if place.floor == floor:
            inside |= place.holds(drive.x_m, drive.y_m)
    middles = [round((each.enter_m + each.leave_m) / 2 / drive.step_m) for each in found]
    return tuple(each for each, middle in zip(found, middles, strict=True) if not inside[middle])


def place_passage(drive: Drive, node: int, place: NamedOutline) -> CrossingPassage | None:
    """The passage of a drive through a place; None if it does not lead through, or begins or ends there."""
    inside = np.flatnonzero(place.holds(drive.x_m, drive.y_m))
    if not len(inside) or inside[0] == 0 or inside[-1] == len(drive.x_m) - 1:
        return None
    enter, leave = int(inside[0]), int(inside[-1])
    inward, outward = (direction(float(drive.yaw_rad[sample])) for sample in (enter, leave))
    return replace(passage_of(drive, node, (enter, leave), inward, outward), left=True)
