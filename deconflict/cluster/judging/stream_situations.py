"""The situations of a cluster. The engine that runs the global judge owns all of them."""

from collections.abc import Sequence

from deconflict.advisories.situations.situation_publisher import SituationPublisher
from deconflict.engine.place_names import PlaceNames
from deconflict.settings.site import Site
from deconflict_client.advisory import AdvisoryState
from deconflict_client.situations import AnyRevision, Situation, advisories_of, situations_of
from ingest.measures.measures import Measures


class StreamSituations:
    """Pure: takes in what the stream has, gives revisions of situations."""

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
