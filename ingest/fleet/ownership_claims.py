"""Whose word on a robot is in doubt: another vendor reports it, or it is reported from two places.

Pure, and bounded whatever is claimed: so many claims, so many robots of each, so many robots watched for jumps.
"""

from collections import OrderedDict, deque
from dataclasses import dataclass, field
from math import hypot

from ingest.batch import Claim
from ingest.fleet.forecast import Sighting

HELD_S = 30.0
"""A claim stands for so long after the last report of its kind."""
MOST_CLAIMS = 50
"""At once; the reports of further ones are refused and counted all the same."""
NAMED_ROBOTS = 10
"""Robots that a claim names; the others are counted, up to `MOST_COUNTED`."""
MOST_COUNTED = 1000
JUMP_M, JUMP_MPS = 5.0, 10.0
"""What no robot moves at once, and a second, nor any correction of a pose again and again."""
JUMP_S = 10.0
"""A longer time between two stamps explains no longer way: the clocks of two senders may be hours apart."""
JUMPS, JUMPS_WITHIN_S = 3, 10.0
"""There, back and there again: a robot that was carried, or that found where it is, jumps once."""
MOST_WATCHED = 1000


@dataclass(slots=True, eq=False)
class _Standing:
    since_s: float
    heard_s: float
    robots: dict[str, None] = field(default_factory=dict)
    """In the order in which they were claimed."""


class Claims:
    """The claims that stand. Times are arrivals."""

    def __init__(self) -> None:
        self._standing: dict[tuple[str, str], _Standing] = {}
        """By owner and claimant; of a robot in two places they are the same."""
        self._jumps: OrderedDict[str, deque[float]] = OrderedDict()
        """When each robot jumped last, those that jumped longest ago first."""

    def refused(self, uuid: str, owner: str, claimant: str, arrival_s: float) -> None:
        """`claimant` reported a robot of `owner`."""
        self._claim(uuid, owner, claimant, arrival_s)

    def seen(self, uuid: str, vendor: str, before: Sighting, now: Sighting, gap_s: float, arrival_s: float) -> None:
        """A robot was reported at `now`, `gap_s` after `before` by arrival: a claim where it keeps jumping."""
        if not _jumped(before, now, gap_s):
            return
        jumps = self._jumps.setdefault(uuid, deque(maxlen=JUMPS))
        jumps.append(arrival_s)
        self._jumps.move_to_end(uuid)
        if len(self._jumps) > MOST_WATCHED:
            self._jumps.popitem(last=False)
        if len(jumps) == JUMPS and arrival_s - jumps[0] <= JUMPS_WITHIN_S:
            self._claim(uuid, vendor, vendor, arrival_s)

    def standing(self, now_s: float) -> tuple[Claim, ...]:
        """The claims heard of lately, by owner and claimant."""
        self._standing = {key: one for key, one in self._standing.items() if now_s - one.heard_s <= HELD_S}
        return tuple(
            Claim(*key, tuple(one.robots)[:NAMED_ROBOTS], len(one.robots), one.since_s)
            for key, one in sorted(self._standing.items())
        )

    def _claim(self, uuid: str, owner: str, claimant: str, arrival_s: float) -> None:
        key = owner, claimant
        if key not in self._standing and len(self._standing) >= MOST_CLAIMS:
            return
        one = self._standing.setdefault(key, _Standing(arrival_s, arrival_s))
        one.heard_s = max(one.heard_s, arrival_s)
        if len(one.robots) < MOST_COUNTED:
            one.robots[uuid] = None


def _jumped(before: Sighting, now: Sighting, gap_s: float) -> bool:
    """Whether no robot can have been at both places."""
    if before.floor != now.floor:
        return True
    moved_m = hypot(now.x_m - before.x_m, now.y_m - before.y_m)
    return moved_m > JUMP_M and moved_m > JUMP_M + JUMP_MPS * max(gap_s, min(abs(now.t_s - before.t_s), JUMP_S))
