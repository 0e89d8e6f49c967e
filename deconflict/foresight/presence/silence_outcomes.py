"""The outcomes of silences so far: by vendor, by how the robot was last seen, and by place.

After a silence a robot is found where it was, is found elsewhere, or has left. An outcome that is not known yet counts
in shares, by its present probability (expectation maximisation). Silences at a place with its own evidence count little
for the vendor, so that a busy exit does not make every silence of the vendor look like leaving.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import product
from math import floor
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from deconflict.foresight.presence import silence_survival
from deconflict.runtime.learned_state import Form, Part, count_column
from ingest.batch import Floats, FloorPoint

CELL_M = 2.0
"""Side of a cell of a floor."""
PLACE_CASES = 1.5
"""At a place, the outcomes of the vendor count as this many cases."""
PRIOR_CASES = 5.0
"""Of a vendor, the prior counts as this many cases."""
PLACE_MEMORY_CASES = 40.0
"""If a place has more cases, the old ones lose weight."""
KEPT_SHARE = 0.98
"""The share of a vendor's earlier cases of gone robots that is left after one more case, at any place; and the same of
robots that were present. So leaving at known places makes leaving at new places unlikely."""
MOST_CELLS = 20_000
"""Cells that are kept in memory."""
EXIT_CASES, EXIT_SHARE = 3.0, 0.5
"""A place is an exit if so many robots have left there, and so large a share of those that fell silent there."""

THERE, ELSEWHERE, LEFT, MAYBE_THERE, MAYBE_LEFT = range(5)
"""Columns of a tally: three for known outcomes, two for shares of unknown outcomes."""
KNOWN = slice(0, 3)
"""The columns of known outcomes."""
NOTHING: Floats = np.zeros(5)


class LastSeen(IntEnum):
    """How a robot was last seen."""

    GOING = 0
    ARRIVED = 1
    """It had moved, and its last forecast has it stand."""
    STANDING = 2
    LEAVING = 3
    """Its way led out, over the edge of the ground on which robots were heard; see `heard_ground`."""


PRIOR_GONE = {LastSeen.GOING: 0.1, LastSeen.ARRIVED: 0.02, LastSeen.STANDING: 0.02, LastSeen.LEAVING: 0.7}
"""Prior share of silences after which the robot is gone: a robot that leaves drives first."""
STAYS = {LastSeen.GOING: 0.25, LastSeen.ARRIVED: 0.5, LastSeen.STANDING: 0.5, LastSeen.LEAVING: 0.25}
"""Share of the present robots that never report again by themselves, because they have broken down."""
AS_WELL = {
    LastSeen.GOING: (LastSeen.GOING, LastSeen.LEAVING),
    LastSeen.ARRIVED: (LastSeen.ARRIVED, LastSeen.GOING, LastSeen.LEAVING),
    LastSeen.STANDING: (LastSeen.STANDING,),
    LastSeen.LEAVING: (LastSeen.LEAVING,),
}
"""By how a robot was last seen: the silences of which robots say something of its own silence at the same place. Many
robots arrive at the exit by which they leave."""


_FIRST_KINDS = [last.name for last in LastSeen if last is not LastSeen.LEAVING]
"""A state of an earlier release has no other ones, and fits as it is."""
Index = Annotated[int, Field(ge=-(10**9), le=10**9)]
FORM = Form(
    f"robots there, elsewhere and left, by {CELL_M} m cells; silences by {silence_survival.BINS} bins from "
    f"{silence_survival.FIRST_EDGE_S} s on by the root of 2; last seen as {', '.join(_FIRST_KINDS)}",
    {"cells": list[tuple[str, Index, Index, LastSeen]], "vendors": list[tuple[str, LastSeen]]},
    {
        "cell_tallies": count_column("cells", 3),
        "vendor_tallies": count_column("vendors", 3),
        "lasted": count_column("vendors", len(silence_survival.EDGES_S)),
    },
)


class Cell(NamedTuple):
    """A square of a floor, for robots that were last seen in one way."""

    datum: str
    column: int
    row: int
    last: LastSeen


class UsualExit(NamedTuple):
    """A place where robots usually leave. These are also the names in JSON."""

    datum: str
    x_m: float
    y_m: float
    robots: int
    """How many have left there lately."""


@dataclass(slots=True, eq=False)
class SilenceCase:
    """One silence, and what it is counted for."""

    vendor: str
    last: LastSeen
    cells: tuple[Cell, ...]
    """The n cells around its place."""
    shares: Floats
    """(n,) their shares, by how near their middles are. They add up to 1."""
    vendor_weight: float = 1.0
    """How much it counts for its vendor: 1 if nothing is known of the place."""
    counted: Floats = field(default_factory=NOTHING.copy)
    """(5,) the tally that it is counted with now."""


@dataclass(slots=True, eq=False)
class VendorSilences:
    """The silences of a vendor's robots that were last seen in one way."""

    tally: Floats = field(default_factory=NOTHING.copy)
    """(5,) outcomes."""
    lasted: Floats = field(default_factory=lambda: np.zeros(len(silence_survival.EDGES_S)))
    """Lengths of the silences that ended with the robot where it was; see `silence_survival`."""


