"""How many revisions of conflicts one pass makes for two vendors, so that no fleet delays the warnings of others.

Only a fleet whose reports are wrong reaches the budget. What is beyond it waits for the next reports of its robots.
"""

from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from deconflict.advisories.conflict_predictions import Prediction
from deconflict.advisories.severity import SEVERITIES
from deconflict.advisories.watched.watched_pairs import WatchedPair
from deconflict.advisory import Severity
from ingest.batch import Pair

MOST_REVISIONS = 50
"""In one pass, of the conflicts between robots of the same two vendors. Honest robots need far fewer, even if a
thousand of them share a floor."""


class Candidate(NamedTuple):
    """A prediction that makes a revision if it is news, which depends on how the two will meet."""

    watched: WatchedPair
    prediction: Prediction
    severity: Severity
    is_news: bool
    """It is news wherever the two meet."""

    @property
    def urgency(self) -> tuple[int, float, Pair]:
        """The most urgent one has the lowest."""
        return -SEVERITIES.index(self.severity), self.prediction.contact_s, self.watched.pair


class RevisionBudget:
    """What is left of the budgets of one pass."""

    def __init__(self, vendor: Callable[[str], str]) -> None:
        """`vendor` gives the vendor of a robot."""
        self._vendor = vendor
        self._made: Counter[tuple[str, ...]] = Counter()
        self.deferred: Counter[str] = Counter()
        """By vendor, how many conflicts wait."""

    def admits(self, pair: Pair) -> bool:
        """Whether a revision is left for the vendors of a pair; counted as deferred if not."""
        vendors = self._vendors(pair)
        if self._made[vendors] < MOST_REVISIONS:
            return True
        self.deferred.update(set(vendors))
        return False

    def spend(self, pair: Pair) -> None:
        self._made[self._vendors(pair)] += 1

    def _vendors(self, pair: Pair) -> tuple[str, ...]:
        return tuple(sorted(map(self._vendor, pair)))
