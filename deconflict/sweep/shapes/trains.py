"""Tugger trains in a sweep: each trailer is swept like a robot, and what is found of it counts for its train."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from deconflict.sweep.geometry.knots import Robots, motion_faults
from deconflict.sweep.shapes.trailers import rows_of_trains, trailer_forecasts
from ingest.batch import Bools, Floats, Forecasts, Ints


class Bodies(NamedTuple):
    """Robots and, after them, their trailers."""

    keys: list[str]
    forecasts: Forecasts
    widened_m: Floats | None
    stale: list[str]
    """Keys of trailers that are no more."""


class Meetings(NamedTuple):
    """The pairs of a pass, by slots. Arrays are (p,)."""

    a: Ints
    b: Ints
    contact_s: Floats
    separation_m: Floats
    separation_at_s: Floats
    fresh: Bools


class Trains:
    """The trailers of each robot. The key of a trailer comes after that of its robot, and before any other key."""

    def __init__(self) -> None:
        self.trailers: dict[str, int] = {}
        """How many trailers each train has."""

    def concern(self, keys: Iterable[str], forecasts: Forecasts) -> bool:
        """Whether any of these robots pulls trailers, or did."""
        return bool(rows_of_trains(forecasts)) or (bool(self.trailers) and not self.trailers.keys().isdisjoint(keys))

    def bodies(self, keys: Sequence[str], forecasts: Forecasts, widened_m: Floats | None) -> Bodies:
        """New forecasts of robots, with those of their trailers. Trailers of an invalid forecast are left out."""
        trailers, pulled_by = trailer_forecasts(forecasts, motion_faults(forecasts))
        if widened_m is not None:
            by_m = widened_m[pulled_by]
            trailers = replace(trailers, length_m=trailers.length_m + by_m, width_m=trailers.width_m + by_m)
        number = np.arange(len(pulled_by)) - np.searchsorted(pulled_by, pulled_by)
        named = [_key(keys[row], at) for row, at in zip(pulled_by.tolist(), number.tolist(), strict=True)]
        rows = {keys[row]: int(count) for row, count in zip(*np.unique(pulled_by, return_counts=True), strict=True)}
        stale = [_key(key, at) for key in keys for at in range(rows.get(key, 0), self.trailers.get(key, 0))]
        for key in keys:
            self.trailers.pop(key, None)
        self.trailers |= rows
        widened = None if widened_m is None else np.concatenate([widened_m, widened_m[pulled_by]])
        return Bodies([*keys, *named], Forecasts.joined([forecasts, trailers]), widened, stale)

    def discard(self, keys: Iterable[str]) -> list[str]:
        """Remove trains. Returns the keys of all that is removed."""
        removed = self.all_bodies(keys)
        for key in removed:
            self.trailers.pop(key, None)
        return removed

    def all_bodies(self, keys: Iterable[str]) -> list[str]:
        """Robots, each followed by its trailers."""
        return [body for key in keys for body in (key, *self.trailer_keys(key))]

    def trailer_keys(self, key: str) -> list[str]:
        return [_key(key, at) for at in range(self.trailers.get(key, 0))]


def _key(key: str, at: int) -> str:
    return f"{key}\0{at:02}"


def is_trailer(key: str) -> bool:
    return "\0" in key


def pulled_by(robots: Robots) -> Ints:
    """(slots,) the slot of the robot that pulls each trailer; of any other robot its own slot."""
    return np.where(robots["train"] > 0, robots["train"] - 1, np.arange(len(robots)))


def of_trains(met: Meetings, robots: Robots, ranks: Ints) -> Meetings:
    """One row for each pair of trains or robots, ascending by ranks: its first contact and its smallest separation."""
    slot_of = pulled_by(robots[: len(ranks)])
    a, b = slot_of[met.a], slot_of[met.b]
    code = ranks[a] * len(ranks) + ranks[b]
    soonest, nearest = np.lexsort((met.contact_s, code)), np.lexsort((met.separation_at_s, met.separation_m, code))
    _, begins = np.unique(code[soonest], return_index=True)
    first, least = soonest[begins], nearest[begins]
    fresh = np.logical_or.reduceat(met.fresh[soonest], begins) if len(begins) else met.fresh
    separations = met.separation_m[least], met.separation_at_s[least]
    return Meetings(a[first], b[first], met.contact_s[first], *separations, fresh)


def pairs_of_bodies(a: Ints, b: Ints, robots: Robots) -> tuple[Ints, Ints, Ints]:
    """All pairs of bodies of those of the pairs of slots in which there is a train: both slots, and the pair's row."""
    rows = np.flatnonzero((robots["train"][a] > 0) | (robots["train"][b] > 0))
    if not len(rows):
        return rows, rows, rows
    in_trains = np.flatnonzero(robots["train"])
    members = in_trains[np.argsort(robots["train"][in_trains], kind="stable")]
    pulling = robots["train"][members] - 1
    alone = np.setdiff1d(np.concatenate([a[rows], b[rows]]), pulling)
    members, pulling = np.concatenate([members, alone]), np.concatenate([pulling, alone])
    each_a, each_b, row_of = _pairs_of_members(a[rows], b[rows], members, pulling)
    return each_a, each_b, rows[row_of]


