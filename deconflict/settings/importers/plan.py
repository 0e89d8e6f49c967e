"""What the importers read, before it becomes a site file: points, lanes, doors and lifts, metres, y left of x."""

from dataclasses import dataclass
from typing import Literal

Spot = tuple[float, float]
Use = Literal["charger", "parking", "dock", "station"]


class PlanError(ValueError):
    """A file that can't be read as a plan; the message says what to change."""


@dataclass(frozen=True, slots=True)
class Node:
    """A point that robots drive to or through."""

    id: str
    at: Spot
    name: str = ""
    use: Use | None = None
    """What robots do there; None where they only pass."""
    lift: str = ""
    """The lift whose cabin it lies in."""


@dataclass(frozen=True, slots=True)
class Lane:
    """A straight way between two nodes, by their ids."""

    start: str
    end: str
    two_way: bool


@dataclass(frozen=True, slots=True)
class Door:
    """A doorway, from jamb to jamb."""

    name: str
    ends: tuple[Spot, Spot]


@dataclass(frozen=True, slots=True)
class Block:
    """Lanes of which one robot at a time may use any, by pairs of node ids; a node alone is paired with itself."""

    name: str
    lanes: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Lift:
    """A cabin. Where it opens on other floors, a node of that floor lies in it."""

    name: str
    level: str
    """The floor that `at` is on."""
    at: Spot
    yaw_rad: float
    size_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Level:
    """One floor with a frame of its own."""

    name: str
    nodes: tuple[Node, ...]
    lanes: tuple[Lane, ...] = ()
    doors: tuple[Door, ...] = ()
    blocks: tuple[Block, ...] = ()


@dataclass(frozen=True, slots=True)
class Plan:
    name: str
    levels: tuple[Level, ...]
    """From the ground up."""
    lifts: tuple[Lift, ...] = ()
