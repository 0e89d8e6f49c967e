"""What suggestions are derived from: sums of the ledger, by place, kind, vendors and hour."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from deconflict.operator.ledger.loss_questions import HOUR_S
from deconflict_client.answers.loss_models import LossKey, LossList, LossRow
from deconflict_client.answers.suggestion_models import PairShare, SuggestionEvidence

CELLS: tuple[LossKey, ...] = ("floor", "place", "cell", "kind")
PAIRS: tuple[LossKey, ...] = ("floor", "place", "kind", "vendor", "by")
HOURS: tuple[LossKey, ...] = ("hour", "floor", "place")
QUESTIONS = (CELLS, PAIRS, HOURS)
"""The keys of the questions whose answers `evidence_of` takes, in this order."""
MOST_PAIRS = 3


class PlaceKey(NamedTuple):
    """A place on a floor, as the ledger names it."""

    floor: str
    place: str


class CellLoss(NamedTuple):
    """Losses of one kind in one cell."""

    key: PlaceKey
    x_m: float
    y_m: float
    kind: str
    lost_s: float
    losses: int


class PairLoss(NamedTuple):
    """Losses of one kind in one place, of robots of one vendor to those of another one."""

    key: PlaceKey
    kind: str
    vendor: str
    by: str
    lost_s: float
    losses: int


class VendorForecasts(NamedTuple):
    """What is known of a vendor's forecasts."""

    robots: int
    grade: str
    """From A to E; "" if not known."""


class Passes(NamedTuple):
    """How often robots of a vendor drove through an aisle."""

    along: int
    against: int


class WarningCounts(NamedTuple):
    """What came of the warnings that a log would have had with a clearance."""

    clearance_m: float
    warnings: int
    in_vain: int
    stops: int
    """How often a robot stopped for another one."""
    seen: int
    """Stops with a warning ahead."""


@dataclass(frozen=True, slots=True, eq=False)
class LossEvidence:
    """The sums of a span."""

    from_s: float
    until_s: float
    hours: float
    """Length of what was observed between these times."""
    lost_s: float
    """All that was lost, also if it is in no cell of the list."""
    cells: list[CellLoss]
    pairs: list[PairLoss]
    by_hour: Mapping[PlaceKey, list[float]]
    """By place, the seconds lost in each whole hour of the ledger that has any loss at all."""
    forecasts: Mapping[str, VendorForecasts] = field(default_factory=dict)
    passes: Mapping[PlaceKey, Mapping[str, Passes]] = field(default_factory=dict)
    """By aisle and vendor; empty where only the ledger is known."""
    warnings: Sequence[WarningCounts] = ()
    """With the clearance of the site first, then with others."""

    def of_cells(self, cells: Collection[CellLoss], pairs: Iterable[PairLoss]) -> SuggestionEvidence:
        """The figures of some cells. `pairs` are those that they belong to."""
        return self._figures(sum(cell.lost_s for cell in cells), sum(cell.losses for cell in cells), pairs)

    def of_pairs(self, pairs: Sequence[PairLoss]) -> SuggestionEvidence:
        return self._figures(sum(pair.lost_s for pair in pairs), sum(pair.losses for pair in pairs), pairs)

    def _figures(self, lost_s: float, losses: int, pairs: Iterable[PairLoss]) -> SuggestionEvidence:
        sums = Counter[tuple[str, str]]()
        for pair in pairs:
            sums[pair.vendor, pair.by] += pair.lost_s  # type: ignore[assignment]
        return SuggestionEvidence(
            lost_s_per_hour=round(lost_s / self.hours, 1),
            share=round(lost_s / max(self.lost_s, 1.0), 3),
            losses=losses,
            hours=round(self.hours, 2),
            from_s=self.from_s,
            until_s=self.until_s,
            pairs=[
                PairShare(vendor=vendor, by=by, lost_s_per_hour=round(seconds / self.hours, 1))
                for (vendor, by), seconds in sums.most_common(MOST_PAIRS)
            ],
        )


def evidence_of(
    answers: Iterable[LossList],
    forecasts: Mapping[str, VendorForecasts] | None = None,
    warnings: Sequence[WarningCounts] = (),
    span_s: float | None = None,
) -> LossEvidence:
    """The evidence from the answers to `QUESTIONS`. Without `span_s` the hours that have any loss were observed, the
    first one of the ledger from its first loss on."""
    by_cell, by_pair, by_hour = answers
    hours = sorted({row["hour"] for row in _rows(by_hour)})
    begun_s = by_hour.begun_s or 0.0
    observed_s = sum(max(0.0, min(by_hour.until_s, hour + HOUR_S) - max(hour, begun_s)) for hour in hours)
    sums: dict[PlaceKey, Counter[int]] = {}
    for row in _rows(by_hour):
        sums.setdefault(_key(row), Counter())[row["hour"]] += row["lost_s"]
    return LossEvidence(
        from_s=max(by_cell.from_s, begun_s) if span_s is None else by_cell.from_s,
        until_s=by_cell.until_s if span_s is None else by_cell.from_s + span_s,
        hours=max(observed_s if span_s is None else span_s, 1.0) / HOUR_S,
        lost_s=by_cell.total.lost_s,
        cells=[
            CellLoss(_key(row), row["cell"][0], row["cell"][1], row["kind"], row["lost_s"], row["losses"])
            for row in _rows(by_cell)
        ],
        pairs=[
            PairLoss(_key(row), row["kind"], row["vendor"], row["by"], row["lost_s"], row["losses"])
            for row in _rows(by_pair)
        ],
        by_hour={key: [float(found[hour]) for hour in hours] for key, found in sums.items()},
        forecasts=forecasts or {},
        warnings=warnings,
    )


def _key(row: Mapping[str, Any]) -> PlaceKey:
    return PlaceKey(row["floor"], row["place"])


def _rows(answer: LossList) -> Iterable[dict[str, Any]]:
    return map(LossRow.model_dump, answer.rows)
