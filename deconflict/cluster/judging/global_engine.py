"""Runs the global judge on one engine of the cluster: receives the robots of all ingests, and writes its decisions.

The same engine owns all situations. It groups the advisories of every engine, as the stream has them.

Every engine has a `GlobalEngine`. Only the one that the owner table names is active. When another engine takes over, it
resumes with the open advisories of the stream, receives the last seconds again, and requests all robots.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable, Iterable, Sequence
from contextlib import suppress
from threading import Lock
from typing import Any

from deconflict.advice.deferred_answers import Submit
from deconflict.advisories.finding_lifecycle import FindingAdvisory
from deconflict.advisories.situations.situation_publisher import SituationPublisher
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.cluster.judging.global_judge import GlobalJudge
from deconflict.cluster.judging.outbox import Outbox
from deconflict.cluster.judging.pass_watch import PassWatch
from deconflict.cluster.judging.stream_writer import StreamWriter
from deconflict.cluster.kept_learning import kept_parts, log_set_aside
from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.stream_records import StreamRecord
from deconflict.cluster.nats.subscriptions import BUS_ERRORS
from deconflict.cluster.tiles.tile_channels import EVERY
from deconflict.runtime.learned_state import packed
from deconflict.settings.site import Site
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from deconflict_client.situations import AnyRevision, Situation, advisories_of, situations_of
from ingest.batch import Batch
from ingest.measures.measures import Measures

PASS_EVERY_S = 0.25
LEARNED_NAME = "commons"
"""Name under which the bus keeps the learned state of the judge."""


class StreamSituations:
    """The situations of a cluster. Pure: takes in what the stream has, gives revisions of situations."""

    def __init__(self, site: Site, newest: Sequence[AnyRevision]) -> None:
        """Continues from what is open in the stream."""
        situations = situations_of(newest)
        self._publisher = SituationPublisher(PlaceNames.of(site).describe)
        self._publisher.restore(newest)
        self._decided = {situation.id: situation.revision for situation in situations}
        """The last revision that was decided here, by id of each situation until the stream has it as cleared."""

    def is_overtaken(self, written: Sequence[AnyRevision], overruled: Sequence[AnyRevision]) -> bool:
        """Whether another engine wrote revisions of situations: instead of these, or among those in the stream."""
        decided = self._decided
        others = (each for each in situations_of(written) if each.revision > decided.get(each.id, 0))
        return any(situations_of(overruled)) or any(others)

    def revise(self, now_s: float, written: Sequence[AnyRevision], measures: Measures) -> list[Situation]:
        """The revisions that follow from what was written to the stream."""
        for situation in situations_of(written):
            if situation.state is AdvisoryState.CLEARED:
                self._decided.pop(situation.id, None)
        revisions = self._publisher.revise(now_s, advisories_of(written), measures)
        self._decided.update((revision.id, revision.revision) for revision in revisions)
        return revisions


class GlobalEngine:
    """Only one thread at a time uses the judge."""

    def __init__(self, site: Site, bus: Bus, writer: StreamWriter, submit: Submit, ended_early: str = "") -> None:
        """With `ended_early`, how the engine before ended, judges start without the learned state."""
        self.site, self._bus, self._writer, self._submit, self._ended_early = site, bus, writer, submit, ended_early
        self._judge: GlobalJudge | None = None
        """None while this engine is not the active one."""
        self._situations: StreamSituations | None = None
        """Present whenever the judge is."""
        self._leave: Callable[[], Awaitable[None]] | None = None
        """Ends the subscription to the robots; None without one."""
        self._requested = -1
        """The bus's count of reconnects at the last request for all robots."""
        self._judge_lock = Lock()
        self._parcels: list[bytes] = []
        self._records: list[StreamRecord] = []
        self.outbox, self.watch = Outbox(writer), PassWatch("the global judge")
        self.measures: list[dict[str, Any]] = []
        """As of the last pass."""
        self.presence: dict[str, Any] | None = None
        """Presence of silent robots as of the last pass; None while this engine is not the active one."""

    def add_records(self, records: Sequence[StreamRecord]) -> None:
        """Take in records of the stream, in order."""
        if self._judge:
            self._records += records

    def _add_parcel(self, parcel: bytes) -> None:
        if self._judge:
            self._parcels.append(parcel)

    async def run(self, is_active: Callable[[], bool]) -> None:
        """Run until cancelled. `is_active` is whether the owner table names this engine."""
        inbox = await self._bus.requests.open_inbox(self._add_parcel)
        while True:
            with suppress(*BUS_ERRORS):
                await self._update_role(inbox, active=is_active())
            is_blind = self._bus.connection.is_cut_off()  # it would take all robots for silent
            if self._judge and self._situations and self.outbox.has_room() and not is_blind:
                await self._run_pass(self._judge, self._situations)
            await asyncio.sleep(PASS_EVERY_S)

    async def _update_role(self, inbox: str, *, active: bool) -> None:
        """Create or drop the judge and its subscription. After a reconnect, request all robots again."""
        if not active:
            self._drop_judge()
            if self._leave:
                await self._leave()
                self._leave = None
            return
        if self._judge is None:
            kept = await self._bus.state.kept(LEARNED_NAME)
            self._judge, self._requested = self._restored_judge(findings_of(self._writer.open()), kept), -1
            self._situations = StreamSituations(self.site, self._writer.open())
        elif self._judge.site is not self.site:
            learned = self._judge.learned()
            self._judge, self._requested = GlobalJudge(self.site, self._judge.open(), self._submit, learned), -1
            self._situations = StreamSituations(self.site, self._writer.open())
        if self._leave is None:
            self._leave = await self._bus.follow_channel(EVERY, self._add_parcel)
        if self._requested != (renewals := self._bus.renewals):
            await self._bus.requests.request_robots([EVERY], inbox)
            self._requested = renewals

    def _restored_judge(self, findings: Sequence[FindingAdvisory], kept: bytes | None) -> GlobalJudge:
        """A judge with the open advisories, and with the learned state of the one before."""
        judge = GlobalJudge(self.site, findings, self._submit, kept_parts(LEARNED_NAME, kept, self._ended_early))
        log_set_aside(LEARNED_NAME, judge.set_aside)
        return judge

    async def keep_learned(self) -> None:
        """Keep the learned state for the engine that takes over."""
        if self._judge:
            await self._bus.state.keep(LEARNED_NAME, await asyncio.to_thread(self._learned, self._judge))

    def _learned(self, judge: GlobalJudge) -> bytes:
        with self._judge_lock:
            learned = judge.learned()
        return packed(learned)

    def _drop_judge(self) -> None:
        self._judge = self._situations = self.presence = None
        self.outbox.take_overruled()
        for waiting in (self._parcels, self._records, self.measures):
            waiting.clear()

    async def _run_pass(self, judge: GlobalJudge, situations: StreamSituations) -> None:
        parcels, self._parcels = self._parcels, []
        records, self._records = self._records, []
        written, overruled = revisions_of(records), revisions_of(self.outbox.take_overruled())
        if situations.is_overtaken(written, overruled):
            situations = self._situations = StreamSituations(self.site, self._writer.open())
        with self.watch.passing():
            revisions = await asyncio.to_thread(self._judged, judge, situations, parcels, written, overruled)
        self.measures, self.presence = [judge.measures.as_document()], judge.presence(time.time())
        self.outbox.add_pass((None, revision) for revision in revisions)

    def _judged(
        self,
        judge: GlobalJudge,
        situations: StreamSituations,
        parcels: Sequence[bytes],
        written: Sequence[AnyRevision],
        overruled: Sequence[AnyRevision],
    ) -> list[AnyRevision]:
        with self._judge_lock:
            for group, is_overruled in ((written, False), (overruled, True)):
                for finding in findings_of(group):
                    judge.adopt(finding, overruled=is_overruled)
            judge.receive([Batch.from_bytes(parcel) for parcel in parcels])
            now_s = time.time()
            return [*judge.advance(now_s), *situations.revise(now_s, written, judge.measures)]


def revisions_of(records: Iterable[StreamRecord]) -> list[AnyRevision]:
    """The revisions in records, without the answers."""
    return [record.advisory for record in records if record.advisory]


def findings_of(revisions: Iterable[AnyRevision]) -> list[FindingAdvisory]:
    """The revisions of advisories that have no tile."""
    return [advisory for advisory in advisories_of(revisions) if not isinstance(advisory, ConflictAdvisory)]
