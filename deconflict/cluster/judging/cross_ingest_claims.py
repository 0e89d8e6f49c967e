"""Claims on robots: those that each ingest finds, and those that only show between several ingests.

An ingest does not know the robots of the others. The vendor that reported a robot first owns it.
"""

from collections.abc import Iterable

import numpy as np

from ingest.batch import Batch, Claim, Ints
from ingest.fleet.owners import ownership_claims
from ingest.fleet.prediction.forecast_model import Sighting
from ingest.settings import UNKNOWN

CLAIM_LASTS_S = 2.0
"""A claim stands for this long after the last batch of any ingest that has it."""


class CrossIngestClaims:
    """The claims of all ingests. Times are arrivals and ticks."""

    def __init__(self) -> None:
        self._reported: dict[tuple[str, str], tuple[float, Claim]] = {}
        """By owner and claimant, the last claim that an ingest reported, and when."""
        self._between = ownership_claims.OwnershipClaims()
        self._last_seen: dict[str, tuple[str, float, Sighting]] = {}
        """By robot its owner, when it reported last, and where it was."""

    def add_reported(self, claims: Iterable[Claim], now_s: float) -> None:
        """Take in the claims that stand at one ingest."""
        for claim in claims:
            self._reported[claim.owner, claim.claimant] = now_s, claim

    def owned_rows(self, batch: Batch) -> Ints:
        """(m,) the rows of a batch whose robot is reported by its owner. The other rows are noted as claims."""
        begins = batch.forecasts.start[:-1]
        columns = (
            batch.event_s,
            batch.forecasts.floor[begins],
            batch.forecasts.x_m[begins],
            batch.forecasts.y_m[begins],
        )
        poses = zip(*(column.tolist() for column in columns), strict=True)
        rows = zip(batch.robots, batch.vendors, batch.arrival_s.tolist(), poses, strict=True)
        return np.array([number for number, row in enumerate(rows) if self._is_from_owner(*row)], np.int64)

    def _is_from_owner(self, uuid: str, vendor: str, arrival_s: float, pose: tuple[float, int, float, float]) -> bool:
        now, before = Sighting(*pose, yaw_rad=float("nan")), self._last_seen.get(uuid)
        if before and vendor == UNKNOWN:  # it has come to an ingest that does not know it yet
            vendor = before[0]
        if before and before[0] not in (vendor, UNKNOWN):
            self._between.add(uuid, before[0], vendor, arrival_s)
            return False
        if before and -1 not in (before[2].floor, now.floor):
            self._between.add_sighting(uuid, vendor, before[2], now, arrival_s - before[1], arrival_s)
        self._last_seen[uuid] = vendor, arrival_s, now
        return True

    def forget(self, uuids: Iterable[str]) -> None:
        for uuid in uuids:
            self._last_seen.pop(uuid, None)

    def standing(self, now_s: float) -> tuple[Claim, ...]:
        """All claims that stand, ordered by owner and claimant."""
        self._reported = {
            key: (at_s, claim) for key, (at_s, claim) in self._reported.items() if now_s - at_s <= CLAIM_LASTS_S
        }
        claims = {(claim.owner, claim.claimant): claim for claim in self._between.standing(now_s)}
        for key, (_, claim) in self._reported.items():
            claims[key] = _joined(claim, claims[key]) if key in claims else claim
        return tuple(claims[key] for key in sorted(claims))


def _joined(a: Claim, b: Claim) -> Claim:
    robots = tuple(dict.fromkeys((*a.robots, *b.robots)))[: ownership_claims.NAMED_ROBOTS]
    return Claim(a.owner, a.claimant, robots, max(a.claimed, b.claimed, len(robots)), min(a.since_s, b.since_s))
