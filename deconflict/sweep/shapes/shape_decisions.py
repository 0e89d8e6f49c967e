"""Which pairs with a shape come within the clearance: kernels advance, FCL decides."""

from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deconflict.sweep.broadphase import Pairs
from deconflict.sweep.fcl_check import FclCheck
from deconflict.sweep.geometry.knots import Knots, Robots
from deconflict.sweep.narrowphase import Contacts, Motions, Span, motions_of
from deconflict.sweep.shapes.fcl_shapes import MovingShapes, Solid, touches
from deconflict.sweep.shapes.shape_contacts import Poses, shape_contacts, smallest_of_shapes
from deconflict.sweep.shapes.shape_table import SHAPES
from ingest.batch import Bools, Floats, Ints

BEYOND_M = 1e-4
"""FCL is asked whether robots that are moved together by their distance and this much touch."""

FloorState = tuple[NDArray[Any], Robots, Knots]
"""Boxes, robots and knots, by slot."""


class ShapeDecisions:
    """Decides pairs of boxes that may be in contact, of which at least one robot is a shape."""

    def __init__(self, floor_state: FloorState, fcl_check: FclCheck, accuracy_m: float, rounds: int) -> None:
        """Contacts are within the target of `fcl_check`, to its tolerance; smallest separations to `accuracy_m`. If
        that is infinite they are not wanted, and FCL does not confirm contacts: it decides only what advancement leaves
        open after `rounds` steps."""
        self._floor_state, self._check = floor_state, fcl_check
        self._accuracy_m, self._rounds = accuracy_m, rounds

    def contacts(self, pairs: Pairs, since: Floats, span: Span) -> Contacts:
        """The contact of each pair of boxes within `span`, from `since` (pairs,) seconds into the slab on."""
        state, shapes = self._floor_state, SHAPES.arrays
        bounds = self._check.target_m, self._check.tolerance_m, self._accuracy_m
        contacts, poses = shape_contacts(pairs, since, *state, span, *shapes, *bounds, self._rounds)
        if self._accuracy_m < inf:
            self._confirm(pairs, poses, contacts, span)
        for row in np.flatnonzero(contacts["open"] < inf).tolist():
            self._decide(pairs[row : row + 1], contacts, row, span)
        return contacts

    def _confirm(self, pairs: Pairs, poses: Poses, contacts: Contacts, span: Span) -> None:
        """Ask FCL about new contacts, and about those that go on from one that it denies."""
        new = self._new_contacts(pairs, contacts, span)
        if not new.any():
            return
        asked = new & ~self._are_plain(pairs)
        denied = self._deny(asked, pairs, poses, contacts)
        if len(denied):
            others = (contacts["contact"] < inf) & ~asked
            self._deny(others & _of_same_robots(pairs, denied), pairs, poses, contacts)

    def _are_plain(self, pairs: Pairs) -> Bools:
        """Which pairs are of rectangles and circles alone. Their distances are certain."""
        shape = self._floor_state[1]["shape"]
        plain: Bools = SHAPES.is_plain[shape[pairs["a"]]] & SHAPES.is_plain[shape[pairs["b"]]]
        return plain

    def _new_contacts(self, pairs: Pairs, contacts: Contacts, span: Span) -> Bools:
        """Which contacts FCL has to confirm: all but those that go on from the slab before, or into the span."""
        is_met = contacts["contact"] < inf
        slab = self._floor_state[0]["slab"][pairs["ring"], pairs["a"]]
        goes_on: Bools = contacts["contact"] <= span[0] - slab
        same = (pairs["a"][1:] == pairs["a"][:-1]) & (pairs["b"][1:] == pairs["b"][:-1])
        goes_on[1:] |= same & (slab[1:] == slab[:-1] + 1) & is_met[:-1] & (contacts["contact"][1:] <= 0.0)
        return is_met & ~goes_on

    def _deny(self, asked: Bools, pairs: Pairs, poses: Poses, contacts: Contacts) -> Ints:
        """Ask FCL about contacts, and leave open those that it denies. Returns their rows."""
        rows = np.flatnonzero(asked)
        if not len(rows):
            return rows
        denied = rows[~self._are_confirmed(pairs[rows], poses[rows])]
        contacts["open"][denied] = contacts["contact"][denied]
        return denied

    def _are_confirmed(self, pairs: Pairs, poses: Poses) -> Bools:
        """Whether FCL confirms each contact: B touches A if it is moved along the shortest vector between them by
        little more than its length. So they are not further apart than that."""
        self._check.calls += len(pairs)
        apart_m = np.hypot(poses[:, 3], poses[:, 4])
        moved = 1.0 + BEYOND_M / np.maximum(apart_m, BEYOND_M)
        placed = poses[:, :3].copy()
        placed[:, :2] -= poses[:, 3:] * moved[:, None]
        solids = solids_of(self._floor_state[1], pairs)
        asked = zip(pairs["a"].tolist(), pairs["b"].tolist(), strict=True)
        return touches([(solids[a], solids[b]) for a, b in asked], placed)

    def _decide(self, pair: Pairs, contacts: Contacts, row: int, span: Span) -> None:
        """Let FCL find the contact of one pair."""
        motions = motions_of(pair, *self._floor_state, span)
        solids = solids_of(self._floor_state[1], pair)
        a, b = solids[int(pair["a"][0])], solids[int(pair["b"][0])]
        moving = (MovingShapes(motion, a, b) for motion in motions)
        contact = self._check.first_of(moving, float(contacts["open"][row]))
        contacts[row] = (contact, inf, inf, inf)
        if contact < inf and self._accuracy_m < inf:
            contacts["separation"][row], contacts["separation_at"][row] = self._smallest(pair, motions)

    def _smallest(self, pair: Pairs, motions: Motions) -> tuple[float, float]:
        two = self._floor_state[1][[pair["a"][0], pair["b"][0]]]
        return smallest_of_shapes(two, motions, *SHAPES.arrays, self._accuracy_m)


def _of_same_robots(pairs: Pairs, rows: Ints) -> Bools:
    """Which pairs of boxes are of the same two robots as those of `rows`."""
    code = pairs["a"].astype(np.int64) << 32 | pairs["b"]
    return np.isin(code, code[rows])


def is_shaped(robots: Robots, a: Ints, b: Ints) -> Bools:
    """(p,) whether either robot of each pair of slots is a shape."""
    shaped: Bools = (robots["shape"][a] > 0) | (robots["shape"][b] > 0)
    return shaped


def solids_of(robots: Robots, pairs: Pairs) -> dict[int, Solid]:
    """By slot, the robots of pairs as FCL knows them."""
    slots = np.unique(np.concatenate([pairs["a"], pairs["b"]]))
    columns = (robots[name][slots].tolist() for name in Solid._fields)
    return dict(zip(slots.tolist(), map(Solid, *columns), strict=True))
