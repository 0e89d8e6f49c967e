"""Who owns which tile. Pure: from the table as it is and what members tell, the table as it should be.

Every member works it out and the first to write it wins, so that nobody need be in charge.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

from deconflict.cluster.tiles import Tile

SMALLEST_M = 8.0
"""No tile of less than twice this side is split: a pair at its edge is judged by several engines as it is."""
UNEVEN = 0.2
"""A tile moves only where that makes the busiest member by so much of its load less busy."""
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
"""Statuses a second by member and tile, as each counts them in its own."""


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
    for tile in orphans:
        alive[tile] = min(burdens, key=lambda member: (burdens[member], member))
        per_s[tile] = IDLE_PER_S
        burdens[alive[tile]] += IDLE_PER_S
    owners = _split(alive, per_s, side_m, hot_per_s)
    if len(owners) == len(alive) and not orphans:
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


def _evened(owners: dict[Tile, str], per_s: Mapping[Tile, float], burdens: Mapping[str, float]) -> dict[Tile, str]:
    """The tile that evens out the busiest and the least busy member best moves from the one to the other."""
    ordered = sorted(burdens, key=lambda member: (burdens[member], member))
    least, most = ordered[0], ordered[-1]
    gap = burdens[most] - burdens[least]
    moves = [tile for tile, owner in owners.items() if owner == most and per_s[tile] < gap]
    if not moves:
        return owners
    best = min(moves, key=lambda tile: (abs(gap - 2 * per_s[tile]), tile))
    after = max(burdens[most] - per_s[best], burdens[least] + per_s[best])
    return owners if after > (1 - UNEVEN) * burdens[most] else owners | {best: least}
