"""Who will need a charger within a quarter of an hour before it says so, and whether there will be room.

How likely a robot comes to a charger by when follows from the level of its battery, from how fast that falls, and from
the levels at which robots of its vendor came. It goes to any of the chargers of its floor at which its vendor's robots
were charged; where none was yet, to any of its floor. Chargers among which some robot may choose are one pool.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from deconflict.contention.queues.queue_forecast import Turns
from deconflict.contention.robots.battery_use import LEVELS_PCT, Batteries
from deconflict.contention.robots.place_geometry import Geometry
from deconflict.contention.robots.robot_table import Robots
from deconflict.contention.robots.robot_view import Seen
from ingest.batch import Floats, Ints

AHEAD_S: Floats = np.arange(60.0, 901.0, 60.0)
"""Up to a quarter of an hour: so far ahead robots may name destinations (standard 5.2.3)."""
LIKELY, HELD = 0.8, 0.6
"""Chargers that will be full as likely as this are told of, and then for as long as it is as likely as the second."""
LEAST_LIKELY = 0.05
"""Robots that need a charger within the time less likely than this are left out."""
FEWEST_BELOW = 0.05
"""Of a vendor's robots this share at least is taken to come at lower levels still: one that is below nearly all of them
goes by rules of its own, and is not expected at any moment."""
SILENT_S = 60.0
"""A robot that has not been heard of for so long tells nothing of its battery any more."""
AT_REST = frozenset(("charging", "disabled", "offline"))
"""States of robots that do not set out to be charged."""


class Need(NamedTuple):
    """A robot that may need a charger."""

    robot: str
    level_pct: float
    chargers: frozenset[str]
    """To any of which it may go."""
    likely: Floats
    """(len(AHEAD_S),) how likely it is to have come by then."""


class Shortage(NamedTuple):
    """Chargers that are likely to be full, so that one that needs one finds none."""

    chargers: tuple[str, ...]
    """Of one pool, in the order of the site file."""
    capacity: int
    from_s: float
    """When that is first likely."""
    likely: float
    """How likely it is then."""
    there: tuple[str, ...]
    """Robots that then have one or wait for it, by what they say."""
    needs: tuple[Need, ...]
    """Those that are expected besides, the likeliest first."""
    wait_s: float
    """Until one of the chargers comes free."""


def needs(robots: Robots, batteries: Batteries, geometry: Geometry, now_s: float) -> list[Need]:
    """The robots that may need a charger by `AHEAD_S` and have not said that they come, by UUID."""
    slots, drains, vendors = _candidates(robots, batteries, now_s)
    level_pct = batteries.records["level_pct"][slots]
    found = []
    for vendor in sorted(set(vendors)):
        rows = np.flatnonzero([one == vendor for one in vendors])
        below = batteries.share_below(vendor)
        likely = _likely(level_pct[rows], drains[rows], below)
        for row, likely_by in zip(rows.tolist(), likely, strict=True):
            one = robots[robots.uuids[slots[row]]]
            chargers = _chargers(one, batteries, geometry)
            if likely_by[-1] >= LEAST_LIKELY and chargers and not _is_settled(one, geometry):
                found.append(Need(one.uuid, float(level_pct[row]), chargers, likely_by))
    return sorted(found, key=lambda need: need.robot)


def _candidates(robots: Robots, batteries: Batteries, now_s: float) -> tuple[Ints, Floats, list[str]]:
    """Slots of robots that may fall to a level at which their vendor's are charged; how fast theirs falls; vendors."""
    heard = robots.records["known"] & (now_s - robots.records["event_s"] <= SILENT_S)
    slots = np.flatnonzero(heard & ~np.isnan(batteries.records["level_pct"][: len(heard)]))
    vendors = robots.vendors(slots)
    drains, highest_pct = batteries.drains(slots, vendors), {one: batteries.highest_pct(one) for one in set(vendors)}
    lowest_pct = batteries.records["level_pct"][slots] - drains * AHEAD_S[-1]
    near = np.flatnonzero(lowest_pct <= np.array([highest_pct[vendor] for vendor in vendors]))
    return slots[near], drains[near], [vendors[row] for row in near.tolist()]


