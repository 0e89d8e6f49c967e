"""A floor whose engine asks robots, and the situations that people see of it, as the service makes them."""

from dataclasses import dataclass, field

from deconflict.operator.store.publisher import Publisher
from deconflict.operator.store.store import Store
from deconflict.roles.engine_link.live_situations import LiveSituations
from deconflict_client.advisory import Acknowledgement, moment
from deconflict_client.situations import Situation, situations_of
from ingest.measures.measures import Measures
from tests.deconflict.adviser.advised_floor import AdvisedFloor
from tests.deconflict.adviser.floors import START_S


@dataclass
class ToldFloor:
    """The floor and the store, second by second. Vendors answer over the store."""

    floor: AdvisedFloor
    store: Store
    situations: list[Situation] = field(default_factory=list)
    """Every revision."""

    def __post_init__(self) -> None:
        self._publisher = Publisher(self.store, Measures())
        self._live = LiveSituations(self.floor.site, self.store, self._publisher)

    async def run(self, seconds: int) -> "ToldFloor":
        for _ in range(seconds):
            asked = len(self.floor.revisions)
            self.floor.run(1)
            await self._live.publish(self.floor.advisories)
            self._live.follow([self.floor.now_s])
            await self._live.publish(self.floor.revisions[asked:])
            for answered in self.floor.answers:
                answer = Acknowledgement(name="", reason=answered.why, at=moment(0), answer=answered.answer)
                await self._publisher.acknowledge(answered.advice_id, answer)
        await self._live.settled()
        self.situations = situations_of(self.store.after(0, -1))
        return self

    def asking(self) -> list[tuple[float, str]]:
        """When people were asked for something new, and for what."""
        asked, before = list[tuple[float, str]](), set[str]()
        for each in self.situations:
            if not each.advice or not each.advice.for_people:
                before.discard(each.id)
            elif each.id not in before:
                before.add(each.id)
                asked.append((each.updated_at.timestamp() - START_S, each.advice.text))
        return asked
