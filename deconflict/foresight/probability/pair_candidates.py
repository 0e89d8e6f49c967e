"""Which pairs are worth a look: those that the exact sweep found, and those that may come near."""

from collections.abc import Iterable, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from deconflict.foresight.forecast_errors.pending_forecasts import PendingForecasts
from deconflict.foresight.probability.error_band_kernels import reach_m
from deconflict.foresight.probability.pair_table import Pairs, codes, slots_of
from deconflict.foresight.probability.tracked_robots import TrackedRobots
from deconflict.foresight.probability.waiting_robots import are_waiting
from deconflict.sweep.geometry.heights import heights_overlap
from deconflict.sweep.pair_choice import ALWAYS, PAIRS, Claims, PairNeeds, Sharers, chosen_pairs
from ingest.batch import Bools, Floats, Ints, Pair

MOST_GROWN_M = 0.75
"""To find candidates, an envelope grows by its 80 % band at the horizon, but at most by this."""


class SweptConflicts(NamedTuple):
    """What the exact sweep found: c pairs whose forecasts come within the clearance. Arrays are (c,)."""

    pairs: Sequence[Pair]
    separation_m: Floats
    """Smallest separation of the envelopes over the horizon."""
    separation_at_s: Floats
    """When it is reached."""
    contact_s: Floats
    """First time within the clearance."""


class PairCandidates:
    """Finds the codes of the candidates of each look."""

    def __init__(self, robots: TrackedRobots, clearance_m: float, horizon_s: float, claims: Claims | None) -> None:
        self._robots, self._clearance_m, self._horizon_s, self._claims = robots, clearance_m, horizon_s, claims

    def codes_of(self, pairs: Iterable[Pair]) -> Ints:
        """(p,) the codes of those of `pairs` of which both robots are known."""
        slots = self._robots.find([*chain.from_iterable(pairs)]).reshape(-1, 2)
        return codes(*slots[(slots >= 0).all(axis=1)].T)

    def worth_learning_from(self, pairs: Pairs) -> Pairs:
        """Those of `pairs` (p,) of which no robot is partly examined: such robots report what can't be true, or are
        beside those that do. While there are such robots, also none of newcomers."""
        doubted = self._robots.slots_of(self._claims.partly_examined()) if self._claims else ()
        if not self._claims or not len(doubted):
            return pairs
        *_, is_left_out = self._claims.sources()
        is_left_out[doubted] = True
        a, b = slots_of(pairs["code"])
        return pairs[~(is_left_out[a] | is_left_out[b])]

    def nearby_codes(
        self, has_news: Bools, pending: PendingForecasts, bands_m: Floats, now_s: float, table: Pairs
    ) -> Ints:
        """(p,) the codes of the pairs that may come near at any whole second of the horizon. At least one robot of each
        pair is marked by `has_news` (slots,), and none is in a crowd. If there are more than a floor can hold, those
        that `pair_choice` chooses; `table` has the pairs of the last look.

        Envelopes are taken as circles, which hold the trailers, grown by the 80 % bands `bands_m` (kinds, horizons, 3)
        at the horizon.
        """
        if not has_news.any():
            return np.empty(0, np.int64)
        robots, slots = self._robots, np.flatnonzero(self._robots.is_used)
        columns = (slots, robots.records, robots.half_m)
        near_m = reach_m(bands_m, *columns, self._clearance_m / 2, self._horizon_s, MOST_GROWN_M)
        trains, reaches_m = robots.trailers.reaches_m()
        near_m[trains] += np.maximum(reaches_m - np.hypot(*robots.half_m[:, trains]), 0.0)
        marks = has_news, robots.is_crowded(), are_waiting(robots.records)
        found = pending.candidate_pairs(*marks, slots, robots.slots.ranks(), near_m, now_s, self._horizon_s)
        a, b = found[:, 0], found[:, 1]
        found = found[heights_overlap(*robots.levels_m[:, a], *robots.levels_m[:, b])]
        held = _held(table, has_news)
        most = PAIRS.of_pass(int(has_news.sum()), len(slots), int(held.sum()) // 2)
        if self._claims and len(found) > most:
            found = self._chosen(found, pending, ~has_news & (held >= ALWAYS), most, self._claims)
        return codes(found[:, 0], found[:, 1])

    def _chosen(self, found: Ints, pending: PendingForecasts, is_served: Bools, most: int, claims: Claims) -> Ints:
        """`most` of the pairs `found` (p, 3), or few more; see `PendingForecasts.candidate_pairs`."""
        robots = self._robots
        a, b, moment = (np.ascontiguousarray(column) for column in found.T)
        watched = self.codes_of(claims.watched())
        between_m = pending.newest[a, 1:3] - pending.newest[b, 1:3]
        needs = PairNeeds(a, b, moment, np.hypot(*between_m.T), np.isin(codes(a, b), watched), np.ones_like(a))
        return found[chosen_pairs(needs, Sharers(*claims.sources(), robots.is_crowded(), is_served), most)]


def _held(table: Pairs, has_news: Bools) -> Ints:
    """(slots,) how many pairs of each robot are watched of which neither robot has news."""
    a, b = slots_of(table["code"])
    is_held = table["watched"] & ~has_news[a] & ~has_news[b]
    return np.bincount(np.concatenate([a[is_held], b[is_held]]), minlength=len(has_news))
