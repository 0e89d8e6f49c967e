"""The owners of the tiles. Pure: computes the next owner table from the present one and the members' loads.

Every member computes it, and the first to write it wins, so that no member needs to be in charge.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from deconflict.cluster.tiles.tiles import Tile

SMALLEST_M = 8.0
"""No tile smaller than twice this side is split: several engines would judge most of its pairs."""
UNEVEN = 0.2
"""Tiles move while the load of the least busy member is below the busiest member's by this share."""
MOST_REVERSED = 0.5
"""A tile moves only if the difference in the other direction is then at most this share. Prevents oscillation."""
IDLE_PER_S = 1.0
"""Load of a tile whose robots are all silent."""


@dataclass(frozen=True, slots=True)
class OwnerTable:
    """The owner of each tile. No tile lies in another."""

    owners: Mapping[Tile, str] = field(default_factory=dict)
    global_engine: str | None = None
    """The member that runs the global judge."""

    def of(self, member: str) -> frozenset[Tile]:
        return frozenset(tile for tile, owner in self.owners.items() if owner == member)

    def document(self) -> dict[str, Any]:
        return {
            "owners": {str(tile): owner for tile, owner in sorted(self.owners.items())},
            "watch": self.global_engine,
        }

    @classmethod
    def of_document(cls, document: dict[str, Any]) -> Self:
        return cls({Tile.named(name): owner for name, owner in document["owners"].items()}, document["watch"])


Loads = Mapping[str, Mapping[Tile, float]]
"""Statuses a second by member and tile. A member counts only tiles that it owned for the whole interval."""


def revised_table(
    table: OwnerTable, loads: Loads, roots: Iterable[Tile], side_m: float, hot_per_s: float
) -> OwnerTable:
    """The next table: every tile has a live owner, hot tiles are split, and at most one tile has moved.

    `loads` has an entry for each live member, `roots` are the tiles of the grid with robots.
    """
    if not loads:
        return table
    alive = {tile: owner for tile, owner in table.owners.items() if owner in loads}
    known = {tile.root for tile in table.owners}
    orphans = sorted((table.owners.keys() - alive.keys()) | (set(roots) - known))
    per_s = {tile: IDLE_PER_S + loads[owner].get(tile, 0.0) for tile, owner in alive.items()}
    burdens = dict.fromkeys(sorted(loads), 0.0)
    for tile, owner in alive.items():
        burdens[owner] += per_s[tile]
    fair = (sum(burdens.values()) + IDLE_PER_S * len(orphans)) / len(burdens)
    neighbours = _Neighbours(alive)
    for tile in orphans:
        candidates = [member for member in burdens if burdens[member] + IDLE_PER_S <= fair] or list(burdens)
        owner = min(candidates, key=lambda member: (-neighbours.count(tile, member), burdens[member], member))
        alive[tile], per_s[tile] = owner, IDLE_PER_S
        burdens[owner] += IDLE_PER_S
        neighbours.add(tile, owner)
    owners = _split_hot(alive, per_s, side_m, hot_per_s)
    counted = all(tile in loads[owner] for tile, owner in alive.items())
    if len(owners) == len(alive) and counted:
        owners = _balanced(owners, per_s, burdens)
    global_engine = (
        table.global_engine
        if table.global_engine in loads
        else min(burdens, key=lambda member: (burdens[member], member))
    )
    return OwnerTable(owners, global_engine)


def _split_hot(
    owners: dict[Tile, str], per_s: Mapping[Tile, float], side_m: float, hot_per_s: float
) -> dict[Tile, str]:
    """Split hot tiles into quarters. The quarters stay with the owner until they are moved one by one."""
    split: dict[Tile, str] = {}
    for tile, owner in owners.items():
        large = side_m / 2 ** len(tile.path) >= 2 * SMALLEST_M
        split |= dict.fromkeys(tile.quarters() if large and per_s[tile] > hot_per_s else [tile], owner)
    return split


class _Neighbours:
    """Owners by tile of the grid. Adjacent tiles of one owner overlap less with those of others."""

    def __init__(self, owners: Mapping[Tile, str]) -> None:
        self._owners: dict[Tile, Counter[str]] = {}
        for tile, owner in owners.items():
            self.add(tile, owner)

    def add(self, tile: Tile, owner: str) -> None:
        self._owners.setdefault(tile.root, Counter())[owner] += 1

    def count(self, tile: Tile, owner: str) -> int:
        """Number of an owner's tiles in the same tile of the grid and in its four neighbours."""
        around = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
        cells = (Tile(tile.datum, tile.column + east, tile.row + north) for east, north in around)
        return sum(self._owners[cell][owner] for cell in cells if cell in self._owners)


def _balanced(owners: dict[Tile, str], per_s: Mapping[Tile, float], burdens: Mapping[str, float]) -> dict[Tile, str]:
    """Move one tile from the busiest member to the least busy, if possible one beside the latter's tiles."""
    ordered = sorted(burdens, key=lambda member: (burdens[member], member))
    least, most = ordered[0], ordered[-1]
    gap = burdens[most] - burdens[least]
    moves = [tile for tile, owner in owners.items() if owner == most and 2 * per_s[tile] - gap <= MOST_REVERSED * gap]
    if gap <= UNEVEN * burdens[most] or not moves:
        return owners
    neighbours = _Neighbours(owners)
    best = min(
        moves,
        key=lambda tile: (
            neighbours.count(tile, most) - neighbours.count(tile, least),
            abs(gap - 2 * per_s[tile]),
            tile,
        ),
    )
    return owners | {best: least}
