"""Ground on which bodies were seen, in squares and by the size of the body; the same from the areas of a site that say
so."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np
import shapely
from pydantic import Field

from deconflict.adviser.ways import Boxes, bodies
from deconflict.contention.robots.robot_table import RobotTable
from deconflict.runtime.learned_state import Form, Part
from deconflict.settings.site import Site
from ingest.batch import Bools, Floats, Ints

SQUARE_M = 0.2
SIZE_M = 0.1
"""Sizes are compared in these steps."""
LARGEST_M = 8.0
"""Ground under a body that is longer from corner to corner is not kept: it would be thousands of squares."""
MOST_SQUARES, MOST_SIZES = 50_000, 30
"""Kept of one size on one floor: as many of these again, then the older are forgotten. And of sizes on all floors."""
KEPT_SQUARES = 200_000
"""Kept over a restart, those of the sizes that were seen last."""
_ROW, _FIRST = 2**32, -(2**30)
"""Squares are numbered along y, then along x, from this one on."""
MOST_STEPS = 10**4
_Steps = Annotated[int, Field(ge=0, le=MOST_STEPS)]
_Square = Annotated[int, Field(ge=0, lt=2**63)]
FORM = Form(
    f"squares of {SQUARE_M:g} m on which a body was, numbered from {_FIRST} along y and in rows of {_ROW} along x, by "
    f"floor and by length, width and top of the body in steps of {SIZE_M:g} m",
    {"squares": list[tuple[str, tuple[_Steps, _Steps, _Steps], list[_Square]]]},
)


class Size(NamedTuple):
    """The least measures of a body in steps of `SIZE_M`."""

    length: int
    width: int
    top: int
    """0 if it is not known, or the body is below the floor's height 0: such bodies are seen where any was, and say
    nothing of the height."""


@dataclass(slots=True)
class _Squares:
    newer: set[int] = field(default_factory=set)
    older: set[int] = field(default_factory=set)

    def add(self, squares: Sequence[int]) -> None:
        self.newer.update(squares)
        if len(self.newer) > MOST_SQUARES:
            self.newer, self.older = set(), self.newer


class SeenGround:
    """The squares of each floor under bodies that were reported there."""

    def __init__(self, site: Site) -> None:
        self._squares: dict[tuple[str, Size], _Squares] = {}
        """By datum of the floor and size, the size that was seen last is last."""
        self._allowed: dict[str, list[shapely.Polygon]] = {}
        for area in site.areas:
            if area.refuge:
                self._allowed.setdefault(area.floor or site.datums[0].id, []).append(shapely.Polygon(area.outline_m))

    def add(self, robots: RobotTable, slots: Sequence[int]) -> None:
        """Robots of `slots` were reported where they are."""
        sizes = {slot: size for slot in slots if not _is_large(size := size_of(robots, robots.slots.uuids[slot]))}
        if not sizes:
            return
        rows, squares = _under(bodies(robots, np.array(list(sizes))))
        ends = np.searchsorted(rows, np.arange(len(sizes) + 1)).tolist()
        for row, (slot, size) in enumerate(sizes.items()):
            key = robots[robots.slots.uuids[slot]].datum, size
            self._squares[key] = self._squares.pop(key) if key in self._squares else _Squares()
            self._squares[key].add(squares[ends[row] : ends[row + 1]].tolist())
        while len(self._squares) > MOST_SIZES:
            del self._squares[next(iter(self._squares))]

    def holds(self, floor: str, size: Size, boxes: Boxes) -> Bools:
        """(n,) whether a body at least as large was on all ground under each of `boxes` (n,)."""
        seen = [squares for squares in self._of(floor, size) if squares]
        rows, squares = _under(boxes)
        is_seen = np.array([any(square in each for each in seen) for square in squares.tolist()], np.bool_)
        if floor in self._allowed:
            x_m, y_m = ((np.array(at) + _FIRST + 0.5) * SQUARE_M for at in np.divmod(squares, _ROW))
            for outline in self._allowed[floor]:
                is_seen |= shapely.contains_xy(outline, x_m, y_m)
        found = np.ones(len(boxes.x_m), np.bool_)
        found[rows[~is_seen]] = False
        return found

    def learned(self) -> Part:
        """What is kept over a restart."""
        kept, left = [], KEPT_SQUARES
        for (floor, size), squares in reversed(self._squares.items()):
            numbers = sorted(squares.newer | squares.older)[:left]
            left -= len(numbers)
            kept.append([floor, list(size), numbers])
        return FORM.part({"squares": kept[::-1]})

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave. Raises `UnreadableError`."""
        kept = FORM.checked(part)["squares"]
        sizes = ((floor, Size(*size), numbers) for floor, size, numbers in kept)
        self._squares = {(floor, size): _Squares(set(numbers)) for floor, size, numbers in sizes if not _is_large(size)}

    def _of(self, floor: str, least: Size) -> Iterator[set[int]]:
        for (datum, size), squares in self._squares.items():
            if datum == floor and all(a >= b for a, b in zip(size, least, strict=True)):
                yield squares.newer
                yield squares.older


def size_of(robots: RobotTable, robot: str) -> Size:
    """The size of a robot with what it carries."""
    body = robots[robot]
    measures = (body.length_m, body.width_m, body.top_m if np.isfinite(body.top_m) else 0.0)
    return Size._make(min(max(int(measure_m / SIZE_M + 1e-6), 0), MOST_STEPS) for measure_m in measures)


def _is_large(size: Size) -> bool:
    """Whether nothing is kept of the ground under bodies of this size."""
    return bool(np.hypot(size.length, size.width) * SIZE_M > LARGEST_M)


def _under(boxes: Boxes) -> tuple[Ints, Ints]:
    """Squares whose centres are in boxes (n,): the row of the box of each, ascending, and its number."""
    reach_m = np.hypot(boxes.half_length_m, boxes.half_width_m)
    first = np.floor((np.stack(boxes[:2]) - reach_m) / SQUARE_M)
    count = int(2 * reach_m.max(initial=0.0) / SQUARE_M) + 2
    steps = np.arange(count)
    x, y = np.broadcast_arrays(first[0][:, None, None] + steps[:, None], first[1][:, None, None] + steps)
    dx_m, dy_m = ((k + 0.5) * SQUARE_M - at[:, None, None] for k, at in ((x, boxes.x_m), (y, boxes.y_m)))
    inside = _inside(boxes, dx_m, dy_m)
    x, y = (k[inside].astype(np.int64) - _FIRST for k in (x, y))
    return np.nonzero(inside)[0], x * _ROW + y


def _inside(boxes: Boxes, dx_m: Floats, dy_m: Floats) -> Bools:
    """Whether points off the centres of boxes (n,) are in them; offsets are (n, k, k)."""
    cos, sin, half_length_m, half_width_m = (
        column[:, None, None]
        for column in (np.cos(boxes.yaw_rad), np.sin(boxes.yaw_rad), boxes.half_length_m, boxes.half_width_m)
    )
    along, across = abs(dx_m * cos + dy_m * sin), abs(dy_m * cos - dx_m * sin)
    found: Bools = (along <= half_length_m) & (across <= half_width_m)
    return found
