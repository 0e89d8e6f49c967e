"""Floors cut into square tiles. A tile that is too busy is split into quarters, repeatedly if needed.

Every place lies in exactly one tile of a tiling, so the owner of that tile owns the place.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from math import floor, inf
from typing import NamedTuple

import numpy as np

from ingest.batch import Bools, Floats, FloorPoint

QUARTERS = "0123"
"""South-west, south-east, north-west, north-east."""


class Tile(NamedTuple):
    """A square of a floor: a square of the grid, or a quarter of a tile."""

    datum: str
    column: int
    row: int
    path: str = ""
    """A digit of `QUARTERS` for each split; empty for a square of the grid."""

    @property
    def root(self) -> "Tile":
        """The square of the grid in which it lies."""
        return self._replace(path="")

    def quarters(self) -> list["Tile"]:
        return [self._replace(path=self.path + quarter) for quarter in QUARTERS]

    def __str__(self) -> str:
        return f"{self.datum}/{self.column}/{self.row}/{self.path}"

    @classmethod
    def named(cls, name: str) -> "Tile":
        """The tile of a name that `str` gave."""
        datum, column, row, path = name.rsplit("/", 3)
        return cls(datum, int(column), int(row), path)


class Square(NamedTuple):
    """A square in metres. Its west and south edges belong to it, the other two do not."""

    west_m: float
    south_m: float
    side_m: float


@dataclass(frozen=True, slots=True)
class Grid:
    """Tiles of one size before any is split."""

    side_m: float

    def root(self, place: FloorPoint) -> Tile:
        """The tile of the grid that holds a place."""
        return Tile(place.datum, floor(place.x_m / self.side_m), floor(place.y_m / self.side_m))

    def square(self, tile: Tile) -> Square:
        west_m, south_m, side_m = tile.column * self.side_m, tile.row * self.side_m, self.side_m
        for quarter in map(QUARTERS.index, tile.path):
            side_m /= 2
            west_m += side_m * (quarter & 1)
            south_m += side_m * (quarter >> 1)
        return Square(west_m, south_m, side_m)

    def chain(self, place: FloorPoint, depth: int) -> Iterator[Tile]:
        """The tile of the grid that contains a place, then the quarter that does, and so on."""
        tile = self.root(place)
        yield tile
        for _ in range(depth):
            west_m, south_m, side_m = self.square(tile)
            east, north = place.x_m >= west_m + side_m / 2, place.y_m >= south_m + side_m / 2
            tile = tile._replace(path=tile.path + QUARTERS[east + 2 * north])
            yield tile

    def roots_near(self, places: Iterable[FloorPoint], reach_m: float) -> set[Tile]:
        """The tiles of the grid within a reach of any of the places. Many places may be near the same tiles."""
        spans = {(datum, self._span(x_m, reach_m), self._span(y_m, reach_m)) for datum, x_m, y_m in places}
        return {
            Tile(datum, column, row)
            for datum, (west, east), (south, north) in spans
            for column, row in product(range(west, east + 1), range(south, north + 1))
        }

    def _span(self, at_m: float, reach_m: float) -> tuple[int, int]:
        """The first and the last column, or row, within a reach."""
        return floor((at_m - reach_m) / self.side_m), floor((at_m + reach_m) / self.side_m)


class Area:
    """A set of tiles, of which none lies in another."""

    def __init__(self, grid: Grid, tiles: Iterable[Tile]) -> None:
        self.grid, self.tiles = grid, frozenset(tiles)
        self._depth = max((len(tile.path) for tile in self.tiles), default=0)
        self._squares: dict[str, list[Square]] = {}
        for tile in sorted(self.tiles):
            self._squares.setdefault(tile.datum, []).append(grid.square(tile))

    def tile_of(self, place: FloorPoint) -> Tile | None:
        """The tile of the area that contains a place; None if none does."""
        return next((tile for tile in self.grid.chain(place, self._depth) if tile in self.tiles), None)

    def __contains__(self, place: FloorPoint) -> bool:
        return self.tile_of(place) is not None

    def within(self, datum: str, low: Floats, high: Floats, reach_m: Floats | float) -> Bools:
        """(n,) whether boxes on a floor come within a reach of the area. `low` and `high` are their corners, (n, 2)."""
        gap_m = np.full(len(low), inf)
        for west_m, south_m, side_m in self._squares.get(datum, []):
            corner = np.array([west_m, south_m])
            away = np.maximum(np.maximum(corner - high, low - (corner + side_m)), 0.0)
            gap_m = np.minimum(gap_m, np.hypot(away[:, 0], away[:, 1]))
        return gap_m <= reach_m

    def roots_near(self, reach_m: float) -> set[Tile]:
        """The tiles of the grid within a reach of the area."""
        found = set()
        for datum, squares in self._squares.items():
            for west_m, south_m, side_m in squares:
                middle = FloorPoint(datum, west_m + side_m / 2, south_m + side_m / 2)
                found |= self.grid.roots_near([middle], side_m / 2 + reach_m)
        return found
