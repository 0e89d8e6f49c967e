"""Advisories on what is not of two robots: queues, deadlocks, blockages, claims and crowds. And advice."""

from collections.abc import Callable, Iterable, Sequence

from deconflict.adviser.advice_lifecycle import AdviceLifecycle, AnsweredAdvice
from deconflict.advisories.finding_lifecycle import FindingAdvisory
from deconflict.advisories.words.words import Spot
from deconflict.contention.contention import Contention
from deconflict.contention.crowds.crowds import Crowds
from deconflict.contention.queues.queue_advice import QueueAdvice
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.engine.claim_lifecycle import ClaimLifecycle, JudgedAdvisory
from deconflict.engine.load_shedding import Effort
from deconflict.foresight.presence import presence_batches
from deconflict.foresight.presence.live_robots import LiveRobots
from deconflict.foresight.presence.probably_left import PresenceChanges
from deconflict.settings.site import Site
from deconflict_client.advisory import ConflictAdvisory
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import AnyRevision, advice_of, advisories_of
from ingest.batch import Batch, FloorPoint
from ingest.measures.measures import Measures

REDUCED_LOOK_S = 10.0
"""Time between two looks at queues when the engine can't keep up."""


class SharedAdvisories:
    """Contention, claims, crowds and advice of one engine; none of them if a cluster judges them elsewhere."""

    def __init__(
        self,
        site: Site,
        live: LiveRobots,
        crowds: Crowds,
        measures: Measures,
        restored: Iterable[AnyRevision],
        queue_advice: Callable[[PlaceGeometry], QueueAdvice],
        describe: Callable[[Sequence[FloorPoint]], list[Spot]],
        *,
        enabled: bool,
    ) -> None:
        """Without `enabled` nothing is judged, and what is `restored` stays as it is. `describe` names places."""
        self._live, self._enabled, restored = live, enabled, list(restored)
        findings = [advisory for advisory in advisories_of(restored) if not isinstance(advisory, ConflictAdvisory)]
        queues = [advisory for advisory in findings if not isinstance(advisory, JudgedAdvisory)]
        claims = [advisory for advisory in findings if isinstance(advisory, JudgedAdvisory)]
        self.contention = Contention(site, measures, queues, queue_advice, crowds.numbers, live.slots)
        self._claims = ClaimLifecycle(live, crowds, claims)
        self.asked = AdviceLifecycle(site, describe, measures, advice_of(restored), crowds.numbers)
        self._looked_s = float("-inf")

    def open(self) -> list[FindingAdvisory]:
        """The newest revision of every open advisory."""
        return [*self.contention.open(), *self._claims.open()]

    def receive(self, batch: Batch) -> None:
        """Add the robots that changed, and the claims that stand."""
        if self._enabled:
            self.contention.receive(batch)
            self.asked.receive(batch, self.contention.robots)
            self._claims.receive(batch.claims)

    def update_presence(self, changes: PresenceChanges, now_s: float) -> None:
        """Let silent robots want nothing any more once they have probably left."""
        if self._enabled:
            for batch in presence_batches.contention_batches(self._live, changes, now_s):
                self.contention.receive(batch)

    def step(self, now_s: float, effort: Effort) -> list[FindingAdvisory]:
        """The revisions of this pass; most have none, as looks are at least a second apart."""
        if not self._enabled:
            return []
        revisions: list[FindingAdvisory] = []
        if effort < Effort.NEAR or now_s - self._looked_s >= REDUCED_LOOK_S:
            revisions += self.contention.step(now_s)
            self._looked_s = now_s
        return [*revisions, *self._claims.step(now_s)]

    def advise(self, now_s: float, answers: Iterable[AnsweredAdvice], effort: Effort) -> list[RobotAdvice]:
        """What is asked of robots, and what changed of it. The next look of contention tells people of mutual waits."""
        if not self._enabled or effort >= Effort.NEAR:
            return self.withdraw_advice(now_s)
        revisions = self.asked.step(self.contention.robots, now_s, answers)
        self.contention.crossings = self.asked.standoffs.crossings
        return revisions

    def withdraw_advice(self, now_s: float) -> list[RobotAdvice]:
        """The revisions that end all that is asked of robots."""
        return self.asked.withdraw_all(now_s) if self._enabled else []
