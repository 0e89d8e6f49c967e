"""A plan as the importers read it: points, lanes, doors and lifts, in metres, with y to the left of x."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from deconflict_client.counted_nouns import count_of

Spot = tuple[float, float]
"""x and y in the frame of its level, metres."""
Use = Literal["charger", "parking", "dock", "station"]
NO_LEVELS = "has no levels; expected an Open-RMF building file, a LIF layout or an openTCS plant model"


class PlanError(ValueError):
    """The file can't be read as a plan; the message says what to change."""


@dataclass(frozen=True, slots=True)
class Node:
    """A point that robots drive to or through."""

    id: str
    at: Spot
    name: str = ""
    use: Use | None = None
    """What robots do there; None if they only pass."""
    lift: str = ""
    """The lift in whose cabin it lies; empty if in none."""


@dataclass(frozen=True, slots=True)
class Lane:
    """A lane between two nodes, given by their ids."""

    start: str
    end: str
    two_way: bool
    bends: tuple[Spot, ...] = ()
    """Points between the nodes that a lane passes which is not straight."""

    def way(self, spots: Mapping[str, Spot]) -> tuple[Spot, ...]:
        """From node to node. `spots` are the places of its floor's nodes, by id."""
        return (spots[self.start], *self.bends, spots[self.end])


@dataclass(frozen=True, slots=True)
class Door:
    """A doorway, from jamb to jamb."""

    name: str
    ends: tuple[Spot, Spot]


@dataclass(frozen=True, slots=True)
class Block:
    """Lanes that only one robot at a time may use, as pairs of node ids. A single node is paired with itself."""

    name: str
    lanes: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Lift:
    """A cabin, and the floors on which it opens."""

    name: str
    level: str
    """The floor that `at` is on."""
    at: Spot
    """Centre of the cabin."""
    yaw_rad: float
    """Direction of its first side, anticlockwise from x."""
    size_m: tuple[float, float]
    """Length along that direction, and across it."""
    landings: tuple[tuple[str, Spot], ...] | None = None
    """The other floors on which it opens, and its centre there; None for each that has a node in it."""


@dataclass(frozen=True, slots=True)
class Level:
    """One floor with a frame of its own."""

    name: str
    nodes: tuple[Node, ...]
    lanes: tuple[Lane, ...] = ()
    doors: tuple[Door, ...] = ()
    blocks: tuple[Block, ...] = ()
    walls: tuple[tuple[Spot, Spot], ...] = ()
    """From end to end."""
    datum: str = ""
    """The id of the floor in messages of robots; empty if the plan does not have it."""

    def spots(self) -> dict[str, Spot]:
        """Where its nodes are, by id."""
        return {node.id: node.at for node in self.nodes}


@dataclass(frozen=True, slots=True)
class UnusedParts:
    """Parts of a plan that the site file does not get."""

    parts: str
    """How many of what, as "3 locked paths"."""
    reason: str


def unused(count: int, noun: str, reason: str, plural: str = "") -> Iterator[UnusedParts]:
    """Says that so many parts are left out; nothing if there are none."""
    if count:
        yield UnusedParts(count_of(count, noun, plural), reason)


@dataclass(frozen=True, slots=True)
class ImportedPlan:
    """Everything that an importer reads from one file."""

    name: str
    """Name of the site for people."""
    format: str
    """What the file is, as "an Open-RMF building"."""
    levels: tuple[Level, ...]
    """Ordered from the lowest."""
    lifts: tuple[Lift, ...] = ()
    left_out: tuple[UnusedParts, ...] = ()
    doubts: tuple[str, ...] = ()
    """What a person should look at, in sentences without their full stop."""
