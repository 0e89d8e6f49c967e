"""The sweep of a whole floor at once: which envelopes come within the clearance in the horizon, when, and how near.

Usable as a library: arrays in, arrays out. `deconflict.sweep.incremental.Sweeper` keeps what has not changed between
passes, and gives the same result. Method and limits: docs/sweep.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from deconflict.sweep.broadphase import boxes_of_pairs
from deconflict.sweep.fcl_check import FclCheck
from deconflict.sweep.geometry.knots import Knots, Robots
from deconflict.sweep.incremental import ROUNDS, TOLERANCE_M, Sweeper
from deconflict.sweep.narrowphase import first_contacts_of, motions_of
from deconflict.sweep.shapes.shape_contacts import shape_distances
from deconflict.sweep.shapes.shape_decisions import ShapeDecisions, is_shaped
from deconflict.sweep.shapes.shape_table import SHAPES
from deconflict.sweep.shapes.trains import pairs_with_trailers
from ingest.batch import Floats, Forecasts, Ints

NO_TRAILERS: Mapping[int, Sequence[int]] = {}


@dataclass(frozen=True, slots=True)
class Invalid:
    """A robot that was left out."""

    robot: int
    """Row of the forecasts."""
    reason: str
    """A reason of `deconflict.sweep.geometry.knots.faults`, such as `not-finite` or `times-not-increasing`."""


@dataclass(frozen=True, slots=True, eq=False)
class Conflicts:
    """c pairs of robots that come within the clearance, ascending by rows."""

    pairs: Ints
    """(c, 2) rows, the lower first."""
    contact_s: Floats
    """(c,) first time within the clearance, to a millimetre and never late; `now_s` if the two are within it then."""
    separation_m: Floats
    """(c,) smallest distance of the envelopes over the horizon, to a millimetre; 0 if they overlap."""
    separation_at_s: Floats
    """(c,) a time at which that is reached."""
    start_separation_m: Floats
    """(c,) distance at `now_s`, or when the later of the two appears."""
    invalid: tuple[Invalid, ...]
    """The robots that were left out."""


def sweep(forecasts: Forecasts, *, now_s: float, horizon_s: float = 10.0, clearance_m: float) -> Conflicts:
    """All conflicts of a floor in [`now_s`, `now_s + horizon_s`].

    Takes the forecasts of n robots (see `ingest.batch.Forecasts`), times in seconds since one epoch. Robots that can't
    be swept are left out and named in `invalid`; nothing is raised for them. Raises `ValueError` for a negative
    clearance or a horizon that is not above 0.
    """
    sweeper = Sweeper(clearance_m=clearance_m, horizon_s=horizon_s)
    order = _order(forecasts)
    keys = [f"{rank:012d}" for rank in np.argsort(order)]
    invalid = sorted((int(order[int(key)]), reason) for key, reason in sweeper.update(keys, forecasts))
    found = sweeper.find_conflicts(now_s)
    ranks = np.array([(int(a), int(b)) for a, b in found.pairs], np.int64).reshape(-1, 2)
    rows = np.sort(order[ranks], axis=1)
    by_row = np.lexsort((rows[:, 1], rows[:, 0]))
    return Conflicts(
        rows[by_row],
        found.contact_s[by_row],
        found.separation_m[by_row],
        found.separation_at_s[by_row],
        found.start_separation_m[by_row],
        tuple(Invalid(row, reason) for row, reason in invalid),
    )


def first_contacts(
    robots: Robots,
    knots: Knots,
    a: Ints,
    b: Ints,
    *,
    now_s: float,
    until_s: Floats,
    clearance_m: float,
    trailers: Mapping[int, Sequence[int]] = NO_TRAILERS,
) -> tuple[Floats, Floats]:
    """The first contacts of the pairs of rows `a` (p,) and `b` (p,) of `robots`, and of no other pairs. `trailers` are
    rows by the row of the robot that pulls them.

    Returns (p,) when each pair first comes within the clearance by `until_s` (p,), to a millimetre and never late, inf
    if it does not; and (p,) the distance at `now_s` of the pairs that do, and of trains that of the bodies that do.
    Robots without knots have no contact.
    """
    if not trailers:
        return _first_contacts(robots, knots, a, b, now_s, until_s, clearance_m)
    each_a, each_b, row_of = pairs_with_trailers(a, b, trailers)
    each_s, each_m = _first_contacts(robots, knots, each_a, each_b, now_s, until_s[row_of], clearance_m)
    contact_s, start_m = np.full((2, len(a)), np.inf)
    np.minimum.at(contact_s, row_of, each_s)
    np.minimum.at(start_m, row_of, each_m)
    return contact_s, start_m


def _first_contacts(
    robots: Robots, knots: Knots, a: Ints, b: Ints, now_s: float, until_s: Floats, clearance_m: float
) -> tuple[Floats, Floats]:
    boxes, pairs, pair_of = boxes_of_pairs(robots, knots, a, b, now_s, until_s, clearance_m / 2 + TOLERANCE_M)
    floor_state = (boxes, robots, knots)
    contact_s, start_m, open_, opened = first_contacts_of(
        pairs, pair_of, *floor_state, now_s, until_s, clearance_m, TOLERANCE_M, ROUNDS
    )
    if not opened:
        return contact_s, start_m
    shaped = is_shaped(robots, a, b)
    rows = np.flatnonzero((open_ < np.inf) & shaped[pair_of])
    if len(rows):
        decisions = ShapeDecisions(floor_state, FclCheck(clearance_m, TOLERANCE_M), np.inf, ROUNDS)
        found = decisions.contacts(pairs[rows], open_[rows], (now_s, float(until_s.max())))["contact"]
        at_s = np.maximum(boxes["slab"][pairs["ring"][rows], pairs["a"][rows]] + found, now_s)
        at_s[at_s > until_s[pair_of[rows]]] = np.inf
        np.minimum.at(contact_s, pair_of[rows], at_s)
        open_[rows] = np.inf
        near = np.flatnonzero(shaped & (start_m < np.inf))
        any_m = np.full(len(near), np.inf)
        start_m[near] = shape_distances(a[near], b[near], any_m, *floor_state, *SHAPES.arrays, now_s)
    for row in np.flatnonzero(open_ < np.inf).tolist():
        pair, box_pair, fcl_check = pair_of[row], pairs[row : row + 1], FclCheck(clearance_m, TOLERANCE_M)
        motions = motions_of(box_pair, *floor_state, (now_s, until_s[pair]))
        slab, from_t = boxes["slab"][box_pair["ring"][0], box_pair["a"][0]], float(open_[row])
        contact_s[pair] = min(contact_s[pair], max(slab + fcl_check.first_contact(motions, from_t), now_s))
    return contact_s, start_m


def _order(forecasts: Forecasts) -> Ints:
    """Rows ordered by their values, so that the order of the input does not change the last digit of the result."""
    counts = np.diff(forecasts.start)
    knot = np.minimum(forecasts.start[:-1], max(len(forecasts.t_s) - 1, 0))
    first = [
        np.where(counts > 0, column[knot], 0.0) if len(column) else np.zeros(len(forecasts))
        for column in (forecasts.t_s, forecasts.yaw_rad, forecasts.y_m, forecasts.x_m)
    ]
    return np.lexsort((counts, forecasts.width_m, forecasts.length_m, *first))
