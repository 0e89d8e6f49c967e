"""The output of the engine of one clearance at one pass of a replay."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from deconflict.operator.ledger.loss_ledger import LedgerEntry
from deconflict_client.advisory import AnyAdvisory, ConflictAdvisory
from deconflict_client.situations import Situation
from ingest.batch import Floats, Pair
from metrics.scoring.place_scores import PlaceForecast

PairProbabilities = Sequence[tuple[Pair, float]]
"""Pairs, each with its probability."""


@dataclass(frozen=True, slots=True)
class EngineOutput:
    """The output of one engine at one pass."""

    advisories: Sequence[AnyAdvisory]
    """Revisions of advisories with their situations, as the live stream publishes them."""
    probabilities: PairProbabilities
    """Probability that a pair gets in each other's way. Empty except at the first pass of each second."""
    contact_probabilities: PairProbabilities
    """Probability that the same pairs come within the clearance."""
    bands_m: Floats
    """(n, horizons, bands) error radii that the engine's ledger holds for the forecasts of the batch."""
    waiting: Sequence[str | Pair] = ()
    """Robots that wait as advised, and pairs of which one robot does what it was asked for the other."""
    measures: dict[str, Any] | None = None
    """The engine's measures. None if the pass has no measures of the receiver."""
    place_forecast: PlaceForecast | None = None
    """The forecast for shared places. None except once every `EVERY_S`."""
    situations: Sequence[Situation] = ()
    """Revisions of situations."""
    losses: Sequence[LedgerEntry] = ()
    """Losses that ended."""

    def conflicts(self) -> list[ConflictAdvisory]:
        return [revision for revision in self.advisories if isinstance(revision, ConflictAdvisory)]
