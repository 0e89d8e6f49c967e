"""What is not of one place, judged over all floors by one engine for all: queues, deadlocks, blockages, claims
and crowds."""

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from deconflict.advice.deferred_answers import AsyncAnswers, Submit, answer_at_once
from deconflict.advice.vendor_burden import Burden
from deconflict.advisories.advisory_counts import count_by_severity, count_revisions, set_open_count
from deconflict.advisories.finding_lifecycle import FindingAdvisory
from deconflict.cluster.judging.cross_ingest_claims import CrossIngestClaims
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
from ingest.batch import Batch
from ingest.frames.floor_numbers import FloorNumbers
from ingest.measures.measures import Measures

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
        self._contention = Contention(site, self.measures, findings, advising, self._crowds.numbers)
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
            batch = self._presence.receive(newer.take(rows, self._gone(received)))
            self._cross_ingest_claims.add_reported(received.claims, received.now_s)
            self._arrived_s.update(zip(batch.robots, batch.arrival_s.tolist(), strict=True))
            for part in with_end_before(batch):
                self._live.update(part)
                self._live.remove(part.gone)
                self._contention.receive(part)
            self._cross_ingest_claims.forget(batch.gone)

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