def _likely(level_pct: Floats, drains: Floats, below: Floats) -> Floats:
    """(n, len(AHEAD_S)) how likely robots (n,) that have not come yet will have come.

    `below` are the shares of their vendor's that come at `LEVELS_PCT` or lower.
    """
    now = np.interp(level_pct, LEVELS_PCT, below)[:, None]
    then = np.interp(level_pct[:, None] - drains[:, None] * AHEAD_S, LEVELS_PCT, below)
    likely: Floats = (now - then) / np.maximum(now, FEWEST_BELOW)
    return likely


def _chargers(one: Seen, batteries: Batteries, geometry: Geometry) -> frozenset[str]:
    here = frozenset(charger for charger in geometry.chargers if geometry.resources[charger].datum == one.datum)
    return here & batteries.chargers_of(one.vendor) or here


def _is_settled(one: Seen, geometry: Geometry) -> bool:
    """Whether a robot has a charger, goes to one, or does not go anywhere."""
    goals = {one.here, *(stop.resource for stop in one.stops)}
    return one.state in AT_REST or not goals.isdisjoint(geometry.chargers)


def shortages(
    found: Sequence[Need],
    turns: Mapping[str, Turns],
    geometry: Geometry,
    now_s: float,
    usual_s: Mapping[str, float],
    standing: Iterable[str] = (),
) -> list[Shortage]:
    """Pools that are likely to be full of robots of which not all have said that they come.

    `turns` are those of robots that have, `usual_s` how long robots keep each charger. Pools of which the first charger
    is in `standing` were told of before.
    """
    told = set(standing)
    every = (_shortage(pool, found, turns, geometry, now_s, usual_s, told) for pool in pools(found, geometry))
    return [one for one in every if one]


def pools(found: Iterable[Need], geometry: Geometry) -> list[tuple[str, ...]]:
    """Chargers among which some robot may choose, and all that others may choose besides one of them.

    Pools and their chargers are in the order of the site file.
    """
    joined: list[frozenset[str]] = []
    for need in found:
        touching = [pool for pool in joined if not pool.isdisjoint(need.chargers)]
        joined = [pool for pool in joined if pool not in touching] + [need.chargers.union(*touching)]
    order = {charger: number for number, charger in enumerate(geometry.chargers)}
    return sorted((tuple(sorted(pool, key=order.__getitem__)) for pool in joined), key=lambda pool: order[pool[0]])


def _shortage(
    pool: tuple[str, ...],
    found: Sequence[Need],
    turns: Mapping[str, Turns],
    geometry: Geometry,
    now_s: float,
    usual_s: Mapping[str, float],
    standing: set[str],
) -> Shortage | None:
    some = [need for need in found if not need.chargers.isdisjoint(pool)]
    told = [turns[charger] for charger in pool if charger in turns]
    capacity = sum(geometry.capacity(charger) for charger in pool)
    there_by = [[robot for one in told for robot in one.there(now_s + ahead_s)] for ahead_s in AHEAD_S.tolist()]
    rooms = [capacity - len(there) for there in there_by]
    likely = [
        more_than(room, np.array([need.likely[column] for need in some])) if room >= 0 else 0.0
        for column, room in enumerate(rooms)
    ]
    bound = LIKELY if max(likely) >= LIKELY or pool[0] not in standing else HELD
    column = next((column for column, one in enumerate(likely) if one >= bound), None)
    if column is None:
        return None
    from_s = now_s + float(AHEAD_S[column])
    ends_s = [end_s for one in told for end_s in one.end_s if end_s > from_s]
    wait_s = min([*ends_s, from_s + min(usual_s[charger] for charger in pool)]) - from_s
    there, named = tuple(sorted(there_by[column])), _named(some, column, rooms[column])
    return Shortage(pool, capacity, from_s, likely[column], there, named, wait_s)


def _named(some: Sequence[Need], column: int, room: int) -> tuple[Need, ...]:
    """Those that will more likely than not have come, the likeliest first; no fewer than do not find room."""
    likeliest = sorted(some, key=lambda need: (-need.likely[column], need.robot))
    expected = sum(need.likely[column] >= 0.5 for need in some)
    return tuple(likeliest[: max(expected, room + 1)])


def more_than(count: int, likely: Floats) -> float:
    """How likely more than so many of some independent things happen, each of which is `likely` (n,)."""
    exactly = np.zeros(len(likely) + 1)
    exactly[0] = 1.0
    for one in likely.tolist():
        exactly[1:] = exactly[1:] * (1 - one) + exactly[:-1] * one
        exactly[0] *= 1 - one
    return float(exactly[count + 1 :].sum())
