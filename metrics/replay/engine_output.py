"""What one clearance's engine says in a replay."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from deconflict.advisory import AnyAdvisory, ConflictAdvisory
from ingest.batch import Floats, Pair
from metrics.scoring.place_scores import Forecast

Published = Sequence[tuple[Pair, float]]
"""Pairs, and the probability of each."""


@dataclass(frozen=True, slots=True)
class Said:
    """What one clearance's engine had to say at one pass."""

    revisions: list[ConflictAdvisory]
    others: Sequence[AnyAdvisory]
    """Revisions of other kinds."""
    raised: Sequence[str]
    """The kinds of the advisories that were raised."""
    probabilities: Published
    """Of getting in each other's way, at the first pass of each second; none at others."""
    contact_probabilities: Published
    """Of coming within the clearance, of the same pairs."""
    bands_m: Floats
    """(n, horizons, bands) radii that its ledger held for the forecasts of the batch."""
    waiting: Sequence[str] = ()
    """Robots that wait as advised."""
    measured: dict[str, Any] | None = None
    """What the engine would tell of itself, where the pass has that of the receiver."""
    places: Forecast | None = None
    """What is said of places, every `EVERY_S`."""
