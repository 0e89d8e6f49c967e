"""Deadlocks: robots that wait for each other in a ring.

Robots want things that others hold. A robot moves on once each of its wants has a holder that moves on: of a resource
with several places, any one of the holders. Robots that never move on are locked, and among them is a ring.
"""

from collections.abc import Iterable
from dataclasses import dataclass

Node = tuple[str, int]
"""A robot's UUID, and which leg of its journey: 0 from where it is, 1 from its next stop, and so on."""


@dataclass(frozen=True, slots=True)
class Want:
    """Something that a robot wants on one leg and that others hold."""

    waiter: Node
    holders: tuple[Node, ...]
    """It is enough for the waiter that one of them moves on."""
    where: str
    """Id of a resource or zone, or "path"."""
    from_s: float
    """When the waiter begins to wait."""


@dataclass(frozen=True, slots=True)
class RingLink:
    """One robot of a ring, and the next one that it waits for. See `Want`."""

    waiter: str
    """UUID."""
    holder: str
    """UUID of the robot that it waits for."""
    where: str
    """What it waits for: id of a resource or zone, or "path"."""
    from_s: float
    """When it begins to wait, seconds since the epoch."""


def rings(wants: Iterable[Want]) -> list[tuple[RingLink, ...]]:
    """The rings among locked robots, each from its first robot by UUID; no two rings share a leg of a robot."""
    by_waiter: dict[Node, list[Want]] = {}
    for want in wants:
        by_waiter.setdefault(want.waiter, []).append(want)
    locked = _locked(by_waiter)
    waits_for: dict[Node, tuple[Want, Node]] = {}
    for node in sorted(locked):
        hopeless = [want for want in by_waiter[node] if locked.issuperset(want.holders)]
        want = min(hopeless, key=lambda want: (want.from_s, want.where, want.holders))
        waits_for[node] = want, min(want.holders)
    return [_ring(nodes, waits_for) for nodes in _loops(waits_for)]


def _locked(by_waiter: dict[Node, list[Want]]) -> set[Node]:
    """The nodes that never move on."""
    waiters_for: dict[Node, list[Node]] = {}
    for node, wants in by_waiter.items():
        for holder in {holder for want in wants for holder in want.holders}:
            waiters_for.setdefault(holder, []).append(node)
    locked, asked = set(by_waiter), list(by_waiter)
    while asked:
        node = asked.pop()
        if node in locked and not any(locked.issuperset(want.holders) for want in by_waiter[node]):
            locked.remove(node)
            asked += waiters_for.get(node, ())
    return locked


def _loops(waits_for: dict[Node, tuple[Want, Node]]) -> list[list[Node]]:
    """The loops of a graph in which every node leads to one other node."""
    done: set[Node] = set()
    loops = []
    for start in sorted(waits_for):
        trail: dict[Node, int] = {}
        node = start
        while node not in done and node not in trail:
            trail[node] = len(trail)
            node = waits_for[node][1]
        if node in trail:
            loops.append(list(trail)[trail[node] :])
        done |= trail.keys()
    return loops


def _ring(nodes: list[Node], waits_for: dict[Node, tuple[Want, Node]]) -> tuple[RingLink, ...]:
    first = nodes.index(min(nodes))
    links = []
    for node in nodes[first:] + nodes[:first]:
        want, holder = waits_for[node]
        links.append(RingLink(node[0], holder[0], want.where, want.from_s))
    return tuple(links)
