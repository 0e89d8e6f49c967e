"""Doubts about who may report a robot: another vendor reports it, or it is reported from two places.

Pure, and bounded whatever is claimed: by the number of claims, of robots in each, and of robots watched for jumps.
"""

from collections import OrderedDict, deque
from dataclasses import dataclass, field
from math import hypot

from ingest.batch import Claim
from ingest.fleet.prediction.forecast_model import Sighting

HELD_S = 30.0
"""A claim stands for this long after the last report of its kind."""
MOST_CLAIMS = 50
"""Claims at once. Reports that would make further ones are refused and counted all the same."""
NAMED_ROBOTS = 10
"""Robots that a claim names. The others are counted, up to `MOST_COUNTED`."""
MOST_COUNTED = 1000
JUMP_M, JUMP_MPS = 5.0, 10.0
"""A move beyond this length plus this speed is a jump: no robot drives so, and no pose is corrected so repeatedly."""
JUMP_S = 10.0
"""A longer time between two stamps allows no longer move: the clocks of two senders may be hours apart."""
JUMPS, JUMPS_WITHIN_S = 3, 10.0
"""This many jumps within this time make a claim: there, back and there again. A robot that was carried, or that found
its position, jumps once."""
MOST_WATCHED = 1000
"""Robots whose jumps are kept."""


@dataclass(slots=True, eq=False)
class _StandingClaim:
    """The doubtful reports of one claimant about the robots of one owner."""

    since_s: float
    """When the first of them arrived."""
    latest_s: float
    """When the latest of them arrived."""
    robots: dict[str, None] = field(default_factory=dict)
    """UUIDs in the order in which they were claimed. The values are unused."""


class OwnershipClaims:
    """The claims that stand. Times are arrivals."""

    def __init__(self) -> None:
        self._standing: dict[tuple[str, str], _StandingClaim] = {}
        """By owner and claimant. They are the same for robots reported from two places."""
        self._jumps: OrderedDict[str, deque[float]] = OrderedDict()
        """By robot, the times of its last jumps; robots that jumped longest ago first."""

    def add(self, uuid: str, owner: str, claimant: str, arrival_s: float) -> None:
        """Add a report by `claimant` of a robot of `owner`."""
        key = owner, claimant
        if key not in self._standing and len(self._standing) >= MOST_CLAIMS:
            return
        claim = self._standing.setdefault(key, _StandingClaim(arrival_s, arrival_s))
        claim.latest_s = max(claim.latest_s, arrival_s)
        if len(claim.robots) < MOST_COUNTED:
            claim.robots[uuid] = None

    def add_sighting(
        self, uuid: str, vendor: str, before: Sighting, now: Sighting, gap_s: float, arrival_s: float
    ) -> None:
        """Add a sighting that arrived `gap_s` after `before`. A robot that keeps jumping makes a claim."""
        if not _jumped(before, now, gap_s):
            return
        jumps = self._jumps.setdefault(uuid, deque(maxlen=JUMPS))
        jumps.append(arrival_s)
        self._jumps.move_to_end(uuid)
        if len(self._jumps) > MOST_WATCHED:
            self._jumps.popitem(last=False)
        if len(jumps) == JUMPS and arrival_s - jumps[0] <= JUMPS_WITHIN_S:
            self.add(uuid, vendor, vendor, arrival_s)

    def standing(self, now_s: float) -> tuple[Claim, ...]:
        """The claims with a recent report, by owner and claimant."""
        self._standing = {key: claim for key, claim in self._standing.items() if now_s - claim.latest_s <= HELD_S}
        return tuple(
            Claim(*key, tuple(claim.robots)[:NAMED_ROBOTS], len(claim.robots), claim.since_s)
            for key, claim in sorted(self._standing.items())
        )


def _jumped(before: Sighting, now: Sighting, gap_s: float) -> bool:
    """Whether no robot can have moved from one sighting to the other."""
    if before.floor != now.floor:
        return True
    moved_m = hypot(now.x_m - before.x_m, now.y_m - before.y_m)
    return moved_m > JUMP_M and moved_m > JUMP_M + JUMP_MPS * max(gap_s, min(abs(now.t_s - before.t_s), JUMP_S))
