"""The changes that can be asked about, and what each changes for the simulated robots."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np
import shapely

from deconflict.foresight.losses.loss import Loss, LossKind
from deconflict.operator.suggestions.evidence import Passes
from deconflict.settings.shared_places import Point, outlines
from deconflict.settings.site import Site
from deconflict.simulation.driving.passing import GAP_M
from deconflict.simulation.driving.routes import SpeedShare
from ingest.batch import Bools, Floats
from metrics.replay_files import LogError
from metrics.whatif.demand import Demand, Trip
from metrics.whatif.roads import IsForbidden, sampled_way

AGAINST_COS = -0.5
"""Driving against an aisle's direction: the cosine of the angle to it is less."""
ROOM_M = 1.2
"""Robots may leave their way by this much to pass others."""
LEAST_WIDER_M = 0.5
LEAST_PASS_M = 2.0
"""So far a trip leads through an aisle along it, or it only crosses it."""
LEAST_JAM_S, LEAST_JAMS = 4.0, 3
"""Shorter ones are no jams, and fewer say nothing."""

PARTS_APART_S = 1.0
"""Losses of a robot to the same other one are parts of one loss if no more lies between them."""


class ChangeError(LogError):
    """A change that can't be made. The message says what to change."""


@dataclass(frozen=True, slots=True, eq=False)
class NamedOutline:
    """A place of the site file: its name and outline on one floor."""

    name: str
    floor: int
    outline: shapely.Polygon
    axis: tuple[Point, Point] | None = None

    def holds(self, x_m: Floats, y_m: Floats) -> Bools:
        """(k,) whether it holds these points."""
        inside: Bools = shapely.contains_xy(self.outline, x_m, y_m)
        return inside


@dataclass(frozen=True, slots=True, eq=False)
class WiderPlace:
    """A place in which robots that meet stand for each other as long as in the log, perhaps with more room than now."""

    outline: NamedOutline
    beside_m: float
    """Further room to either side of each way through it."""
    jam_s: float
    """So long robots that meet there wait for each other before somebody clears the jam; 0 if the log does not say."""


def _unchanged(demand: Demand) -> Demand:
    return demand


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """What a change does to a floor. The default changes nothing."""

    text: str = "nothing changes"
    speed_shares: Mapping[int, SpeedShare] = field(default_factory=dict)
    """By floor, the greatest speed at each point as a share of the robot's own."""
    forbidden: Mapping[int, IsForbidden] = field(default_factory=dict)
    """By floor, where and in which direction nobody may drive."""
    wider: tuple[WiderPlace, ...] = ()
    ordered: tuple[NamedOutline, ...] = ()
    """Robots are let into these from one side at a time."""
    unordered: tuple[NamedOutline, ...] = ()
    """Robots enter these without regard to others."""
    first_vendor: str = ""
    """All others let the robots of this vendor go first."""
    before: "Change | None" = None
    """What is compared with; the floor as the model drives it if None."""
    advised_by: Site | None = None
    """Robots follow the advice of the service with this site file."""
    demand: Callable[[Demand], Demand] = _unchanged
    """The demand with the change."""


NO_CHANGE = Change()


def slow_zone(places: Sequence[NamedOutline], share: float) -> Change:
    """Robots drive at no more than this share of their greatest speed in a place."""
    shares: dict[int, SpeedShare] = {}
    for floor in {place.floor for place in places}:
        inside = [place for place in places if place.floor == floor]
        shares[floor] = lambda x_m, y_m, inside=inside: np.where(_in_any(inside, x_m, y_m), share, 1.0)  # type: ignore[misc]
    text = f"robots drive at {share:.0%} of their greatest speed at most in {places[0].name}"
    return Change(text, speed_shares=shares)


def one_way(aisle: NamedOutline, demand: Demand, *, reverse: bool = False) -> Change:
    """An aisle as one-way, in the direction in which more robots drive or in the other one."""
    unit = axis_of(aisle)
    trips = [trip for robot in demand.robots for trip in robot.trips]
    if (sum(_along_m(aisle, unit, trip) for trip in trips) < 0) != reverse:
        unit = -unit

    def is_against(x_m: Floats, y_m: Floats, heading: Floats) -> Bools:
        against: Bools = aisle.holds(x_m, y_m) & (heading @ unit < AGAINST_COS)
        return against

    return Change(f"{aisle.name} is one-way {_compass(unit)}", forbidden={aisle.floor: is_against})


def wider(places: Sequence[NamedOutline], demand: Demand, losses: Iterable[Loss], by_m: float | None = None) -> Change:
    """A place that is wider by so many metres; without them, by what any two robots need to pass each other. `losses`
    are those of the log."""
    if by_m is None:
        width_m = max(robot.track.width_m for robot in demand.robots)
        by_m = max(2 * (width_m / 2 + GAP_M + width_m - ROOM_M), LEAST_WIDER_M)
    text = f"{places[0].name} is {by_m:.1f} m wider, and robots pass each other there"
    before = Change(wider=jammed(places, losses))
    return Change(text, wider=tuple(replace(each, beside_m=by_m / 2) for each in before.wider), before=before)


