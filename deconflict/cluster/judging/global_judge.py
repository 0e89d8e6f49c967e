"""What is not of one place, judged over all floors by one engine for all: queues, deadlocks, blockages, claims
and crowds.

Some claims on robots each ingest finds, some only show between several ingests. An ingest does not know the robots of
the others. The vendor that reported a robot first owns it.
"""

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from deconflict.advice.deferred_answers import AsyncAnswers, Submit, answer_at_once
from deconflict.advice.vendor_burden import Burden
from deconflict.advisories.advisory_counts import count_by_severity, count_revisions, set_open_count
from deconflict.advisories.finding_lifecycle import FindingAdvisory
from deconflict.cluster.tiles.tile_channels import outdated
from deconflict.contention.contention import Contention
from deconflict.contention.crowds.crowds import Crowds
from deconflict.contention.queues.queue_advice import queue_advice
from deconflict.engine.claim_lifecycle import ClaimLifecycle, JudgedAdvisory
from deconflict.engine.learned.first_learned_format import upgraded
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.foresight.presence.presence import HEARD_GROUND, Presence
from deconflict.foresight.presence.presence_batches import contention_batches, with_end_before
from deconflict.runtime.learned_state import Learner, Part, learned_of, resume_all
from deconflict.settings.site import Site
from ingest.batch import Batch, Claim, Ints
from ingest.fleet.owners import ownership_claims
from ingest.fleet.prediction.forecast_model import Sighting
from ingest.frames.floor_numbers import FloorNumbers
from ingest.measures.measures import Measures
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


REMEMBERED = 10_000
"""Number of advisories whose last revision is remembered."""


class GlobalJudge:
    """Pure: takes in the batches of every ingest, gives revisions, by the rules of the engine on a single machine."""

    def __init__(
        self,
        site: Site,
        restored: Iterable[FindingAdvisory] = (),
        submit: Submit = answer_at_once,
        learned: Mapping[str, Part] | None = None,
    ) -> None:
        """`learned` is what `learned()` of an earlier judge returned; parts that can't be used are set aside."""
        self.site, self.measures = site, Measures()
        self._live, self._floors = LiveRobots(), FloorNumbers(self.measures)
        self._presence = Presence(self._live, self.measures, site)
        self._arrived_s: dict[str, float] = {}
        """When the newest status of each robot arrived."""
        self._burden, self._answers, restored = Burden(), AsyncAnswers(submit), tuple(restored)
        advising = queue_advice(site, self._live, self._burden, self._answers.submit, self.measures)
        findings = [advisory for advisory in restored if not isinstance(advisory, JudgedAdvisory)]
        claims = [advisory for advisory in restored if isinstance(advisory, JudgedAdvisory)]
        self._crowds = Crowds(self._live)
        self._contention = Contention(site, self.measures, findings, advising, self._crowds.numbers, self._live.slots)
        self._claims = ClaimLifecycle(self._live, self._crowds, claims)
        self._cross_ingest_claims = CrossIngestClaims()
        self._revisions = OrderedDict((advisory.id, advisory.revision) for advisory in restored)
        """The last published revision of each advisory."""
        self.set_aside = resume_all(self._learners, upgraded(learned), (HEARD_GROUND,)) if learned else {}
        """The parts of the learned state with which this judge does not go on, each with the reason."""

    def open(self) -> list[FindingAdvisory]:
        return [*self._contention.open(), *self._claims.open()]

    def learned(self) -> dict[str, Part]:
        """The learned state, for the engine that takes over."""
        return learned_of(self._learners)

    @property
    def _learners(self) -> dict[str, Learner]:
        return self._contention.learners | self._presence.learners

    def presence(self, now_s: float) -> dict[str, Any]:
        """Which silent robots are still there, for people."""
        return self._presence.document(now_s)

    def receive(self, batches: Sequence[Batch]) -> None:
        """Take in batches of all ingests; those of one ingest are in the order of its ticks."""
        for received in map(self._floors.renumbered, batches):
            newer = received.take(np.flatnonzero(~outdated(received, self._arrived_s)), received.gone)
            owned_rows = self._cross_ingest_claims.owned_rows(newer)
            rows = owned_rows[newer.examined[owned_rows]]
            left = self._gone(received)
            batch = self._presence.receive(newer.take(rows, left))
            self._cross_ingest_claims.add_reported(received.claims, received.now_s)
            self._arrived_s.update(zip(batch.robots, batch.arrival_s.tolist(), strict=True))
            for part in with_end_before(batch):
                self._live.update(part)
                self._live.remove(part.gone)
                self._contention.receive(part)
            self._cross_ingest_claims.forget(batch.gone)
            self._live.slots.release(sorted(set(left).difference(batch.robots)))

    def _gone(self, batch: Batch) -> tuple[str, ...]:
        """The robots that one ingest has forgotten, and that have reported to no other since; and those that a person
        took off the floor."""
        kept_s, off = self.site.reading.forget_after_s, set(batch.off_floor)
        heard_s = {uuid: self._arrived_s.get(uuid, batch.now_s) for uuid in batch.gone}
        gone = [uuid for uuid, at_s in heard_s.items() if uuid in off or batch.now_s - at_s > kept_s]
        for uuid in gone:
            self._arrived_s.pop(uuid, None)
        return tuple(gone)

    def advance(self, now_s: float) -> list[FindingAdvisory]:
        """The revisions of this pass; none between the passes of contention."""
        self._answers.set_pending(self._answers.pending())
        for batch in contention_batches(self._live, self._presence.advance(now_s), now_s):
            self._contention.receive(batch)
        self._crowds.step(now_s)
        self._claims.receive(self._cross_ingest_claims.standing(now_s))
        revisions = [*self._contention.step(now_s), *self._claims.step(now_s)]
        self._burden.charge(revisions)
        count_revisions(self.measures, revisions)
        set_open_count(self.measures, count_by_severity(self.open()))
        for revision in revisions:
            self._remember(revision)
        return revisions

    def adopt(self, revision: FindingAdvisory, *, overruled: bool = False) -> None:
        """Take in a published revision, which may be its own. `overruled` if it stands in place of its own."""
        if revision.revision <= self._revisions.get(revision.id, 0) and not overruled:
            return
        self._remember(revision)
        (self._claims if isinstance(revision, JudgedAdvisory) else self._contention).adopt(revision)

    def _remember(self, revision: FindingAdvisory) -> None:
        self._revisions[revision.id] = revision.revision
        self._revisions.move_to_end(revision.id)
        if len(self._revisions) > REMEMBERED:
            self._revisions.popitem(last=False)
