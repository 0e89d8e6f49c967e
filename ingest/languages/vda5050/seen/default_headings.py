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

    They are as they were `before` if no heading among these nodes says otherwise. Only nodes that all have one show it:
    a station alone may have a heading of 0.
    """
    places = [place for place in sent if place]
    if any(place.theta for place in places):
        return False
    legs = [(a, atan2(b.y - a.y, b.x - a.x)) for a, b in pairwise(places) if (a.x, a.y) != (b.x, b.y)]
    turns = ((node, before_rad, after_rad) for (_, before_rad), (node, after_rad) in pairwise(legs))
    are_zero = [place.theta == 0.0 for place in places]
    is_default = before or (all(are_zero) and any(_is_across(a_rad) and _is_across(b_rad) for _, a_rad, b_rad in turns))
    if is_default and any(are_zero):
        findings.note("node-theta-zero", "nodes[].nodePosition.theta", 0.0, "left out")
    return is_default


def _is_across(direction_rad: float) -> bool:
    """Whether a robot that heads in direction 0 can drive there neither forwards nor backwards."""
    return CORNER_RAD < abs(turn_between(0.0, direction_rad)) < pi - CORNER_RAD
