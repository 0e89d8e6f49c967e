"""Which pairs of robots are examined, if there are more than a floor can hold.

Around a body there is room for few others. So robots that are where they report to be have few pairs: about 2 each at
one robot on 25 m2, and no more than the budget at one and a half times that density. More pairs come of reports that
can't be true, or of robots that drive through each other. Then the most urgent are examined, shared fairly among the
sources:

1. Of each robot, the most urgent pairs are examined in any case: a few that are watched, and the first of others, if
   it has not as many already. They count among what their sources get.
2. Newcomers, and in the sweep bodies that are faster than any robot, come last: they get what the others leave.
3. The robots that are known longest get all that they need, up to half of the budget. So whoever comes later, of
   whatever source, takes nothing from them.
4. The rest is for the sources. One that needs little gets all that it needs. What is left is shared equally by the
   others (max-min fairness). The source of the robot that came later pays for a pair.
5. Within a source, pairs that are watched come first. Then each robot is compared with the most urgent one of each
   source, then with the second one. Robots that came later than it follow those that did not.
"""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.broadphase import EVERY, MIXED, MOST_FOUND, Pairs
from deconflict.sweep.shapes.trains import pulled_by
from deconflict.sweep.slot_table import SlotTable
from ingest.batch import Bools, Floats, Ints, Pair

MOST_OF_SOURCE = 24
"""A robot is compared with so many others of one source."""
LATER_S = 5.0
"""Robots that are known for this much longer than others were there before."""
ALWAYS, ALWAYS_WATCHED = 2, 3
"""The most urgent pairs of each robot are examined whatever the budget, unless so many are held already; and so many of
those that are watched. Robots that jump have dozens of these."""
NO_CROWDS: Mapping[str, int] = {}
MOST_OF_CROWD = 3
"""Pairs of one robot with those of one crowd."""
FASTEST_M, FAST_COST = 10.0, 6
"""A body that goes farther in a second is no robot's. It comes last, as newcomers do, and each pair with it takes at
least so much of the budget of boxes: it meets ever others, each in one box."""
_GAP_M, _GAPS, _MOMENTS, _SOURCES, _MOST_TURNS = 0.05, 1 << 18, 1 << 6, 1 << 12, 1 << 12


def nearest_of_each(group: Ints, away_m: Floats, most: int) -> Ints:
    """(k,) the rows of the `most` nearest of each group, of n that belong to `group` (n,) and are `away_m` (n,)."""
    order = np.lexsort((away_m, group))
    ordered = group[order]
    kept: Ints = order[np.arange(len(order)) - np.searchsorted(ordered, ordered) < most]
    return kept


class Claims(Protocol):
    """Which claims robots and pairs have to be examined."""

    def sources(self) -> tuple[Ints, Floats, Bools]:
        """(slots,) a number of each robot's source, from 0 on; since when the robot is known; and whether it came
        lately, when others were there already. There may be more slots, and any numbers where no robot is."""

    def watched(self) -> Iterable[Pair]:
        """The pairs of robots that are watched."""

    def partly_examined(self) -> list[str]:
        """The robots of which pairs were left out lately, or that are in a crowd."""


class Budget(NamedTuple):
    """How much may be examined: about three times what robots need at one on 25 m2, and a little more, so that a few
    robots may be as near to each other as they like."""

    changed: int
    """For each robot that changed,"""
    spare: int
    """and so much more in a pass."""
    held: float
    """In all passes, for each robot of the floor,"""
    held_least: int
    """and on a floor of few robots so much in all."""
    least: int
    """For each robot that changed, however much is held: a source that holds all takes nothing from others."""

    def of_pass(self, changed: int, robots: int, held: int) -> int:
        """What may be examined in a pass in which so many of `robots` robots changed, while so much of other robots is
        held."""
        room = max(int(self.held * robots), self.held_least) - held
        return max(self.least * changed, min(self.changed * changed + self.spare, room))


BOXES, PAIRS = Budget(16, 900, 10, 3000, 9), Budget(10, 100, 5.5, 600, 4)
"""Of pairs of boxes of one second in the sweep, where what is held are contacts; and of pairs of robots."""


class Sharers(NamedTuple):
    """Of each robot by slot: who shares the budget."""

    source: Ints
    """(slots,) a number of its source, from 0 on."""
    came_s: Floats
    """(slots,) since when it is known."""
    is_new: Bools
    """(slots,) whether it came lately, when others were there already, or is faster than any robot."""
    is_crowded: Bools
    """(slots,) whether it is in a crowd: what it needs itself does not count."""
    is_served: Bools
    """(slots,) whether it has not changed, and `ALWAYS` pairs of it with others that have not are held."""


