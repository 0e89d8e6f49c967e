"""Whose word on a robot is in doubt: what each ingest found, and what only several together show.

One ingest knows of no robot that speaks to another: who reported a robot first owns it.
"""

from collections.abc import Iterable

import numpy as np

from ingest.batch import Batch, Claim, Ints
from ingest.fleet.owners import ownership_claims
from ingest.fleet.prediction.forecast_model import Sighting
from ingest.settings import UNKNOWN

STANDS_S = 2.0
"""A claim stands for so long after the last batch of any ingest that has it."""


class Doubts:
    """The claims of all ingests. Times are arrivals and ticks."""

    def __init__(self) -> None:
        self._heard: dict[tuple[str, str], tuple[float, Claim]] = {}
        """By owner and claimant, when an ingest told a claim last, and it."""
        self._between = ownership_claims.OwnershipClaims()
        self._seen: dict[str, tuple[str, float, Sighting]] = {}
        """By robot its owner, when it was heard of last, and where it was."""

    def stand(self, told: Iterable[Claim], now_s: float) -> None:
        """Take in the claims that stand at one ingest."""
        for one in told:
            self._heard[one.owner, one.claimant] = now_s, one

    def owned(self, batch: Batch) -> Ints:
        """(m,) the rows of robots whose owner reports them; the others are claimed."""
        begins = batch.forecasts.start[:-1]
        columns = (
            batch.event_s,
            batch.forecasts.floor[begins],
            batch.forecasts.x_m[begins],
            batch.forecasts.y_m[begins],
        )
        poses = zip(*(column.tolist() for column in columns), strict=True)
        rows = zip(batch.robots, batch.vendors, batch.arrival_s.tolist(), poses, strict=True)
        return np.array([row for row, each in enumerate(rows) if self._owns(*each)], np.int64)

    def _owns(self, uuid: str, vendor: str, arrival_s: float, pose: tuple[float, int, float, float]) -> bool:
        now, before = Sighting(*pose, yaw_rad=float("nan")), self._seen.get(uuid)
        if before and vendor == UNKNOWN:  # it has come to an ingest that does not know it yet
            vendor = before[0]
        if before and before[0] not in (vendor, UNKNOWN):
            self._between.add_refused(uuid, before[0], vendor, arrival_s)
            return False
        if before and -1 not in (before[2].floor, now.floor):
            self._between.add_sighting(uuid, vendor, before[2], now, arrival_s - before[1], arrival_s)
        self._seen[uuid] = vendor, arrival_s, now
        return True

    def forget(self, uuids: Iterable[str]) -> None:
        for uuid in uuids:
            self._seen.pop(uuid, None)

    def standing(self, now_s: float) -> tuple[Claim, ...]:
        """All the claims that stand, by owner and claimant."""
        self._heard = {key: one for key, one in self._heard.items() if now_s - one[0] <= STANDS_S}
        every = {(one.owner, one.claimant): one for one in self._between.standing(now_s)}
        for key, (_, one) in self._heard.items():
            every[key] = _joint(one, every[key]) if key in every else one
        return tuple(every[key] for key in sorted(every))


def _joint(a: Claim, b: Claim) -> Claim:
    robots = tuple(dict.fromkeys((*a.robots, *b.robots)))[: ownership_claims.NAMED_ROBOTS]
    return Claim(a.owner, a.claimant, robots, max(a.claimed, b.claimed, len(robots)), min(a.since_s, b.since_s))
