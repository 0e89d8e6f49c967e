"""Deadlocks: robots that wait for each other in a ring.

Everybody wants things that others hold. A robot goes on once each of its wants has a holder that goes on: any one of
the holders of a resource with several places will do. Those that never go on are locked, and among them is a ring.
"""

from collections.abc import Iterable
from dataclasses import dataclass

Node = tuple[str, int]
"""A robot's UUID, and which leg of its journey: 0 from where it is, 1 from its next stop, and so on."""


@dataclass(frozen=True, slots=True)
class Want:
    """On one leg, something that others hold."""

    waiter: Node
    holders: tuple[Node, ...]
    """Any of them will do."""
    where: str
    """Id of a resource or zone, or "path"."""
    from_s: float
    """When it begins to wait."""


@dataclass(frozen=True, slots=True)
class Link:
    """One robot's place in a ring."""

    waiter: str
    holder: str
    where: str
    from_s: float


def rings(wants: Iterable[Want]) -> list[tuple[Link, ...]]:
    """The rings among robots that can never go on, each from its first robot by UUID; none shares a robot's leg."""
    by_waiter: dict[Node, list[Want]] = {}
    for want in wants:
        by_waiter.setdefault(want.waiter, []).append(want)
    locked = _locked(by_waiter)
    waits_for: dict[Node, tuple[Want, Node]] = {}
    for node in sorted(locked):
        hopeless = [one for one in by_waiter[node] if locked.issuperset(one.holders)]
        want = min(hopeless, key=lambda one: (one.from_s, one.where, one.holders))
        waits_for[node] = want, min(want.holders)
    return [_ring(nodes, waits_for) for nodes in _loops(waits_for)]


def _locked(by_waiter: dict[Node, list[Want]]) -> set[Node]:
    """Those that never go on."""
    locked = set(by_waiter)
    while True:
        free = {
            node
            for node in locked
            if all(any(holder not in locked for holder in want.holders) for want in by_waiter[node])
        }
        if not free:
            return locked
        locked -= free


def _loops(waits_for: dict[Node, tuple[Want, Node]]) -> list[list[Node]]:
    """The loops of a graph in which every node leads to one other."""
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


def _ring(nodes: list[Node], waits_for: dict[Node, tuple[Want, Node]]) -> tuple[Link, ...]:
    first = nodes.index(min(nodes))
    links = []
    for node in nodes[first:] + nodes[:first]:
        want, holder = waits_for[node]
        links.append(Link(node[0], holder[0], want.where, want.from_s))
    return tuple(links)
