"""Who owns which tile. Pure: from the table as it is and what members tell, the table as it should be.

Every member works it out and the first to write it wins, so that nobody need be in charge.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from deconflict.cluster.tiles.tiles import Tile

SMALLEST_M = 8.0
"""No tile of less than twice this side is split: a pair at its edge is judged by several engines as it is."""
UNEVEN = 0.2
"""Tiles move while the least busy member has so much less to do than the busiest."""
TURNED = 0.5
"""A tile that would leave so much of the difference the other way round stays, so that none goes to and fro."""
IDLE_PER_S = 1.0
"""What a tile costs whose robots are all silent."""


@dataclass(frozen=True, slots=True)
class Table:
    """Owner by tile; no tile lies in another."""

    owners: Mapping[Tile, str] = field(default_factory=dict)
    watch: str | None = None
    """Who watches over what robots share, and everything else that is not of one place."""

    def of(self, member: str) -> frozenset[Tile]:
        return frozenset(tile for tile, owner in self.owners.items() if owner == member)

    def document(self) -> dict[str, Any]:
        return {"owners": {str(tile): owner for tile, owner in sorted(self.owners.items())}, "watch": self.watch}

    @classmethod
    def of_document(cls, told: dict[str, Any]) -> Self:
        return cls({Tile.named(name): owner for name, owner in told["owners"].items()}, told["watch"])


Loads = Mapping[str, Mapping[Tile, float]]
"""Statuses a second by member and tile, as each has counted them in those that it had all the while."""


def revised(table: Table, loads: Loads, roots: Iterable[Tile], side_m: float, hot_per_s: float) -> Table:
    """The table after the loss of members, with an owner for every tile, hot ones split, and at most one moved.

    `loads` has an entry for each member that is alive, `roots` are the tiles of the grid in which there are robots.
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
    beside = _Beside(alive)
    for tile in orphans:
        room = [member for member in burdens if burdens[member] + IDLE_PER_S <= fair] or list(burdens)
        owner = min(room, key=lambda member: (-beside.count(tile, member), burdens[member], member))
        alive[tile], per_s[tile] = owner, IDLE_PER_S
        burdens[owner] += IDLE_PER_S
        beside.add(tile, owner)
    owners = _split(alive, per_s, side_m, hot_per_s)
    counted = all(tile in loads[owner] for tile, owner in alive.items())
    if len(owners) == len(alive) and counted:
        owners = _evened(owners, per_s, burdens)
    watch = table.watch if table.watch in loads else min(burdens, key=lambda member: (burdens[member], member))
    return Table(owners, watch)


def _split(owners: dict[Tile, str], per_s: Mapping[Tile, float], side_m: float, hot_per_s: float) -> dict[Tile, str]:
    """The quarters of a tile that is too hot stay with its owner until they are moved one by one."""
    told: dict[Tile, str] = {}
    for tile, owner in owners.items():
        large = side_m / 2 ** len(tile.path) >= 2 * SMALLEST_M
        told |= dict.fromkeys(tile.quarters() if large and per_s[tile] > hot_per_s else [tile], owner)
    return told


class _Beside:
    """Who owns what next to a tile: tiles of one owner side by side overlap less with others'."""

    def __init__(self, owners: Mapping[Tile, str]) -> None:
        self._owners: dict[Tile, Counter[str]] = {}
        for tile, owner in owners.items():
            self.add(tile, owner)

    def add(self, tile: Tile, owner: str) -> None:
        self._owners.setdefault(tile.root, Counter())[owner] += 1

    def count(self, tile: Tile, owner: str) -> int:
        """Tiles of an owner in the same tile of the grid, and in the four beside it."""
        around = ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
        cells = (Tile(tile.datum, tile.column + east, tile.row + north) for east, north in around)
        return sum(self._owners[cell][owner] for cell in cells if cell in self._owners)


def _evened(owners: dict[Tile, str], per_s: Mapping[Tile, float], burdens: Mapping[str, float]) -> dict[Tile, str]:
    """One tile moves from the busiest member to the least busy, best one that lies beside the latter's others."""
    ordered = sorted(burdens, key=lambda member: (burdens[member], member))
    least, most = ordered[0], ordered[-1]
    gap = burdens[most] - burdens[least]
    moves = [tile for tile, owner in owners.items() if owner == most and 2 * per_s[tile] - gap <= TURNED * gap]
    if gap <= UNEVEN * burdens[most] or not moves:
        return owners
    beside = _Beside(owners)
    best = min(
        moves,
        key=lambda tile: (beside.count(tile, most) - beside.count(tile, least), abs(gap - 2 * per_s[tile]), tile),
    )
    return owners | {best: least}
