"""The numbers of encounters: none is given twice to a pair, and only so many pairs are known.

Of forgotten pairs the highest number of all is kept. A pair that is not known goes on above it.
"""

from collections.abc import Mapping
from itertools import islice

from ingest.batch import Pair

FORGOTTEN: Pair = ("", "*")
"""What has the highest number of all forgotten pairs, as if it were a pair."""
MOST_PAIRS = 100_000
"""Pairs whose numbers are known, a quarter of a kilobyte each."""
SHARE = 100
"""One pair of so many is forgotten at once."""


class EncounterNumbers(dict[Pair, int]):
    """The last number of each pair, those with the newest encounters last."""

    def __init__(self, known: Mapping[Pair, int]) -> None:
        super().__init__(known)
        self._forget_surplus()

    def next(self, pair: Pair) -> int:
        """The number of the encounter of a pair that begins now."""
        self.note(pair, (self[pair] if pair in self else self.get(FORGOTTEN, 0)) + 1)
        return self[pair]

    def note(self, pair: Pair, number: int) -> None:
        """A pair has had an encounter with this number."""
        self[pair] = max(number, self.pop(pair, 0))
        self._forget_surplus()

    def take(self, known: Mapping[Pair, int]) -> None:
        """Go on from these numbers."""
        self.update(known)
        self._forget_surplus()

    def _forget_surplus(self) -> None:
        while len(self) > MOST_PAIRS:
            for pair in list(islice(self, len(self) - MOST_PAIRS + MOST_PAIRS // SHARE)):
                self[FORGOTTEN] = max(self.pop(pair), self.get(FORGOTTEN, 0))
