"""The situations of a machine: made of what each pass of the engine publishes, once that is published.

No advisory waits for the situations of its pass: machines act on advisories at once, and people look at situations. The
advisories of the next pass wait until these situations are published. So situations are those of a replay, and no more
than one pass behind.
"""

import asyncio
import logging
from collections.abc import Iterable, Sequence

from deconflict.advisories.situations.people_last import PeopleLast
from deconflict.advisories.situations.situation_counts import SITUATION_FAILURES
from deconflict.advisories.situations.situation_publisher import SituationPublisher
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store, StoreError
from deconflict.roles.engine_link.restoration import open_revisions
from deconflict.settings.site import Site
from deconflict_client.advisory import AnyAdvisory
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import AnyRevision, Situation, advice_of, advisories_of

log = logging.getLogger(__name__)


class LiveSituations:
    """Publishes passes of the engine and its advice, and the situations that follow.

    Belongs to the event loop that publishes.
    """

    def __init__(self, site: Site, store: Store, publisher: Publisher) -> None:
        self._store, self._publisher = store, publisher
        self._people = PeopleLast()
        self._situations = SituationPublisher(PlaceNames.of(site).describe, self._people)
        self._is_restored = False
        """Whether it continues what the store had open. The store is read before the first pass."""
        self._advisories: list[AnyAdvisory] = []
        """Published revisions of a pass that is not complete."""
        self._requests: list[RobotAdvice] = []
        """Published revisions of what is asked of robots, and answers to it, since the last complete pass."""
        publisher.heard_answer = self._hear_answer
        self._unpublished: list[Situation] = []
        """Revisions that the store has not taken."""
        self._publishing = asyncio.Lock()
        self._following: asyncio.Task[None] | None = None
        """Publishes the situations of the newest pass."""

    async def renew(self, site: Site) -> None:
        """Name places by a changed site."""
        names = await asyncio.to_thread(PlaceNames.of, site)
        await self.settled()
        self._situations.renew(names.describe)

    async def publish(self, revisions: Iterable[AnyRevision]) -> None:
        """Publish revisions of advisories and of advice, with the ids of their situations.

        Raises `StoreError` if the store takes nothing; then the call is to be made again.
        """
        async with self._publishing:  # after a time-out the engine sends a parcel again, beside the first call
            await self.settled()
            await self._restore()
            revisions = list(revisions)
            advisories = advisories_of(revisions)
            if advice := advice_of(revisions):
                self._requests += advice_of(await self._publisher.publish(self._situations.stamped_advice(advice)))
            if advisories:
                await self._publisher.publish(self._situations.stamped(advisories))
            self._advisories += advisories

    def follow(self, passes_s: Sequence[float]) -> None:
        """Begin to make the situations that follow from the revisions published since the last call.

        `passes_s` are the times of the passes since then, in their order. The revisions are of the last pass; the
        passes before it decided nothing. Without any time the pass is not complete, and this waits for the rest of it.
        """
        if passes_s:
            of_pass, self._advisories = self._advisories, []
            requests, self._requests = self._requests, []
            self._following = asyncio.create_task(self._follow(self._following, of_pass, requests, passes_s))

    def _hear_answer(self, answered: AnyRevision) -> None:
        self._requests += advice_of([answered])

    async def _restore(self) -> None:
        if not self._is_restored:
            revisions = await asyncio.to_thread(open_revisions, self._store, self._publisher.set_asides)
            self._situations.restore(revisions)
            self._requests = [*advice_of(revisions), *self._requests]
            self._is_restored = True

    async def settled(self) -> None:
        """Wait until the situations of all passes so far are published, or can't be for now."""
        if self._following:
            await asyncio.wait({self._following})  # unlike `await`, this cancels no task if the caller is cancelled

    async def _follow(
        self,
        before: asyncio.Task[None] | None,
        advisories: Sequence[AnyAdvisory],
        requests: Sequence[RobotAdvice],
        passes_s: Sequence[float],
    ) -> None:
        if before:
            await asyncio.wait({before})
        try:
            self._unpublished += await asyncio.to_thread(self._made, advisories, requests, passes_s)
            if self._unpublished:
                await self._publisher.publish(self._unpublished)
        except StoreError as error:
            log.warning("%d revisions of situations are not taken yet: %s", len(self._unpublished), error)
            return
        except Exception as error:
            log.exception("situations can't be published, which should be reported")
            self._publisher.measures.count(SITUATION_FAILURES)
            for each in self._unpublished:
                self._publisher.set_asides.add("unwritable", f"{each.id}, revision {each.revision}", error)
        self._unpublished = []

    def _made(
        self, advisories: Sequence[AnyAdvisory], requests: Sequence[RobotAdvice], passes_s: Sequence[float]
    ) -> list[Situation]:
        measures, (*quiet_s, last_s) = self._publisher.measures, passes_s
        self._people.take(requests, last_s)
        made = [each for now_s in quiet_s for each in self._situations.revise(now_s, [], measures)]
        return made + self._situations.revise(last_s, advisories, measures)
