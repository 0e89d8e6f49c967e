"""What is predicted of pairs of robots in one pass: the input to the life of conflict advisories."""

from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from ingest.batch import Bools, Floats, Ints, Pair


class Prediction(NamedTuple):
    """One pair that comes within the clearance by the newest forecasts, or is likely to."""

    pair: Pair
    contact_s: float
    """When the two come within the clearance."""
    separation_m: float
    """The smallest separation."""
    start_separation_m: float
    """The separation now."""
    fresh: bool
    """Whether either robot's forecast is new in this pass."""
    probability: float = 1.0
    """That the two get in each other's way within the horizon."""
    contact_probability: float = 1.0
    """That their envelopes come within the clearance within the horizon."""
    lower: float = 1.0
    """Lower end of the interval that holds the probability with 90 %."""
    upper: float = 1.0
    """Upper end of that interval."""
    deciding: float = 1.0
    """The probability by which advisories are raised and cleared: above `probability` if evidence is thin."""
    still: bool = False
    """Whether both stay where they stand, or one gave way to the other lately."""
    both_present: float = 1.0
    """The probability that both robots are still on the floor."""


class Predictions(NamedTuple):
    """The predictions of one pass, in columns (n,); see `Prediction`."""

    pairs: Sequence[Pair]
    contact_s: Floats
    separation_m: Floats
    start_separation_m: Floats
    fresh: Bools
    probability: Floats
    contact_probability: Floats
    lower: Floats
    upper: Floats
    deciding: Floats
    still: Bools
    both_present: Floats

    def until(self, end_s: float) -> "Predictions":
        """Those of conflicts that begin by `end_s`."""
        return self if end_s == inf else self._of(np.flatnonzero(self.contact_s <= end_s))

    def without(self, left_out: Callable[[Pair], bool]) -> "Predictions":
        """Those of pairs that are not left out."""
        return self._of(np.flatnonzero([not left_out(pair) for pair in self.pairs]))

    def _of(self, rows: Ints) -> "Predictions":
        if len(rows) == len(self.pairs):
            return self
        columns = {name: column[rows] for name, column in self._asdict().items() if name != "pairs"}
        return self._replace(pairs=[self.pairs[row] for row in rows.tolist()], **columns)

    def at(self, rows: Sequence[int]) -> list[Prediction]:
        """The predictions of some rows, in that order."""
        columns = (map(column.item, rows) for column in self[1:])
        return list(map(Prediction._make, zip(map(self.pairs.__getitem__, rows), *columns, strict=True)))
