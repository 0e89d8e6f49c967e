"""Which robots will need a charger within a quarter of an hour without having announced it, and whether there is room.

The probability that a robot comes to a charger follows from the level of its battery, from its drain, and from the
levels at which robots of its vendor came. It may go to any charger of its floor at which robots of its vendor were
charged, or to any charger of its floor if there is none. Chargers among which a robot may choose are one pool.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from deconflict.contention.queues.queue_forecast import QueueForecast
from deconflict.contention.robots.battery_use import LEVELS_PCT, BatteryUse
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.contention.robots.robot_view import RobotView
from deconflict.foresight.motion_assumptions import RESTING_STATES
from ingest.batch import Floats, Ints

AHEAD_S: Floats = np.arange(60.0, 901.0, 60.0)
"""Robots may announce destinations up to a quarter of an hour ahead (standard 5.2.3)."""
LIKELY, HELD = 0.8, 0.6
"""Probability of full chargers from which a shortage is found, and down to which it then stands."""
LEAST_LIKELY = 0.05
"""Robots that are less likely to need a charger within the time are left out."""
FEWEST_BELOW = 0.05
"""At least this share of a vendor's robots is taken to come at lower levels still. A robot that is below nearly all
others follows rules of its own, and is not expected at any moment."""


class ChargingNeed(NamedTuple):
    """A robot that may need a charger."""

    robot: str
    level_pct: float
    chargers: frozenset[str]
    """It may go to any of them."""
    likely: Floats
    """(len(AHEAD_S),) the probability that it has come by then."""


class ChargerShortage(NamedTuple):
    """Chargers that are likely to be full, so that a robot that needs one finds none free."""

    chargers: tuple[str, ...]
    """One pool, in the order of the site file."""
    capacity: int
    from_s: float
    """When that is first likely."""
    likely: float
    """Its probability then."""
    announced: tuple[str, ...]
    """Robots that then have a charger or wait for one, by what they announced."""
    needs: tuple[ChargingNeed, ...]
    """Robots that are expected besides, the most likely first."""
    wait_s: float
    """Until one of the chargers is free."""


def charging_needs(
    robots: RobotTable, batteries: BatteryUse, geometry: PlaceGeometry, silent_after_s: float, now_s: float
) -> list[ChargingNeed]:
    """The robots that may need a charger by `AHEAD_S` and have not announced that they come, by UUID."""
    slots, drains, vendors = _candidates(robots, batteries, silent_after_s, now_s)
    level_pct = batteries.records["level_pct"][slots]
    found = []
    for vendor in sorted(set(vendors)):
        rows = np.flatnonzero([other == vendor for other in vendors])
        likely = _likely(level_pct[rows], drains[rows], batteries.share_below(vendor))
        for row, likely_by in zip(rows.tolist(), likely, strict=True):
            robot = robots[robots.slots.uuids[slots[row]]]
            chargers = _chargers(robot, batteries, geometry)
            if likely_by[-1] >= LEAST_LIKELY and chargers and not _is_settled(robot, geometry):
                found.append(ChargingNeed(robot.uuid, float(level_pct[row]), chargers, likely_by))
    return sorted(found, key=lambda need: need.robot)


def _candidates(
    robots: RobotTable, batteries: BatteryUse, silent_after_s: float, now_s: float
) -> tuple[Ints, Floats, list[str]]:
    """Slots of robots that may fall to a level at which their vendor's robots charge; their drains; their vendors."""
    heard = robots.records["known"] & (now_s - robots.records["event_s"] <= silent_after_s)
    slots = np.flatnonzero(heard & ~np.isnan(batteries.records["level_pct"][: len(heard)]))
    vendors = robots.vendors(slots)
    drains = batteries.drains(slots, vendors)
    highest_pct = {vendor: batteries.highest_pct(vendor) for vendor in set(vendors)}
    lowest_pct = batteries.records["level_pct"][slots] - drains * AHEAD_S[-1]
    near = np.flatnonzero(lowest_pct <= np.array([highest_pct[vendor] for vendor in vendors]))
    return slots[near], drains[near], [vendors[row] for row in near.tolist()]


def _likely(level_pct: Floats, drains: Floats, below: Floats) -> Floats:
    """(n, len(AHEAD_S)) the probability that robots (n,), which have not come yet, will have come.

    `below` are the shares of their vendor's robots that come at `LEVELS_PCT` or lower.
    """
    now = np.interp(level_pct, LEVELS_PCT, below)[:, None]
    then = np.interp(level_pct[:, None] - drains[:, None] * AHEAD_S, LEVELS_PCT, below)
    return (now - then) / np.maximum(now, FEWEST_BELOW)


