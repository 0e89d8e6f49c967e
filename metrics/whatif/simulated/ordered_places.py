"""Places into which robots are let from one side at a time, whoever comes first."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from deconflict.simulation.driving.crossings import CrossingPassage, passage_of
from deconflict.simulation.driving.routes import Drive
from metrics.whatif.change import Change, ChangeError, NamedOutline
from metrics.whatif.demand import Demand
from metrics.whatif.road_crossings import direction
from metrics.whatif.roads import sampled_way

LEAST_WAYS = 3
"""So few ways through a place need no order."""


def ordered(places: Sequence[NamedOutline], demand: Demand) -> Change:
    """Robots enter a place from one side at a time. Raises `ChangeError` if hardly anybody drives through it."""
    ways = [(trip.floor, sampled_way(np.array(trip.corners))) for robot in demand.robots for trip in robot.trips]
    through = sum(any(place.floor == floor and place.holds(*way.T).any() for place in places) for floor, way in ways)
    if through < LEAST_WAYS:
        raise ChangeError(f"{through} trips lead through {places[0].name} in the log: {LEAST_WAYS} are needed")
    return Change(f"robots are let into {places[0].name} from one side at a time", ordered=tuple(places))


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


def place_passage(drive: Drive, node: int, place: NamedOutline) -> CrossingPassage | None:
    """The passage of a drive through a place; None if it does not lead through, or begins or ends there."""
    inside = np.flatnonzero(place.holds(drive.x_m, drive.y_m))
    if not len(inside) or inside[0] == 0 or inside[-1] == len(drive.x_m) - 1:
        return None
    enter, leave = int(inside[0]), int(inside[-1])
    inward, outward = (direction(float(drive.yaw_rad[sample])) for sample in (enter, leave))
    return replace(passage_of(drive, node, (enter, leave), inward, outward), left=True)