def priority(vendor: str, demand: Demand) -> Change:
    """All others let the robots of a vendor go first. Raises `ChangeError` if it has none in the log."""
    vendors = sorted({robot.track.vendor for robot in demand.robots})
    if vendor not in vendors:
        raise ChangeError(f"{vendor!r} has no robots in the log; {', '.join(vendors)} have")
    if len(vendors) == 1:
        raise ChangeError(f"all robots in the log are of {vendor}: nobody else can let them go first")
    return Change(f"all others let the robots of {vendor} go first", first_vendor=vendor)


def named_outlines(site: Site, floors: Sequence[str], name: str) -> list[NamedOutline]:
    """The places of the site with this name or id. Raises `ChangeError` if there is none on the floors of the log."""
    every = [entry for entry in _outlines(site) if entry[2] in floors]
    found = [
        NamedOutline(label, floors.index(datum), shapely.Polygon(points), axis)
        for names, label, datum, points, axis in every
        if _plain(name) in map(_plain, names)
    ]
    if not found:
        known = ", ".join(dict.fromkeys(label for _, label, *_ in every))
        raise ChangeError(f"{name!r} is no place on the floors of the log; the site file has {known or 'none there'}")
    return found


def _plain(name: str) -> str:
    """A name without what people write in several ways: "Aisle 4" and "aisle-4" are the same."""
    return name.casefold().replace(" ", "-")


def _outlines(
    site: Site,
) -> Iterable[tuple[tuple[str, ...], str, str, Sequence[Point], tuple[Point, Point] | None]]:
    """Names, label, floor, outline and axis of each place."""
    for place in (*site.zones, *site.resources):
        for datum, points in outlines(place):
            yield (place.id, place.name), place.label, datum, points, getattr(place, "axis", None)
    for area in site.areas:
        yield (area.name,), area.name, area.floor or site.datums[0].id, area.outline_m, None


def jammed(places: Sequence[NamedOutline], losses: Iterable[Loss]) -> tuple[WiderPlace, ...]:
    """The places as they are, where robots that meet stand for each other as long as in the log."""
    jam_s = _jam_s(places, losses)
    return tuple(WiderPlace(place, 0.0, jam_s) for place in places)


def _jam_s(places: Sequence[NamedOutline], losses: Iterable[Loss]) -> float:
    """How long robots that met in a place stood for each other; the mean, since what they lose adds up.
    0 with too few cases."""
    met = [
        loss
        for loss in losses
        if loss.kind in (LossKind.HEAD_ON, LossKind.DEADLOCK)
        if any(place.floor == loss.floor and place.holds(*np.array([[loss.x_m], [loss.y_m]]))[0] for place in places)
    ]
    lengths_s = [length_s for length_s in _whole_s(met) if length_s >= LEAST_JAM_S]
    return float(np.mean(lengths_s)) if len(lengths_s) >= LEAST_JAMS else 0.0


def _whole_s(losses: Iterable[Loss]) -> Iterable[float]:
    """How long each robot stood for another one. The log has a long loss in parts that follow each other."""
    begun: dict[tuple[str, str], tuple[float, float]] = {}
    for loss in sorted(losses, key=lambda loss: loss.from_s):
        pair = loss.robot, loss.by
        from_s, until_s = begun.get(pair, (loss.from_s, loss.from_s))
        if loss.from_s - until_s > PARTS_APART_S:
            yield until_s - from_s
            from_s = loss.from_s
        begun[pair] = from_s, loss.until_s
    yield from (until_s - from_s for from_s, until_s in begun.values())


def _along_m(aisle: NamedOutline, unit: Floats, trip: Trip) -> float:
    """How much farther a trip leads through an aisle along a direction than against it."""
    if trip.floor != aisle.floor:
        return 0.0
    points = sampled_way(np.array(trip.corners))
    inside = aisle.holds(points[:-1, 0], points[:-1, 1])
    return float((np.diff(points, axis=0)[inside] @ unit).sum())


def passes_of(aisle: NamedOutline, demand: Demand) -> dict[str, Passes]:
    """By vendor, how often its robots drive an aisle along its axis, and how often against it."""
    unit, found = axis_of(aisle), dict[str, Passes]()
    for robot in demand.robots:
        along_m = [_along_m(aisle, unit, trip) for trip in robot.trips]
        along, against = (sum(sign * trip_m > LEAST_PASS_M for trip_m in along_m) for sign in (1, -1))
        before = found.get(robot.track.vendor, Passes(0, 0))
        found[robot.track.vendor] = Passes(before.along + along, before.against + against)
    return found


def axis_of(aisle: NamedOutline) -> Floats:
    """The direction of an aisle's axis, or of its longer side."""
    if aisle.axis:
        ends = np.array(aisle.axis)
        along = ends[1] - ends[0]
    else:
        corners = np.array(aisle.outline.minimum_rotated_rectangle.exterior.coords)
        sides = np.diff(corners, axis=0)[:2]
        along = sides[np.argmax(np.hypot(*sides.T))]
    unit: Floats = along / hypot(*along)
    return unit


def _in_any(places: Sequence[NamedOutline], x_m: Floats, y_m: Floats) -> Bools:
    inside = np.zeros(np.shape(x_m), np.bool_)
    for place in places:
        inside |= place.holds(x_m, y_m)
    return inside


def _compass(unit: Floats) -> str:
    """A direction in the frame of the floor, as text."""
    axis = int(np.argmax(np.abs(unit)))
    return f"towards {'larger' if unit[axis] > 0 else 'smaller'} {'xy'[axis]}"
