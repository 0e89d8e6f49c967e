"""What silences have meant so far: by vendor, by how the robot was seen last, and by place.

A silence means that the robot is there, has gone elsewhere, or has left. What is not known yet counts in shares: as
much as it is likely now (expectation and maximisation). A place that has its own evidence tells little about the
vendor: so a busy exit does not make every silence of the vendor look like leaving.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import product
from math import floor
from typing import NamedTuple

import numpy as np

from deconflict.foresight.presence import silence_survival
from deconflict.runtime.learned_state import Part, UnreadableError, numbers
from ingest.batch import Floats

PROBABLY_LEFT = 0.5
"""A robot that is less likely to be there than this has probably left."""
CELL_M = 2.0
PLACE_CASES = 1.5
"""A place counts for so many of its own cases what its vendor's silences mean."""
PRIOR_CASES = 5.0
PLACE_MEMORY_CASES = 40.0
"""Where more are counted of a place, the old ones lose weight."""
KEPT_SHARE = 0.98
"""What is left of a vendor's earlier cases that a robot was gone after one more, wherever that was; and so of those
that one was there. So leaving at places that are known makes leaving at new ones unlikely."""
MOST_CELLS = 20_000
EXIT_CASES, EXIT_SHARE = 3.0, 0.5
"""Where so many robots left, and so large a share of those that fell silent, is an exit."""

THERE, ELSEWHERE, LEFT, MAYBE_THERE, MAYBE_LEFT = range(5)
"""Columns of a tally: what is known, and shares of what is not."""
KNOWN = slice(0, 3)
NOTHING: Floats = np.zeros(5)


class LastSeen(IntEnum):
    """How a robot was seen last."""

    GOING = 0
    ARRIVED = 1
    """It had moved, and said that it stands."""
    STANDING = 2


PRIOR_GONE = {LastSeen.GOING: 0.1, LastSeen.ARRIVED: 0.02, LastSeen.STANDING: 0.02}
"""Share of silences in which the robot is gone: who leaves sets out first."""
STAYS = {LastSeen.GOING: 0.25, LastSeen.ARRIVED: 0.5, LastSeen.STANDING: 0.5}
"""Of the robots that are there, those that never report again by themselves: they have broken down."""
AS_WELL = {
    LastSeen.GOING: (LastSeen.GOING,),
    LastSeen.ARRIVED: (LastSeen.ARRIVED, LastSeen.GOING),
    LastSeen.STANDING: (LastSeen.STANDING,),
}
"""Whose silences tell of a place too: many a robot arrives at the exit by which it leaves."""


class FloorPoint(NamedTuple):
    """A place on a floor."""

    datum: str
    x_m: float
    y_m: float


class Cell(NamedTuple):
    """A square of a floor, by its column and row, for robots that were seen so last."""

    datum: str
    column: int
    row: int
    last: LastSeen


class UsualExit(NamedTuple):
    """Where robots usually leave."""

    datum: str
    x_m: float
    y_m: float
    robots: int
    """How many have left there, lately."""


@dataclass(slots=True, eq=False)
class SilenceCase:
    """One silence, and where it is counted."""

    vendor: str
    last: LastSeen
    cells: tuple[tuple[Cell, float], ...]
    """The cells around its place, by how near their middles are; the shares add up to 1."""
    new: float
    """How much it tells of its vendor: 1 where nothing is known of the place."""
    counted: Floats = field(default_factory=NOTHING.copy)
    """(5,) what it is counted as now."""


@dataclass(slots=True, eq=False)
class VendorSilences:
    """Of one vendor's robots that were seen alike last."""

    tally: Floats = field(default_factory=NOTHING.copy)
    """(5,)"""
    lasted: Floats = field(default_factory=lambda: np.zeros(len(silence_survival.EDGES_S)))
    """How long silences lasted that ended where the robot was; see `survival`."""


