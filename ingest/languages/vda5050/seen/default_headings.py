"""Headings of nodes that nobody filled in: 0 at all of them, although the way leads across that."""

from collections.abc import Iterable
from itertools import pairwise
from math import atan2, pi

from ingest.frames.angles import turn_between
from ingest.frames.assumed_motion import CORNER_RAD
from ingest.languages.rules import Findings
from ingest.languages.vda5050.vda_messages import NodePlace


def are_default(before: bool, sent: Iterable[NodePlace | None], findings: Findings) -> bool:
    """Whether the headings of nodes are a default, as nodes show that follow each other on a way.

    They are as they were `before` if no heading among these nodes says otherwise.
    """
    places = [place for place in sent if place]
    if any(place.theta for place in places):
        return False
    legs = [(a, atan2(b.y - a.y, b.x - a.x)) for a, b in pairwise(places) if (a.x, a.y) != (b.x, b.y)]
    turns = ((node, before_rad, after_rad) for (_, before_rad), (node, after_rad) in pairwise(legs))
    if before or any(node.theta == 0.0 and _is_across(a_rad) and _is_across(b_rad) for node, a_rad, b_rad in turns):
        findings.note("node-theta-zero", "nodes[].nodePosition.theta", 0.0, "left out")
        return True
    return False


def _is_across(direction_rad: float) -> bool:
    """Whether a robot that heads in direction 0 can drive there neither forwards nor backwards."""
    return CORNER_RAD < abs(turn_between(0.0, direction_rad)) < pi - CORNER_RAD
