"""Batches that wait to be taken in together, where nobody asks in between: ten robots cost nearly as much as fifty."""

from typing import NamedTuple

import numpy as np

from ingest.batch import Batch, Floats

ENOUGH = 128
"""Robots that a live engine takes in at once: more save hardly anything, and would make one pass wait for them."""


class Gathered(NamedTuple):
    """Batches as one, robots in the order in which they came; one that came twice is there twice."""

    batch: Batch
    now_s: Floats
    """(n,) tick of the batch that each robot came in."""


class Gathering:
    """Batches in the order of their ticks. How they are cut changes no robot, nor when each was heard or gone."""

    def __init__(self, enough: int = ENOUGH) -> None:
        """`enough` robots are taken in at once."""
        self._enough = enough
        self._waiting: list[Batch] = []

    def put(self, batch: Batch) -> list[Gathered]:
        """What is to be taken in now, in order: all up to a batch in which robots are gone, or enough of them."""
        due = self.rest() if self._waiting and not _goes_on(self._waiting[-1], batch) else []
        self._waiting.append(batch)
        if batch.gone or sum(map(len, self._waiting)) >= self._enough:
            due += self.rest()
        return due

    def rest(self) -> list[Gathered]:
        """What waits still: nothing or one."""
        waiting, self._waiting = self._waiting, []
        if not waiting:
            return []
        now_s = np.repeat([one.now_s for one in waiting], [len(one) for one in waiting])
        return [Gathered(Batch.joined(waiting), now_s)]


def _goes_on(before: Batch, after: Batch) -> bool:
    """Whether both number floors alike."""
    return after.floors[: len(before.floors)] == before.floors
