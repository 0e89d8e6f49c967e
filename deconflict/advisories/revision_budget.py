"""How many revisions of conflicts are made for two vendors, so that no fleet delays the warnings of others.

Robots of vendors that a source may have invented share one account, see `LiveScene.account`. Only a fleet whose
reports are wrong reaches the budget. What is beyond it waits for the next reports of its robots.
"""

from collections import Counter, defaultdict
from collections.abc import Callable
from math import inf
from typing import NamedTuple

from deconflict.advisories.severity import SEVERITIES
from deconflict.advisories.watched.watched_pairs import WatchedPair
from deconflict.foresight.conflict_predictions import Prediction
from deconflict_client.advisory import Severity
from ingest.batch import Pair

MOST_REVISIONS = 50
"""In one pass, of the conflicts between robots of the same two vendors. Honest robots need far fewer, even if a
thousand of them share a floor."""
REVISIONS_PER_S = 500.0
"""The same in the passes of one second, on average."""


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
    """What is left of the budgets: a token bucket for each two vendors."""

    def __init__(self) -> None:
        self._vendor: Callable[[str], str] = str
        self._left: defaultdict[tuple[str, ...], float] = defaultdict(_whole_budget)
        """By two vendors, those of which something is spent."""
        self._filled_s = -inf
        self.deferred: Counter[str] = Counter()
        """By vendor, how many conflicts the newest pass lets wait."""

    def begin_pass(self, now_s: float, vendor: Callable[[str], str]) -> None:
        """`vendor` gives the vendor of a robot, or the account that it shares with others."""
        more = (now_s - self._filled_s) * REVISIONS_PER_S
        for vendors, left in list(self._left.items()):
            self._left[vendors] = left + more
            if left + more >= MOST_REVISIONS:
                del self._left[vendors]
        self._vendor, self._filled_s, self.deferred = vendor, now_s, Counter()

    def may_exceed(self, revisions: int) -> bool:
        """Whether so many revisions may be more than is left for some two vendors."""
        return revisions > min(self._left.values(), default=MOST_REVISIONS)

    def admits(self, pair: Pair) -> bool:
        """Whether a revision is left for the vendors of a pair; counted as deferred if not."""
        vendors = self._vendors(pair)
        if self._left[vendors] > 0:
            return True
        self.deferred.update(set(vendors))
        return False

    def spend(self, pair: Pair) -> None:
        self._left[self._vendors(pair)] -= 1

    def _vendors(self, pair: Pair) -> tuple[str, ...]:
        return tuple(sorted(map(self._vendor, pair)))


def _whole_budget() -> float:
    return MOST_REVISIONS
