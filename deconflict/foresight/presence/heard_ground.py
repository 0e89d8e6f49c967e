"""The ground on which robots were heard, and the exits of the plan: whether the way of a robot leads out over its edge.

Ground is counted by cells of each floor. Where several were heard and a way leads on to cells in which nobody ever was,
it leads out. Through a door of the plan it does so from the first robot on, unless somebody was heard behind the door;
into a lift always. What lies between two reports of a robot counts as heard. Once the ground is too large to be kept
whole, nothing is said of its edge.
"""

from collections.abc import Iterable, Sequence
from math import floor, hypot

import numpy as np
import shapely

from deconflict.foresight.presence.report_intervals import Legs
from deconflict.foresight.presence.silence_outcomes import CELL_M, Index
from deconflict.runtime.learned_state import Form, Part, count_column
from deconflict.settings.shared_places import Place, outlines

ENOUGH = 3
"""A cell into which so many came has an edge, if nobody was heard beyond."""
MOST_CELLS = 20_000
"""Cells that are kept, of all floors."""
JOINED_M = 20.0
"""Between two reports further apart the way is not known."""
BEHIND_M = CELL_M + 0.5
"""A way that ends in a door goes on behind it: so far is surely another cell."""

Cell = tuple[str, int, int]
"""Floor, column and row."""
Point = tuple[float, float]
FORM = Form(
    f"{CELL_M} m cells of floors, and how many robots came into each, up to {ENOUGH}",
    {"cells": list[tuple[str, Index, Index]]},
    {"came": count_column("cells")},
)


class HeardGround:
    """Cells in which robots were heard, and the doors and lifts of a site."""

    def __init__(self, places: Iterable[Place] = ()) -> None:
        self._came: dict[Cell, int] = {}
        """How many came into each cell, up to `ENOUGH`."""
        self._exits: dict[str, list[tuple[shapely.Polygon, bool]]] = {}
        """By floor: outlines of doors and lifts, and whether it is a lift."""
        for place in places:
            for datum, outline in outlines(place):
                if (kind := getattr(place, "kind", "")) in ("door", "lift"):
                    self._exits.setdefault(datum, []).append((shapely.Polygon(outline), kind == "lift"))

    def add(self, legs: Legs, floors: Sequence[str]) -> None:
        """Robots were heard at the ends of these legs."""
        columns, rows = np.floor(legs.x_m / CELL_M).astype(np.int64), np.floor(legs.y_m / CELL_M).astype(np.int64)
        is_new = (legs.floor[:, 0] != legs.floor[:, 1]) | (legs.gap_s == np.inf)
        is_new |= (columns[:, 0] != columns[:, 1]) | (rows[:, 0] != rows[:, 1])
        for leg in np.flatnonzero(is_new & (legs.floor[:, 1] >= 0)).tolist():
            for cell in _cells_of(legs, leg, columns[leg, 1], rows[leg, 1]):
                key = floors[legs.floor[leg, 1]], *cell
                if key in self._came or len(self._came) < MOST_CELLS:
                    self._came[key] = min(self._came.get(key, 0) + 1, ENOUGH)

    def leads_out(self, datum: str, way: Sequence[Point]) -> bool:
        """Whether a way of a robot, from where it was last heard, leads into a lift, or out over the edge."""
        points = shapely.points(way)
        for outline, is_lift in self._exits.get(datum, ()):
            within = np.flatnonzero(shapely.intersects(outline, points))
            if len(within) and (is_lift or self._is_unheard(datum, _on_from(way, int(within[0])))):
                return True
        return self._came.get((datum, *_cell(way[0])), 0) >= ENOUGH and self._is_unheard(datum, way[1:])

    def learned(self) -> Part:
        """What is kept over a restart."""
        came = np.array(list(self._came.values()), np.float64)
        return FORM.part({"cells": [list(cell) for cell in self._came], "came": came})

    def resume(self, part: Part) -> None:
        """Go on with what `learned` returned. Raises `UnreadableError`."""
        state = FORM.checked(part)
        self._came = {cell: int(came) for cell, came in zip(state["cells"], state["came"], strict=True)}

    def _is_unheard(self, datum: str, points: Iterable[Point]) -> bool:
        """Whether some of these points are where nobody was heard."""
        return len(self._came) < MOST_CELLS and any((datum, *_cell(point)) not in self._came for point in points)


def _cell(point: Point) -> tuple[int, int]:
    return floor(point[0] / CELL_M), floor(point[1] / CELL_M)


def _cells_of(legs: Legs, leg: int, column: int, row: int) -> set[tuple[int, int]]:
    """The cells that a robot came into on a leg; the last one if its way is not known."""
    (from_x_m, x_m), (from_y_m, y_m) = legs.x_m[leg].tolist(), legs.y_m[leg].tolist()
    long_m = hypot(x_m - from_x_m, y_m - from_y_m)
    if legs.gap_s[leg] == np.inf or legs.floor[leg, 0] != legs.floor[leg, 1] or not CELL_M / 2 < long_m <= JOINED_M:
        return {(int(column), int(row))}
    shares = np.linspace(0.0, 1.0, int(2 * long_m / CELL_M) + 2).tolist()
    cells = {_cell((from_x_m + share * (x_m - from_x_m), from_y_m + share * (y_m - from_y_m))) for share in shares}
    return cells - {_cell((from_x_m, from_y_m))}


def _on_from(way: Sequence[Point], row: int) -> list[Point]:
    """The points of a way after one in a door, and one behind its end. Nothing if it goes nowhere."""
    (from_x_m, from_y_m), (x_m, y_m) = way[0], way[-1]
    if (long_m := hypot(x_m - from_x_m, y_m - from_y_m)) < 0.1:
        return []
    share = BEHIND_M / long_m
    return [*way[row + 1 :], (x_m + share * (x_m - from_x_m), y_m + share * (y_m - from_y_m))]
