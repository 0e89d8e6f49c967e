"""One numbering of floors for all batches that a process receives.

Each batch numbers its floors by itself: two ingests, or a receiver before and after a restart, give one floor different
numbers. Whatever is kept from batch to batch therefore uses this numbering.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ingest.batch import Batch, Ints
from ingest.frames.floor_index import NOWHERE
from ingest.measures.measures import Measures

NOT_LISTED = "floor-not-listed"
"""Reason why a robot is refused: its floor is not in the list of its batch."""


class FloorNumbers:
    """The floors of all batches so far. A floor keeps its number for ever."""

    def __init__(self, measures: Measures) -> None:
        """Refused robots are counted in `measures`."""
        self._measures = measures
        self.names: tuple[str, ...] = ()
        """Floor ids by number."""

    def renumbered(self, batch: Batch) -> Batch:
        """The batch with this numbering, without the robots whose floors it does not list."""
        batch = self._without_unlisted(batch)
        if batch.floors == self.names:
            return batch
        self.names = tuple(dict.fromkeys((*self.names, *batch.floors)))
        if batch.floors == self.names[: len(batch.floors)]:
            return replace(batch, floors=self.names)
        by_name = {name: number for number, name in enumerate(self.names)}
        numbers = np.array([*(by_name[name] for name in batch.floors), NOWHERE])
        return replace(
            batch,
            floors=self.names,
            forecasts=replace(batch.forecasts, floor=numbers[batch.forecasts.floor]),
            destinations=replace(batch.destinations, floor=numbers[batch.destinations.floor]),
        )

    def joined(self, batches: Sequence[Batch]) -> Batch:
        """All the robots of one or more batches, in order, with this numbering, as of the last one's tick."""
        return Batch.joined([self.renumbered(batch) for batch in batches])

    def _without_unlisted(self, batch: Batch) -> Batch:
        parts, floors = (batch.forecasts, batch.destinations), len(batch.floors)
        if all(part.floor.min(initial=NOWHERE) >= NOWHERE and part.floor.max(initial=-1) < floors for part in parts):
            return batch
        is_listed = np.ones(len(batch), np.bool_)
        for part in parts:
            is_listed[_owners(part.start)[(part.floor < NOWHERE) | (part.floor >= floors)]] = False
        self._measures.count("deconflict_invalid_forecasts_total", NOT_LISTED, by=int(np.sum(~is_listed)))
        return batch.take(np.flatnonzero(is_listed), batch.gone)


def _owners(start: Ints) -> Ints:
    """The robot of each row, by `start` (n + 1,), the first row of each robot and the end."""
    return np.repeat(np.arange(len(start) - 1), np.diff(start))
