"""What is not of one place, judged over all floors by one engine for all: queues, deadlocks, blockages and claims."""

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from deconflict.advice.async_answers import AsyncAnswers, Submit, answer_at_once
from deconflict.advice.burden import Burden
from deconflict.advice.priorities import Priorities
from deconflict.advisories.advisory_counts import count_by_severity, count_revisions, set_open_count
from deconflict.advisories.finding_lifecycle import FindingAdvisory
from deconflict.advisory import ClaimAdvisory
from deconflict.cluster.judging.cross_ingest_claims import Doubts
from deconflict.cluster.tiles.channels import Floors, late
from deconflict.contention.contention import Contention
from deconflict.contention.queues.queue_advice import Advising
from deconflict.engine.claim_lifecycle import ClaimLifecycle
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.foresight.presence.presence import Presence
from deconflict.foresight.presence.presence_batches import contention_batches
from deconflict.runtime.learned_state import Part
from deconflict.settings.site import Site
from ingest.batch import Batch
from ingest.measures.measures import Measures

REMEMBERED = 10_000
"""Of so many advisories it is known which revision was told last."""


class Commons:
    """Pure: the batches of every ingest in, revisions out, by the same rules as in the engine of one machine."""

    def __init__(
        self,
        site: Site,
        restored: Iterable[FindingAdvisory] = (),
        submit: Submit = answer_at_once,
        learned: Mapping[str, Part] | None = None,
    ) -> None:
        """`learned` is what an earlier one's `learned()` told. Raises `UnreadableError` where it can't be that."""
        self.site, self.measures = site, Measures()
        self._live, self._floors = LiveRobots(), Floors()
        self._presence = Presence(self._live, self.measures)
        self._arrived_s: dict[str, float] = {}
        """When the newest status of each robot arrived."""
        self._account, self._aside, priorities = Burden(), AsyncAnswers(submit), Priorities(site.vendors)

        def priority(uuid: str) -> float:
            one = self._live.robots[uuid]
            return priorities.of(one.vendor, one.model)

        restored = tuple(restored)
        advising = partial(
            Advising,
            account=self._account,
            effort=site.advice.effort,
            submit=self._aside.submit,
            priority=priority,
            measures=self.measures,
        )
        queues = [one for one in restored if not isinstance(one, ClaimAdvisory)]
        self._contention = Contention(site.resources, site.zones, site.contention, self.measures, queues, advising)
        self._claims = ClaimLifecycle(self._live, [one for one in restored if isinstance(one, ClaimAdvisory)])
        self._doubts = Doubts()
        self._revisions = OrderedDict((one.id, one.revision) for one in restored)
        """The last revision of each advisory that was told."""
        if learned:
            self._contention.resume(learned)
            self._presence.resume(learned)

    def open(self) -> list[FindingAdvisory]:
        return [*self._contention.open(), *self._claims.open()]

    def learned(self) -> dict[str, Part]:
        """What is worth keeping for who watches next."""
        return self._contention.learned() | self._presence.learned()

    def presence(self, now_s: float) -> dict[str, Any]:
        """Who is still there, for people."""
        return self._presence.document(now_s)

    def receive(self, batches: Sequence[Batch]) -> None:
        """Take in batches of any ingest, of each in the order of its ticks."""
        for one in map(self._floors.renumbered, batches):
            newer = one.take(np.flatnonzero(~late(one, self._arrived_s)))
            batch = self._presence.receive(newer.take(self._doubts.owned(newer), self._gone(one)))
            self._doubts.stand(one.claims, one.now_s)
            self._arrived_s.update(zip(batch.robots, batch.arrival_s.tolist(), strict=True))
            self._live.update(batch)
            self._live.remove(batch.gone)
            self._doubts.forget(batch.gone)
            self._contention.receive(batch)

    def _gone(self, batch: Batch) -> tuple[str, ...]:
        """The robots that one ingest forgot and nobody has heard of since."""
        kept_s = self.site.reading.forget_after_s
        gone = [uuid for uuid in batch.gone if batch.now_s - self._arrived_s.get(uuid, batch.now_s) > kept_s]
        for uuid in gone:
            del self._arrived_s[uuid]
        return tuple(gone)

    def step(self, now_s: float) -> list[FindingAdvisory]:
        """The revisions of this look; none between looks."""
        self._aside.settle(self._aside.pending())
        for batch in contention_batches(self._live, self._presence.advance(now_s), now_s):
            self._contention.receive(batch)
        self._claims.receive(self._doubts.standing(now_s))
        revisions = [*self._contention.step(now_s), *self._claims.step(now_s)]
        self._account.charge(revisions)
        count_revisions(self.measures, revisions)
        set_open_count(self.measures, count_by_severity(self.open()))
        for one in revisions:
            self._remember(one)
        return revisions

    def hear(self, told: FindingAdvisory, *, overruled: bool = False) -> None:
        """Take in a revision that was told, its own too; `overruled` where another's stands in place of its own."""
        if told.revision <= self._revisions.get(told.id, 0) and not overruled:
            return
        self._remember(told)
        (self._claims if isinstance(told, ClaimAdvisory) else self._contention).adopt(told)

    def _remember(self, told: FindingAdvisory) -> None:
        self._revisions[told.id] = told.revision
        self._revisions.move_to_end(told.id)
        if len(self._revisions) > REMEMBERED:
            self._revisions.popitem(last=False)