class SilenceOutcomes:
    """Tallies by vendor and by cell."""

    def __init__(self) -> None:
        self._vendors: dict[tuple[str, LastSeen], VendorSilences] = {}
        self._cells: dict[Cell, Floats] = {}

    def case(self, vendor: str, spot: FloorPoint, last: LastSeen) -> SilenceCase:
        """A silence that begins, not counted yet."""
        cells = tuple(_cells_around(spot, last))
        _, cases = self._local(cells, NOTHING)
        return SilenceCase(vendor, last, cells, (PLACE_CASES / (cases + PLACE_CASES)) ** 2)

    def there(self, case: SilenceCase, silent_s: float, least_s: float) -> float:
        """How likely the robot is still there; silences begin when they have lasted `least_s`."""
        vendor = self._vendors.get((case.vendor, case.last)) or VendorSilences()
        tally = vendor.tally - case.new * case.counted
        prior_gone = PRIOR_CASES * PRIOR_GONE[case.last]
        gone = (_gone(tally) + prior_gone) / (max(float(tally.sum()), 0.0) + PRIOR_CASES)
        local_gone, local = self._local(case.cells, case.counted)
        gone = (local_gone + PLACE_CASES * gone) / (local + PLACE_CASES)
        stays = STAYS[case.last]
        outlasts = stays + (1.0 - stays) * silence_survival.share_longer(vendor.lasted, silent_s, least_s)
        return (1.0 - gone) * outlasts / ((1.0 - gone) * outlasts + gone)

    def count(self, case: SilenceCase, outcome: Mapping[int, float]) -> None:
        """Count a silence as this from now on, by column of a tally."""
        now = NOTHING.copy()
        for column, share in outcome.items():
            now[column] = share
        change, case.counted = now - case.counted, now
        vendor = self._vendors.setdefault((case.vendor, case.last), VendorSilences())
        vendor.tally = np.maximum(_aged(vendor.tally, change) + case.new * change, 0.0)
        for cell, share in case.cells:
            if cell not in self._cells and len(self._cells) >= MOST_CELLS:
                self._make_room()
            self._cells[cell] = _added(self._cells.get(cell, NOTHING), share * change)

    def lasted(self, case: SilenceCase, silent_s: float) -> None:
        """A silence has ended where the robot was."""
        vendor = self._vendors.setdefault((case.vendor, case.last), VendorSilences())
        vendor.lasted = silence_survival.took_in(vendor.lasted, silent_s)

    def exits(self) -> list[UsualExit]:
        """Where robots usually leave, those where most did first; cells beside each other are one exit."""
        tallies: dict[tuple[str, int, int], Floats] = {}
        for cell, tally in self._cells.items():
            key = cell[:3]
            tallies[key] = tallies.get(key, NOTHING) + tally
        by_robots = sorted(tallies, key=lambda one: (-_left(tallies[one]), one))
        found = [exit_ for key in by_robots if (exit_ := _exit_around(key, tallies))]
        return sorted(found, key=lambda one: (-one.robots, one))

    def learned(self) -> Part:
        """What is known for sure, for later."""
        cells = {cell: tally[KNOWN] for cell, tally in self._cells.items() if tally[KNOWN].sum() > 0.01}
        vendors = self._vendors
        return {
            "cells": [list(cell) for cell in cells],
            "cell_tallies": np.array(list(cells.values())).reshape(-1, 3),
            "vendors": [list(key) for key in vendors],
            "vendor_tallies": np.array([one.tally[KNOWN] for one in vendors.values()]).reshape(-1, 3),
            "lasted": np.array([one.lasted for one in vendors.values()]).reshape(-1, len(silence_survival.EDGES_S)),
        }

    def resume(self, part: Part) -> None:
        """Go on with what `learned` told. Raises `UnreadableError`."""
        if not part:
            return
        try:
            cells = [Cell(str(datum), int(x), int(y), LastSeen(last)) for datum, x, y, last in part["cells"]]
            vendors = [(str(vendor), LastSeen(last)) for vendor, last in part["vendors"]]
        except (KeyError, TypeError, ValueError) as error:
            raise UnreadableError(f"what silences meant is not told: {error}") from error
        of_cells = numbers(part, "cell_tallies", (len(cells), 3))
        of_vendors = numbers(part, "vendor_tallies", (len(vendors), 3))
        lasted = numbers(part, "lasted", (len(vendors), len(silence_survival.EDGES_S)))
        self._cells = {cell: _known(tally) for cell, tally in zip(cells, of_cells, strict=True)}
        self._vendors = {
            key: VendorSilences(_known(tally), counts)
            for key, tally, counts in zip(vendors, of_vendors, lasted, strict=True)
        }

    def _local(self, cells: Iterable[tuple[Cell, float]], own: Floats) -> tuple[float, float]:
        """Cases in which a robot was gone, and all, around a place; without what a case itself counts.

        One at the very same place counts as one.
        """
        tally, same = NOTHING, 0.0
        for cell, share in cells:
            for last in AS_WELL[cell.last]:
                tally = tally + share * self._cells.get(cell._replace(last=last), NOTHING)
            tally = tally - share * share * own
            same += share * share
        return max(_gone(tally), 0.0) / same, max(float(tally.sum()), 0.0) / same

    def _make_room(self) -> None:
        """Forget the tenth of the cells of which least is known."""
        for cell in sorted(self._cells, key=lambda one: float(self._cells[one].sum()))[: MOST_CELLS // 10]:
            del self._cells[cell]


def _cells_around(spot: FloorPoint, last: LastSeen) -> Iterator[tuple[Cell, float]]:
    """The four cells whose middles are nearest, by bilinear weights."""
    column, row = spot.x_m / CELL_M - 0.5, spot.y_m / CELL_M - 0.5
    for right, up in product((0, 1), (0, 1)):
        across = 1.0 - abs(column - floor(column) - right)
        along = 1.0 - abs(row - floor(row) - up)
        if across * along > 0.0:
            yield Cell(spot.datum, floor(column) + right, floor(row) + up, last), across * along


def _exit_around(key: tuple[str, int, int], tallies: dict[tuple[str, int, int], Floats]) -> UsualExit | None:
    """The exit in a cell and those beside it, which are taken out of `tallies`; None where too few robots left."""
    datum, column, row = key
    beside = [(datum, column + right, row + up) for right, up in product((-1, 0, 1), (-1, 0, 1))]
    beside = [one for one in beside if one in tallies]
    tally = sum((tallies[one] for one in beside), NOTHING)
    left = _left(tally)
    if key not in tallies or left < EXIT_CASES or left < EXIT_SHARE * tally.sum():
        return None
    x_m = sum(_left(tallies[one]) * (one[1] + 0.5) * CELL_M for one in beside) / left
    y_m = sum(_left(tallies[one]) * (one[2] + 0.5) * CELL_M for one in beside) / left
    for one in beside:
        del tallies[one]
    return UsualExit(datum, round(x_m, 1), round(y_m, 1), round(left))


def _left(tally: Floats) -> float:
    return float(tally[LEFT] + tally[MAYBE_LEFT])


def _gone(tally: Floats) -> float:
    return float(tally[ELSEWHERE]) + _left(tally)


def _added(tally: Floats, change: Floats) -> Floats:
    """The tally of a cell with a change."""
    tally = np.maximum(tally + change, 0.0)
    tally[KNOWN] *= PLACE_MEMORY_CASES / max(float(tally[KNOWN].sum()), PLACE_MEMORY_CASES)
    return tally


def _aged(tally: Floats, change: Floats) -> Floats:
    """The tally of a vendor before a change of what is known."""
    tally, more = tally.copy(), np.maximum(change, 0.0)
    tally[THERE] *= KEPT_SHARE ** more[THERE]
    tally[[ELSEWHERE, LEFT]] *= KEPT_SHARE ** (more[ELSEWHERE] + more[LEFT])
    return tally


def _known(three: Floats) -> Floats:
    return np.concatenate([three, np.zeros(2)])