class SilenceOutcomes:
    """Tallies of outcomes by vendor and by cell."""

    def __init__(self) -> None:
        self._vendors: dict[tuple[str, LastSeen], VendorSilences] = {}
        self._cells: dict[Cell, Floats] = {}

    def case(self, vendor: str, spot: FloorPoint, last: LastSeen) -> SilenceCase:
        """The case of a silence that begins. It is not counted yet."""
        cells, shares = zip(*_cells_around(spot, last), strict=True)
        case = SilenceCase(vendor, last, cells, np.array(shares))
        _, cases = self._local(case)
        case.vendor_weight = (PLACE_CASES / (cases + PLACE_CASES)) ** 2
        return case

    def there(self, case: SilenceCase, silent_s: float, least_s: float) -> float:
        """The probability that the robot is still present after `silent_s`. Silences count from `least_s` on."""
        vendor = self._vendors.get((case.vendor, case.last)) or VendorSilences()
        tally = vendor.tally - case.vendor_weight * case.counted
        prior_gone = PRIOR_CASES * PRIOR_GONE[case.last]
        gone = (_gone(tally) + prior_gone) / (max(float(tally.sum()), 0.0) + PRIOR_CASES)
        local_gone, local = self._local(case)
        gone = (local_gone + PLACE_CASES * gone) / (local + PLACE_CASES)
        stays = STAYS[case.last]
        outlasts = stays + (1.0 - stays) * silence_survival.share_longer(vendor.lasted, silent_s, least_s)
        return (1.0 - gone) * outlasts / ((1.0 - gone) * outlasts + gone)

    def count(self, case: SilenceCase, outcome: Mapping[int, float]) -> None:
        """Count a silence with this outcome from now on, instead of the one before. `outcome` has shares by column of a
        tally."""
        tally = NOTHING.copy()
        for column, share in outcome.items():
            tally[column] = share
        change, case.counted = tally - case.counted, tally
        vendor = self._vendors.setdefault((case.vendor, case.last), VendorSilences())
        vendor.tally = np.maximum(_aged(vendor.tally, change) + case.vendor_weight * change, 0.0)
        if len(self._cells) > MOST_CELLS - len(case.cells) and not all(cell in self._cells for cell in case.cells):
            self._make_room()
        tallies = [self._cells.get(cell, NOTHING) for cell in case.cells]
        self._cells.update(zip(case.cells, _added(np.array(tallies), np.outer(case.shares, change)), strict=True))

    def count_length(self, case: SilenceCase, silent_s: float) -> None:
        """Count the length of a silence that has ended with the robot where it was."""
        vendor = self._vendors.setdefault((case.vendor, case.last), VendorSilences())
        vendor.lasted = silence_survival.with_case(vendor.lasted, silent_s)

    def exits(self) -> list[UsualExit]:
        """The places where robots usually leave, the busiest first. Neighbouring cells are one exit."""
        tallies: dict[tuple[str, int, int], Floats] = {}
        for cell, tally in self._cells.items():
            key = cell[:3]
            tallies[key] = tallies.get(key, NOTHING) + tally
        by_robots = sorted(tallies, key=lambda key: (-_left(tallies[key]), key))
        exits = [exit_ for key in by_robots if (exit_ := _exit_around(key, tallies))]
        return sorted(exits, key=lambda exit_: (-exit_.robots, exit_))

    def learned(self) -> Part:
        """What is kept over a restart: the known outcomes."""
        cells = {cell: tally[KNOWN] for cell, tally in self._cells.items() if tally[KNOWN].sum() > 0.01}
        vendors = self._vendors
        lasted = np.array([silences.lasted for silences in vendors.values()])
        return FORM.part(
            {
                "cells": [list(cell) for cell in cells],
                "cell_tallies": np.array(list(cells.values())).reshape(-1, 3),
                "vendors": [list(key) for key in vendors],
                "vendor_tallies": np.array([silences.tally[KNOWN] for silences in vendors.values()]).reshape(-1, 3),
                "lasted": lasted.reshape(-1, len(silence_survival.EDGES_S)),
            }
        )

    def resume(self, part: Part) -> None:
        """Go on with what `learned` returned. Raises `UnreadableError`."""
        state = FORM.checked(part)
        tallies = map(_tally_of, state["cell_tallies"])
        self._cells = {Cell(*cell): tally for cell, tally in zip(state["cells"], tallies, strict=True)}
        silences = map(VendorSilences, map(_tally_of, state["vendor_tallies"]), state["lasted"])
        self._vendors = dict(zip(state["vendors"], silences, strict=True))

    def _local(self, case: SilenceCase) -> tuple[float, float]:
        """The cases around a place after which a robot was gone, and all cases there; without `case` itself. A case at
        the very same place counts as one."""
        tallies = np.array([self._of_place(cell) for cell in case.cells])
        same = float(case.shares @ case.shares)
        tally = case.shares @ tallies - same * case.counted
        return max(_gone(tally), 0.0) / same, max(float(tally.sum()), 0.0) / same

    def _of_place(self, cell: Cell) -> Floats:
        """(5,) the tally of a cell, with those of other ways in which robots were last seen there that say as much."""
        tally = NOTHING
        for last in AS_WELL[cell.last]:
            other = self._cells.get(cell if last is cell.last else cell._replace(last=last))
            tally = tally if other is None else tally + other
        return tally

    def _make_room(self) -> None:
        """Forget the tenth of the cells with the least evidence."""
        for cell in sorted(self._cells, key=lambda cell: float(self._cells[cell].sum()))[: MOST_CELLS // 10]:
            del self._cells[cell]


def _cells_around(spot: FloorPoint, last: LastSeen) -> Iterator[tuple[Cell, float]]:
    """The four cells whose middles are nearest, with bilinear weights."""
    column, row = spot.x_m / CELL_M - 0.5, spot.y_m / CELL_M - 0.5
    for right, up in product((0, 1), (0, 1)):
        across = 1.0 - abs(column - floor(column) - right)
        along = 1.0 - abs(row - floor(row) - up)
        if across * along > 0.0:
            yield Cell(spot.datum, floor(column) + right, floor(row) + up, last), across * along


def _exit_around(key: tuple[str, int, int], tallies: dict[tuple[str, int, int], Floats]) -> UsualExit | None:
    """The exit in a cell and its neighbours, which are removed from `tallies`; None if too few robots left there."""
    datum, column, row = key
    around = [(datum, column + right, row + up) for right, up in product((-1, 0, 1), (-1, 0, 1))]
    around = [cell for cell in around if cell in tallies]
    tally = sum((tallies[cell] for cell in around), NOTHING)
    left = _left(tally)
    if key not in tallies or left < EXIT_CASES or left < EXIT_SHARE * tally.sum():
        return None
    x_m = sum(_left(tallies[cell]) * (cell[1] + 0.5) * CELL_M for cell in around) / left
    y_m = sum(_left(tallies[cell]) * (cell[2] + 0.5) * CELL_M for cell in around) / left
    for cell in around:
        del tallies[cell]
    return UsualExit(datum, round(x_m, 1), round(y_m, 1), round(left))


def _left(tally: Floats) -> float:
    return float(tally[LEFT] + tally[MAYBE_LEFT])


def _gone(tally: Floats) -> float:
    return float(tally[ELSEWHERE]) + _left(tally)


def _added(tallies: Floats, changes: Floats) -> Floats:
    """The tallies (n, 5) of cells after changes (n, 5)."""
    tallies = np.maximum(tallies + changes, 0.0)
    tallies[:, KNOWN] *= PLACE_MEMORY_CASES / np.maximum(
        tallies[:, KNOWN].sum(axis=1, keepdims=True), PLACE_MEMORY_CASES
    )
    return tallies


def _aged(tally: Floats, change: Floats) -> Floats:
    """The tally of a vendor with the weights that old cases have after a change."""
    tally, added = tally.copy(), np.maximum(change, 0.0)
    tally[THERE] *= KEPT_SHARE ** added[THERE]
    tally[[ELSEWHERE, LEFT]] *= KEPT_SHARE ** (added[ELSEWHERE] + added[LEFT])
    return tally


def _tally_of(known: Floats) -> Floats:
    """The tally with these known outcomes (3,)."""
    return np.concatenate([known, np.zeros(2)])
