"""Merges batches that can be processed together: ten robots cost nearly as much as fifty."""

from typing import NamedTuple

import numpy as np

from ingest.batch import Batch, Floats

ENOUGH = 128
"""Robots that are processed at once: more save hardly anything, and one pass would have to wait for them."""


class MergedBatch(NamedTuple):
    """Batches as one, robots in the order in which they came; a robot that came twice is in it twice."""

    batch: Batch
    now_s: Floats
    """(n,) time of the batch in which each robot came."""


class BatchMerger:
    """Collects batches in the order of their times.

    How batches are merged changes no robot, nor when each robot was heard or gone.
    """

    def __init__(self, enough: int = ENOUGH) -> None:
        """`enough` robots are processed at once."""
        self._enough = enough
        self._waiting: list[Batch] = []
        self._robots = 0
        """How many robots wait."""

    def add(self, batch: Batch) -> list[MergedBatch]:
        """Add a batch; return what is to be processed now, in order.

        That is all up to a batch in which robots are gone, or once there are enough robots.
        """
        due = self.flush() if self._waiting and not _same_floors(self._waiting[-1], batch) else []
        self._waiting.append(batch)
        self._robots += len(batch)
        if batch.gone or self._robots >= self._enough:
            due += self.flush()
        return due

    def flush(self) -> list[MergedBatch]:
        """All that still waits: none or one."""
        waiting, self._waiting, self._robots = self._waiting, [], 0
        if not waiting:
            return []
        now_s = np.repeat([batch.now_s for batch in waiting], [len(batch) for batch in waiting])
        return [MergedBatch(Batch.joined(waiting), now_s)]


def _same_floors(before: Batch, after: Batch) -> bool:
    """Whether both number their floors in the same way."""
    return after.floors[: len(before.floors)] == before.floors