def with_trailers(robots: Robots, count: int, rows: Ints, hold_s: Floats) -> tuple[Ints, Floats, dict[int, list[int]]]:
    """Rows of robots with their holds, followed by those of their trailers; and by place in `rows`, the places of the
    trailers. The trailers of the first `count` of `robots` are after these."""
    trailers: dict[int, list[int]] = {}
    if not robots["train"].any():
        return rows, hold_s, trailers
    pulled: dict[int, list[int]] = {}
    for row in (count + np.flatnonzero(robots["train"][count:])).tolist():
        pulled.setdefault(int(robots["train"][row]), []).append(row)
    more: list[int] = []
    holds_s: list[float] = []
    for place, row in enumerate(rows.tolist()):
        own = pulled.get(int(robots["train"][row]), ()) if row < count else ()
        for trailer in own:
            trailers.setdefault(place, []).append(len(rows) + len(more))
            more.append(trailer)
            holds_s.append(float(hold_s[place]))
    return np.concatenate([rows, np.array(more, np.int64)]), np.concatenate([hold_s, holds_s]), trailers


def pairs_with_trailers(a: Ints, b: Ints, trailers: Mapping[int, Sequence[int]]) -> tuple[Ints, Ints, Ints]:
    """All pairs of bodies of pairs of robots, given by rows: both rows, and the row of each one's pair."""
    robots = np.unique(np.concatenate([a, b])).tolist()
    members = [(body, robot) for robot in robots for body in (robot, *trailers.get(robot, ()))]
    return _pairs_of_members(a, b, *np.array(members, np.int64).reshape(-1, 2).T)


def _pairs_of_members(a: Ints, b: Ints, members: Ints, robot_of: Ints) -> tuple[Ints, Ints, Ints]:
    """All pairs of bodies of the robots `a` and `b` (p,), of which the bodies are `members` (n,) by `robot_of` (n,)."""
    order = np.argsort(robot_of, kind="stable")
    members, robot_of = members[order], robot_of[order]
    (first_a, first_b), (after_a, after_b) = (np.searchsorted(robot_of, (a, b), side) for side in ("left", "right"))
    of_a, of_b = after_a - first_a, after_b - first_b
    row_of = np.repeat(np.arange(len(a)), of_a * of_b)
    number = np.arange(len(row_of)) - np.repeat(np.cumsum(of_a * of_b) - of_a * of_b, of_a * of_b)
    return members[first_a[row_of] + number // of_b[row_of]], members[first_b[row_of] + number % of_b[row_of]], row_of
