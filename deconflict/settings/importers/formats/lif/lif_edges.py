"""The edges of a LIF file as ways, with their curves."""

from collections.abc import Iterator, Mapping
from itertools import chain
from math import dist
from typing import Any

import msgspec

from deconflict.settings.importers.formats.directed_ways import Way
from deconflict.settings.importers.plan import Node, Spot, UnusedParts, unused
from ingest.languages.vda5050.trajectories import polyline
from ingest.languages.vda5050.vda_messages import Trajectory

Table = Mapping[str, Any]
FIT_M = 0.5
"""A curve that ends farther from its nodes is not that of its edge."""
NOT_LIMITS = {"vehicleTypeId", "vehicleTypeIds", "mobileRobotTypes", "trajectory"}


def properties(table: Table, kind: str) -> list[Table]:
    """What holds for each type of robots at a node or an edge. LIF 2 has another name for it."""
    names = (f"{robot}Type{kind}Properties" for robot in ("vehicle", "mobileRobot"))
    return list(chain.from_iterable(table.get(name) or () for name in names))


class LifEdges:
    """The edges whose ends are known."""

    def __init__(self, edges: list[Table], nodes: Mapping[str, Node]) -> None:
        self._nodes = nodes
        self._lost = self._straightened = self._varying = self._limited = 0
        self._limits: set[str] = set()
        self.ways = tuple(way for edge in edges if (way := self._way(edge)))

    def left_out(self) -> Iterator[UnusedParts]:
        yield from unused(self._lost, "edge", "it leads from or to a node that is not in the file")
        reason = "no clamped NURBS from node to node; drawn straight"
        yield from unused(self._straightened, "curve of an edge", reason, "curves of edges")
        reason = "they differ by type of robots; drawn by the first"
        yield from unused(self._varying, "edge with several curves", reason, "edges with several curves")
        reason = (
            f"{', '.join(sorted(self._limits))}: the site file has no place for them; orders of VDA 5050 carry them"
        )
        yield from unused(self._limited, "edge with limits or actions", reason, "edges with limits or actions")

    def _way(self, edge: Table) -> Way | None:
        start, end = str(edge["startNodeId"]), str(edge["endNodeId"])
        if start not in self._nodes or end not in self._nodes:
            self._lost += 1
            return None
        limits = {key for each in properties(edge, "Edge") for key, value in each.items() if value is not None}
        limits -= NOT_LIMITS
        self._limits |= limits
        self._limited += bool(limits)
        return Way(start, end, self._bends(edge, self._nodes[start].at, self._nodes[end].at))

    def _bends(self, edge: Table, start: Spot, end: Spot) -> tuple[Spot, ...]:
        sent = [curve for each in properties(edge, "Edge") if (curve := each.get("trajectory"))]
        if not sent:
            return ()
        self._varying += any(curve != sent[0] for curve in sent)
        try:
            curve = polyline(msgspec.convert(sent[0], Trajectory, strict=False))
        except msgspec.ValidationError:
            curve = None
        if not curve or dist(curve[0], start) > FIT_M or dist(curve[-1], end) > FIT_M:
            self._straightened += 1
            return ()
        return curve[1:-1]