def _chargers(robot: RobotView, batteries: BatteryUse, geometry: PlaceGeometry) -> frozenset[str]:
    here = frozenset(charger for charger in geometry.chargers if geometry.resources[charger].datum == robot.datum)
    return here & batteries.chargers_of(robot.vendor) or here


def _is_settled(robot: RobotView, geometry: PlaceGeometry) -> bool:
    """Whether a robot has a charger, goes to one, or goes nowhere."""
    goals = {robot.here, *(stop.resource for stop in robot.stops)}
    return robot.state in RESTING_STATES or not goals.isdisjoint(geometry.chargers)


def charger_shortages(
    needs: Sequence[ChargingNeed],
    queues: Mapping[str, QueueForecast],
    geometry: PlaceGeometry,
    now_s: float,
    usual_s: Mapping[str, float],
    standing: Iterable[str] = (),
) -> list[ChargerShortage]:
    """Pools of chargers that are likely to be full, although some of their robots have not announced that they come.

    `queues` are the queues of the robots that have. `usual_s` is how long robots keep each charger. Pools whose first
    charger is in `standing` were found short before.
    """
    before = set(standing)
    shortages = (_shortage(pool, needs, queues, geometry, now_s, usual_s, before) for pool in pools(needs, geometry))
    return [shortage for shortage in shortages if shortage]


def pools(needs: Iterable[ChargingNeed], geometry: PlaceGeometry) -> list[tuple[str, ...]]:
    """Chargers among which a robot may choose, joined with all sets that share a charger with them.

    Pools and their chargers are in the order of the site file.
    """
    joined: list[frozenset[str]] = []
    for need in needs:
        touching = [pool for pool in joined if not pool.isdisjoint(need.chargers)]
        joined = [pool for pool in joined if pool not in touching] + [need.chargers.union(*touching)]
    order = {charger: number for number, charger in enumerate(geometry.chargers)}
    return sorted((tuple(sorted(pool, key=order.__getitem__)) for pool in joined), key=lambda pool: order[pool[0]])


def _shortage(
    pool: tuple[str, ...],
    needs: Sequence[ChargingNeed],
    queues: Mapping[str, QueueForecast],
    geometry: PlaceGeometry,
    now_s: float,
    usual_s: Mapping[str, float],
    standing: set[str],
) -> ChargerShortage | None:
    expected = [need for need in needs if not need.chargers.isdisjoint(pool)]
    known = [queues[charger] for charger in pool if charger in queues]
    capacity = sum(geometry.capacity(charger) for charger in pool)
    present_by = [
        [robot for queue in known for robot in queue.present_at(now_s + ahead_s)] for ahead_s in AHEAD_S.tolist()
    ]
    rooms = [capacity - len(present) for present in present_by]
    counts, likely_by = np.maximum(rooms, 0), np.array([need.likely for need in expected])
    likely = np.where(np.array(rooms) >= 0, more_than(counts, likely_by), 0.0).tolist()
    bound = LIKELY if max(likely) >= LIKELY or pool[0] not in standing else HELD
    column = next((column for column, probability in enumerate(likely) if probability >= bound), None)
    if column is None:
        return None
    from_s = now_s + float(AHEAD_S[column])
    ends_s = [end_s for queue in known for end_s in queue.end_s if end_s > from_s]
    wait_s = min([*ends_s, from_s + min(usual_s[charger] for charger in pool)]) - from_s
    announced, named = tuple(sorted(present_by[column])), _named(expected, column, rooms[column])
    return ChargerShortage(pool, capacity, from_s, likely[column], announced, named, wait_s)


def _named(needs: Sequence[ChargingNeed], column: int, room: int) -> tuple[ChargingNeed, ...]:
    """The robots that have come more likely than not, the most likely first; at least as many as find no room."""
    likeliest = sorted(needs, key=lambda need: (-need.likely[column], need.robot))
    expected = sum(need.likely[column] >= 0.5 for need in needs)
    return tuple(likeliest[: max(expected, room + 1)])


def more_than(counts: Ints, likely: Floats) -> Floats:
    """(m,) the probability that more than `counts` (m,) of n independent events happen; `likely` (n, m) are theirs.

    Row k + 1 of `exactly` is the probability of k events. Row 0 stays empty, so that one step serves all rows.
    """
    exactly = np.zeros((min(int(counts.max()), len(likely)) + 2, len(counts)))
    exactly[1] = 1.0
    for happens, happens_not in zip(likely, 1 - likely, strict=True):
        exactly[1:] = exactly[1:] * happens_not + exactly[:-1] * happens
    numbers = np.arange(-1, len(exactly) - 1)[:, None]
    return np.maximum(1.0 - exactly.sum(axis=0, where=numbers <= counts), 0.0)
