"""Conflicts that ended while a robot was not heard: in a silence, an outage, or a restart of the engine."""

from collections.abc import Iterator, Set

from deconflict.advisories.live_scene import LiveScene
from deconflict.advisories.watched.watched_pairs import WatchedPair, WatchedPairs
from deconflict.advisories.words.conflict_wording import cleared_as_absent
from deconflict.foresight.conflict_predictions import Predictions
from deconflict.settings.site import Conflict
from deconflict_client.advisory import ClearedCode, ConflictAdvisory
from ingest.batch import Pair


class UnseenEnds:
    """The pairs whose conflicts were to be while a robot of them was not heard, until it is known what became of it."""

    def __init__(self, pairs: WatchedPairs, settings: Conflict) -> None:
        self._pairs, self._settings = pairs, settings
        self._unseen: dict[Pair, ConflictAdvisory] = {}
        """By pair, its advisory as it was when the robot was heard again."""

    def ends(
        self, returned: Set[str], predictions: Predictions, now_s: float, scene: LiveScene
    ) -> list[tuple[WatchedPair, ConflictAdvisory]]:
        """The pairs whose conflicts are over, each with the revision that clears its advisory: one of the two was moved
        by hand; or they are apart, and what is predicted of them is later by more than the time without a prediction
        after which an advisory is cleared. So it is another conflict.

        `returned` are the robots that were not heard for a while before their newest reports. Without a prediction, an
        advisory ends as any other.
        """
        moved = []
        for watched in self._pairs.of_robots(returned):
            found = {uuid: scene.absence(uuid) for uuid in watched.pair}
            absent = {uuid: why for uuid, why in found.items() if why and why.code is ClearedCode.MOVED_BY_HAND}
            if watched.advisory and absent:
                self._pairs.mark_apart(watched)
                self._pairs.forget_looks(watched)
                why = cleared_as_absent(watched.advisory, absent)
                moved.append((watched, watched.advisory.cleared_revision(now_s, *why)))
            elif watched.advisory and watched.advisory.predicted_at.timestamp() < now_s:
                self._unseen[watched.pair] = watched.advisory
        if not self._unseen:
            return moved
        return moved + [
            (watched, cleared_as_apart(self._pairs, watched, advisory, now_s))
            for watched, advisory, row in self._still_unseen({pair: row for row, pair in enumerate(predictions.pairs)})
            if predictions.start_separation_m[row] > self._settings.apart_m
            if predictions.contact_s[row] > advisory.predicted_at.timestamp() + self._settings.clear_after_s
        ]

    def _still_unseen(self, row_of: dict[Pair, int]) -> Iterator[tuple[WatchedPair, ConflictAdvisory, int]]:
        """The predicted pairs of which nothing newer is known, their advisories, and the rows of their predictions."""
        for pair, before in list(self._unseen.items()):
            watched = self._pairs.get(pair)
            advisory = watched.advisory if watched else None
            if advisory is None or advisory.id != before.id or advisory.predicted_at != before.predicted_at:
                del self._unseen[pair]
            elif watched and pair in row_of:
                yield watched, advisory, row_of[pair]


def cleared_as_apart(
    pairs: WatchedPairs, watched: WatchedPair, advisory: ConflictAdvisory, now_s: float
) -> ConflictAdvisory:
    """The revision that clears an advisory whose robots have drawn apart."""
    return advisory.cleared_revision(now_s, ClearedCode.PASSED if pairs.have_met(watched) else ClearedCode.UNPREDICTED)
