"""The way of an order: which node comes after which, and which edge leads to it.

Sequence ids say it, if they rise and are each there once. The standard lets them have gaps. Some senders repeat them,
begin anew with each update, or count otherwise in states than in orders; then the ids of nodes and edges say it.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from itertools import pairwise
from operator import attrgetter, lt

from ingest.languages.rules import Findings
from ingest.languages.vda5050.vda_messages import Edge, VdaNode

STEP = 2
"""Between two nodes that are numbered here, as in orders that number nodes and edges together."""
_SEQUENCE_ID = attrgetter("sequence_id")


def plain_id(sent: str) -> str:
    """An id without case and outer spaces, in which messages and parts of them differ."""
    return sent.strip().lower()


def _ends(edge: Edge) -> tuple[str, str]:
    return plain_id(edge.start_node_id), plain_id(edge.end_node_id)


def numbers_of(nodes: Sequence[VdaNode], edges: Sequence[Edge], findings: Findings) -> list[int]:
    """(n,) a number of each node, each there once. The node with the next number comes next."""
    numbers = [node.sequence_id for node in nodes]
    if all(map(lt, numbers, numbers[1:])):
        return numbers
    row = next(row for row, (before, after) in enumerate(pairwise(numbers), 1) if after <= before)
    ends = set(map(_ends, edges))
    is_way = all(each in ends for each in pairwise(plain_id(node.node_id) for node in nodes))
    if len(set(numbers)) == len(numbers) and not is_way:
        return numbers  # a list that is not in the order of the way
    findings.note("sequence-ids-odd", f"nodes[{row}].sequenceId", numbers[row], "the order of the list")
    return list(range(0, STEP * len(nodes), STEP))


def edges_by_end(numbered: Sequence[tuple[int, VdaNode]], edges: Sequence[Edge], findings: Findings) -> dict[int, Edge]:
    """The edge that leads to each node, by the number of the node. `numbered` are the nodes in the order of the way.

    It is the one between this node and the one before, by their ids; else by its sequence id, between theirs.
    """
    by_sequence = {edge.sequence_id: edge for edge in edges}
    search: _EdgeSearch | None = None
    found: dict[int, Edge] = {}
    before: VdaNode | None = None
    for number, node in numbered:
        direct = by_sequence.get(node.sequence_id - 1)
        if direct and before and _ends(direct) == (plain_id(before.node_id), plain_id(node.node_id)):
            found[number] = direct
        elif direct or before:
            search = search or _EdgeSearch(edges, by_sequence)
            if edge := search.between(before, node, findings):
                found[number] = edge
        before = node
    if len(found) < len(edges):
        _note_unused(edges, found, findings)
    return found


class _EdgeSearch:
    """Finds edges that do not have the sequence id before that of their node, or lead elsewhere by their ids."""

    def __init__(self, edges: Sequence[Edge], by_sequence: Mapping[int, Edge]) -> None:
        self._by_sequence, self._sequence_ids = by_sequence, sorted(by_sequence)
        self._by_ends: dict[tuple[str, str], list[Edge]] = {}
        """By the ids of the nodes, as `plain_id` has them, in the order of sequence ids."""
        for edge in sorted(edges, key=_SEQUENCE_ID):
            if all(ends := _ends(edge)):
                self._by_ends.setdefault(ends, []).append(edge)

    def between(self, before: VdaNode | None, node: VdaNode, findings: Findings) -> Edge | None:
        """The edge from one node to the next. None if there is none. Of the first node it may come before it."""
        last, end_id = node.sequence_id, plain_id(node.node_id)
        start_id, first = (plain_id(before.node_id), before.sequence_id) if before else ("", last - STEP)
        if by_ids := self._by_ends.get((start_id, end_id)):
            row = bisect_right(by_ids, first, key=_SEQUENCE_ID)
            is_between = row < len(by_ids) and by_ids[row].sequence_id < last
            return by_ids[row if is_between else 0]
        nearest = last_between(self._sequence_ids, first, last)
        edge = None if nearest is None else self._by_sequence[nearest]
        if edge and before and not _joins(edge, start_id, end_id):
            findings.note("edge-misfit", "edges[].startNodeId", edge.start_node_id, "by its sequenceId")
        return edge


def last_between(numbers: Sequence[int], first: int, last: int) -> int | None:
    """The last of some rising numbers that lies between two others, usually the one before the last."""
    row = bisect_left(numbers, last) - 1
    return numbers[row] if row >= 0 and numbers[row] > first else None


def _joins(edge: Edge, start_id: str, end_id: str) -> bool:
    """Whether an edge leads from one node to the other, as far as it says so."""
    own_start_id, own_end_id = _ends(edge)
    return own_start_id in ("", start_id) and own_end_id in ("", end_id)


def _note_unused(edges: Sequence[Edge], found: Mapping[int, Edge], findings: Findings) -> None:
    used = set(map(id, found.values()))
    row = next((row for row, edge in enumerate(edges) if id(edge) not in used), None)
    if row is not None:
        findings.note("edge-misfit", f"edges[{row}].sequenceId", edges[row].sequence_id, "not used")