class PairNeeds(NamedTuple):
    """p pairs of slots that may come near each other, each pair once. Arrays are (p,)."""

    a: Ints
    b: Ints
    moment: Ints
    """When they may first come near: a number of a second, from 0 on."""
    gap_m: Floats
    """How far they are apart then, about."""
    is_watched: Bools
    costs: Ints
    """What each takes of the budget."""

    def of(self, rows: Ints) -> "PairNeeds":
        """The needs of the pairs in `rows`."""
        a, b, moment, gap_m, is_watched, costs = self
        return PairNeeds(a[rows], b[rows], moment[rows], gap_m[rows], is_watched[rows], costs[rows])


def chosen_pairs(needs: PairNeeds, sharers: Sharers, most: int) -> Bools:
    """(p,) which pairs to examine. They cost `most`, or not much more; see the rules of this module.

    The first `ALWAYS` of each robot, and `ALWAYS_WATCHED` that are watched, are chosen whatever their number.
    """
    _, source = np.unique(sharers.source, return_inverse=True)
    sharers = sharers._replace(source=source)
    ranks, places = _ranks(needs, sharers)
    chosen, payer = places < np.where(needs.is_watched, ALWAYS_WATCHED, ALWAYS), _payers(needs, sharers)
    is_new, can_be = sharers.is_new[needs.a] | sharers.is_new[needs.b], chosen | (ranks < MOST_OF_SOURCE)
    for is_of_class in (~is_new, is_new):
        rows = np.flatnonzero(is_of_class & can_be)
        rows = rows[np.lexsort((ranks[rows], ~needs.is_watched[rows], ~chosen[rows]))]
        is_within = _of_known_longest(needs.of(rows), sharers, most // 2)
        chosen[rows[is_within]] = True
        most -= int(needs.costs[rows[is_within]].sum())
        rows = rows[~is_within]
        chosen[rows] = _within_shares(needs.costs[rows], payer[rows], chosen[rows], most)
        most -= int(needs.costs[rows[chosen[rows]]].sum())
    return chosen


def _of_known_longest(needs: PairNeeds, sharers: Sharers, most: int) -> Bools:
    """(p,) which pairs are of the robots that are known longest, as many of these as need no more than `most` in all.
    The later robot of a pair counts, and robots that came within `LATER_S` count together."""
    came = np.maximum(sharers.came_s[needs.a], sharers.came_s[needs.b]) // LATER_S
    _, turn = np.unique(came, return_inverse=True)
    return (np.cumsum(np.bincount(turn, needs.costs)) <= most)[turn] if len(turn) else np.zeros(0, np.bool_)


def _within_shares(costs: Ints, payer: Ints, always: Bools, most: int) -> Bools:
    """(p,) which pairs are within the shares of their sources `payer` (p,), of `most` in all, in their order: those of
    each source that are examined in any case, `always` (p,), come first, and more if its share has room."""
    order, needed = np.argsort(payer, kind="stable"), np.bincount(payer, costs).astype(np.int64)
    in_any_case = np.bincount(payer, costs * always, len(needed)).astype(np.int64)
    ordered, payers = costs[order], payer[order]
    before = np.cumsum(ordered) - ordered - (np.cumsum(needed) - needed)[payers]
    is_within = np.empty(len(order), np.bool_)
    is_within[order] = before < _shares(needed, in_any_case, most)[payers]
    return is_within | always


def _ranks(needs: PairNeeds, sharers: Sharers) -> tuple[Ints, Ints]:
    """Two places (p,) of each pair, the most urgent first: among the pairs of a robot with one source, and among all
    pairs of a robot, which takes one pair of each source after the other, and what is watched first. The smaller place
    of the two robots counts. A robot in a crowd gives none; one that is served gives none to pairs that are new."""
    gap = np.minimum(needs.gap_m / _GAP_M, _GAPS - 1).astype(np.int64)
    urgency = np.minimum(needs.moment, _MOMENTS - 1) * _GAPS + gap
    urgency[~needs.is_watched] += 2 * _MOMENTS * _GAPS
    own, other = np.concatenate([needs.a, needs.b]), np.concatenate([needs.b, needs.a])
    rows = np.flatnonzero(~sharers.is_crowded[own])
    own, other, is_watched = own[rows], other[rows], np.tile(needs.is_watched, 2)[rows]
    came_later = sharers.came_s[other] > sharers.came_s[own] + LATER_S
    comes_later = came_later | (sharers.is_new[other] & ~sharers.is_new[own])
    keys = np.tile(urgency, 2)[rows] + comes_later * _MOMENTS * _GAPS
    of_source = _places(own * _SOURCES + sharers.source[other] % _SOURCES, keys)
    in_turn = _places(own, np.minimum(of_source, _MOST_TURNS) * (4 * _MOMENTS * _GAPS) + keys, ~is_watched)
    in_turn[sharers.is_served[own] & ~is_watched] = len(needs.a)
    both = np.full((2, 2 * len(needs.a)), len(needs.a))
    both[0, rows], both[1, rows] = of_source, in_turn
    ranks, places = both.reshape(2, 2, -1).min(axis=1)
    return ranks, places


def _places(groups: Ints, *keys: NDArray[Any]) -> Ints:
    """(n,) the place of each row among those of its group, in the order of `keys`, each (n,), the last key first."""
    order = np.lexsort((*keys, groups))
    ordered = groups[order]
    begins = np.flatnonzero(np.append(True, ordered[1:] != ordered[:-1])) if len(order) else order
    places = np.empty(len(order), np.int64)
    places[order] = np.arange(len(order)) - np.repeat(begins, np.diff(np.append(begins, len(order))))
    return places


def _payers(needs: PairNeeds, sharers: Sharers) -> Ints:
    """(p,) the source of each pair that pays for it: that of the robot which came later; if they came together, the one
    that needs more in all."""
    a, b = sharers.source[needs.a], sharers.source[needs.b]
    needed = np.bincount(np.concatenate([a, b]), np.tile(needs.costs, 2))
    later_s = sharers.came_s[needs.a] - sharers.came_s[needs.b]
    return np.where(np.where(np.abs(later_s) > LATER_S, later_s > 0.0, needed[a] > needed[b]), a, b)


def _shares(needed: Ints, in_any_case: Ints, most: int) -> Ints:
    """(sources,) how much each source may have, of `most` in all, if it needs `needed` (sources,) and gets
    `in_any_case` (sources,): all, or as much as any other (Bertsekas and Gallager 1992, "max-min flow control")."""
    level, above = 0, int(needed.max(initial=0)) + 1
    while above - level > 1:
        middle = (level + above) // 2
        is_room = np.clip(middle, in_any_case, needed).sum() <= most
        level, above = (middle, above) if is_room else (level, middle)
    return np.clip(level, in_any_case, needed)


class PairChoice:
    """The choice among pairs of boxes."""

    def __init__(self, claims: Claims | None, grow_m: float) -> None:
        """Without `claims` all pairs are examined. Boxes are `grow_m` larger than bodies on each side."""
        self._claims, self._grow_m = claims, grow_m
        self.most_found = MOST_FOUND if claims else EVERY
        """See `SweptBoxes.overlapping_pairs`."""
        self.left_out = 0
        """Pairs that were left out in this pass."""

    def examined(
        self,
        pairs: Pairs,
        covered: Ints,
        held: NDArray[Any],
        table: SlotTable,
        boxes: NDArray[Any],
        marks: tuple[Bools, Bools],
    ) -> Pairs:
        """Those of `pairs`, which are sorted by their bodies and then by time, that are examined: what `BOXES` gives
        the slots `covered`, while the contact intervals `held` of others are kept, or few more.

        `boxes` (rings, slots) are those of the bodies; `marks` (slots,) are whether a body is of a robot in a crowd,
        and whether a pair of it was left out, which is set.
        """
        most = BOXES.of_pass(len(covered), int(np.count_nonzero(table.robots["count"])), len(held))
        if self._claims is None or FAST_COST * len(pairs) <= most:
            return pairs
        begins = np.flatnonzero(
            np.append(True, (pairs["a"][1:] != pairs["a"][:-1]) | (pairs["b"][1:] != pairs["b"][:-1]))
        )
        first, found, (is_crowded, is_cut) = pairs[begins], np.diff(np.append(begins, len(pairs))), marks
        are_fast = self._are_fast(first, table, boxes)
        costs = np.where(are_fast.any(axis=0), np.maximum(found, FAST_COST), found)
        if costs.sum() <= most:
            return pairs
        pullers = pulled_by(table.robots[: len(table.slots)])
        (source, came_s, is_new), are_served = self._claims.sources(), _are_served(held, covered, len(is_crowded))
        sharers = Sharers(source[pullers], came_s[pullers], is_new[pullers], is_crowded, are_served)
        for slots, rows in zip((first["a"], first["b"]), are_fast, strict=True):
            sharers.is_new[slots[rows]] = True
        needs = _needs(first, costs, boxes, _are_watched(first, table, pullers, self._claims))
        is_chosen = chosen_pairs(needs, sharers, most)
        left_out = first[~is_chosen]
        is_cut[left_out["a"]] = is_cut[left_out["b"]] = True
        self.left_out += len(left_out)
        return pairs[np.repeat(is_chosen, found)]

    def _are_fast(self, first: Pairs, table: SlotTable, boxes: NDArray[Any]) -> Bools:
        """(2, p) whether the body `a` and the body `b` of each pair is faster than any robot when they first meet."""
        radius_m = table.robots["radius"] + self._grow_m
        both = (first["a"], first["b"])
        return np.array([_went_m(boxes[first["ring"], slots], radius_m[slots]) > FASTEST_M for slots in both])


def _went_m(boxes: NDArray[Any], radius_m: Floats) -> Floats:
    """(n,) how far bodies within circles go at least while they are in `boxes` (n,) of one floor each; 0 of several."""
    sides_m = np.hypot(boxes["east"] - boxes["west"], boxes["north"] - boxes["south"])
    went_m: Floats = np.where(boxes["floor"] == MIXED, 0.0, sides_m - 2 * np.sqrt(2.0) * radius_m)
    return went_m


def _are_served(held: NDArray[Any], covered: Ints, slots: int) -> Bools:
    """(slots,) whether `ALWAYS` pairs of a body are among the contact intervals `held`, and it is not one of those
    `covered`."""
    pairs = held[["a", "b"]]
    begins = np.append(True, pairs[1:] != pairs[:-1])[: len(pairs)]
    bodies = np.concatenate([held["a"][begins], held["b"][begins]])
    are_served: Bools = np.bincount(bodies, minlength=slots) >= ALWAYS
    are_served[covered] = False
    return are_served


def _needs(pairs: Pairs, costs: Ints, boxes: NDArray[Any], are_watched: Bools) -> PairNeeds:
    """The needs of `pairs`, one row for each two bodies, at the first time at which their `boxes` overlap."""
    a, b = pairs["a"].astype(np.int64), pairs["b"].astype(np.int64)
    box, other = boxes[pairs["ring"], a], boxes[pairs["ring"], b]
    sides = (("west", "east"), ("south", "north"))
    between_m = [(box[low] + box[high] - other[low] - other[high]) / 2 for low, high in sides]
    moment = box["slab"] - box["slab"].min(initial=1 << 62)
    return PairNeeds(a, b, moment, np.hypot(*between_m), are_watched, costs)


def _are_watched(pairs: Pairs, table: SlotTable, pullers: Ints, claims: Claims) -> Bools:
    """(p,) whether the robots of each two bodies are watched; `pullers` (slots,) as of `pulled_by`."""
    find, slots = table.slots.by_uuid.get, len(table.slots)
    watched = [find(uuid, -1) * slots + find(other, -1) for uuid, other in claims.watched()]
    a, b = pullers[pairs["a"]], pullers[pairs["b"]]
    return np.isin(a * slots + b, watched) | np.isin(b * slots + a, watched)


class CrowdedPairs:
    """Chooses among the pairs of a robot that is in a crowd, where too many report from one place, and one that is not:
    a robot is warned of a crowd ahead and not of each robot in it.

    Those of the last choice stay as long as they can, so that warnings last.
    """

    def __init__(self) -> None:
        self._codes: Ints = np.zeros(0, np.int64)
        """Of the pairs that were kept last."""

    def kept_rows(self, a: Ints, b: Ints, contact_s: Floats, crowds: Ints) -> Ints:
        """The rows to keep of pairs of slots `a` and `b` (p,), which come near at `contact_s` (p,): all without a robot
        in `crowds` (slots,), and of the others those of the last choice and the soonest. `crowds` is 0 for a robot in
        none."""
        of_crowd = crowds[a] + crowds[b]
        mixed = np.flatnonzero(of_crowd)
        code = a[mixed] * len(crowds) + b[mixed]
        robot = np.where(crowds[a[mixed]] > 0, b[mixed], a[mixed])
        groups = robot * (of_crowd.max(initial=0) + 1) + of_crowd[mixed]
        is_chosen = _places(groups, contact_s[mixed], ~np.isin(code, self._codes)) < MOST_OF_CROWD
        self._codes = code[is_chosen]
        is_kept = of_crowd == 0
        is_kept[mixed[is_chosen]] = True
        return np.flatnonzero(is_kept)
