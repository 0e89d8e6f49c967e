"""Rules for places: a dock too few, an aisle that should be one-way, crossings where one vendor should go first."""

from collections import Counter
from collections.abc import Collection, Iterable
from math import hypot, inf, sqrt

from deconflict.operator.suggestions.evidence import CellLoss, LossEvidence, PairLoss, PlaceKey
from deconflict.operator.suggestions.suggested_places import ServedPlace, SuggestedPlaces
from deconflict.operator.suggestions.suggestion import minutes, minutes_between, whatif_command
from deconflict_client.answers.suggestion_models import Saving, Suggestion, SuggestionEvidence

LEAST_S = 100.0
"""Fewer lost seconds are no evidence, however short the span is."""
LEAST_LOSSES = 6
LEAST_S_PER_HOUR = 240.0
"""What costs less is not worth a change."""
LEAST_SHARE = 0.1
"""Of all lost time."""
STEADY_SHARE, STEADY_FROM_HOURS = 0.5, 3
"""In so many of the hours at least half of the mean is lost there. With fewer hours nobody knows."""

QUEUES, MEETINGS, CROSSINGS = ("queue", "blockage"), ("head_on", "deadlock"), ("crossing",)
NEAR_DOCK_M = 10.0
QUEUES_OF_NEAR = 0.5
"""Least share of what is lost near a dock."""
LEAST_WAIT_S = 6.0
"""Mean loss near a dock. Robots that only pass each other lose less."""
MEETINGS_OF_AISLE = 0.4
CROSSINGS_OF_ALL = 0.25
DOCK_SAVES, ONE_WAY_SAVES, PRIORITY_SAVES = (0.4, 1.0), (0.4, 1.0), (0.0, 0.4)
"""Shares of what is lost that the change saves, as measured on simulated floors."""
CHANCE = 1.96
"""Standard errors of what is usually lost, each way. The usual loss is in 95 % of such ranges."""


def dock_suggestions(evidence: LossEvidence, places: SuggestedPlaces) -> Iterable[Suggestion]:
    """For each group of docks with a queue at most one more dock."""
    near: dict[str, list[tuple[ServedPlace, CellLoss]]] = {}
    for cell in evidence.cells:
        if place := nearest_served(cell, places.served):
            near.setdefault(place.group, []).append((place, cell))
    for found in near.values():
        queues = [(place, cell) for place, cell in found if cell.kind in QUEUES]
        cells = [cell for _, cell in queues]
        figures = evidence.of_cells(cells, pairs_of(evidence, cells, QUEUES))
        near_s = sum(cell.lost_s for _, cell in found)
        lost_s = sum(cell.lost_s for cell in cells)
        waits = lost_s >= LEAST_WAIT_S * max(figures.losses, 1) and lost_s >= QUEUES_OF_NEAR * near_s
        if waits and is_enough(figures) and is_steady(evidence, {cell.key for cell in cells}):
            sums = Counter[ServedPlace]()
            for place, cell in queues:
                sums[place] += cell.lost_s  # type: ignore[assignment]
            yield _dock(sums.most_common(1)[0][0], figures)


def _dock(place: ServedPlace, figures: SuggestionEvidence) -> Suggestion:
    saving = saving_of(figures, DOCK_SAVES)
    text = (
        f"Add a {place.kind} beside {place.name}: robots that wait there lose {rate(figures)}, and one more would save "
        f"{saved(saving)}."
    )
    command = whatif_command("--dock", place.name)
    return Suggestion(kind="dock", place=place.name, text=text, evidence=figures, saving=saving, check=command)


def one_way_suggestions(evidence: LossEvidence, places: SuggestedPlaces) -> Iterable[Suggestion]:
    """Robots lose time head-on only where they drive in both directions."""
    for key in sorted(places.aisles):
        cells = [cell for cell in evidence.cells if cell.key == key]
        met = [cell for cell in cells if cell.kind in MEETINGS]
        figures = evidence.of_cells(met, pairs_of(evidence, met, MEETINGS))
        share = sum(cell.lost_s for cell in met) / max(sum(cell.lost_s for cell in cells), 1e-9)
        if share >= MEETINGS_OF_AISLE and is_enough(figures) and is_steady(evidence, {key}):
            saving = saving_of(figures, ONE_WAY_SAVES)
            text = (
                f"Make {key.place} one-way, or wider: robots that meet head-on there lose {rate(figures)}, and this "
                f"would save {saved(saving)}."
            )
            command = whatif_command("--one-way", key.place)
            yield Suggestion(kind="one_way", place=key.place, text=text, evidence=figures, saving=saving, check=command)


def priority_suggestions(evidence: LossEvidence, places: SuggestedPlaces) -> Iterable[Suggestion]:
    """The vendor that loses most to others at crossings should go first, if several vendors lose time there."""
    cells = [cell for cell in evidence.cells if cell.kind in CROSSINGS]
    pairs = [pair for pair in evidence.pairs if pair.kind in CROSSINGS and pair.vendor != pair.by]
    robots = [pair for pair in pairs if pair.vendor not in places.people]
    figures = evidence.of_cells(cells, pairs)
    is_clear = figures.share >= CROSSINGS_OF_ALL and is_enough(figures)
    if not (is_clear and robots and is_steady(evidence, {cell.key for cell in cells})):
        return
    by_vendor, by_place = Counter[str](), Counter[str]()
    for pair in robots:
        by_vendor[pair.vendor] += pair.lost_s  # type: ignore[assignment]
    for cell in cells:
        by_place[cell.key.place] += cell.lost_s  # type: ignore[assignment]
    vendor, worst = (sums.most_common(1)[0][0] for sums in (by_vendor, by_place))
    saving, where = saving_of(figures, PRIORITY_SAVES), f", the most in {worst}" if worst else ""
    text = (
        f"Let the robots of {vendor} go first at crossings, or set stop lines for the others: robots lose "
        f"{rate(figures)} while others cross{where}, and this would save {saved(saving)}."
    )
    command = whatif_command("--priority", vendor)
    yield Suggestion(
        kind="priority", place=worst, vendor=vendor, text=text, evidence=figures, saving=saving, check=command
    )


def is_enough(figures: SuggestionEvidence) -> bool:
    """Whether the evidence is not too thin, and the loss worth a change."""
    return (
        figures.losses >= LEAST_LOSSES
        and figures.lost_s_per_hour * figures.hours >= LEAST_S
        and figures.lost_s_per_hour >= LEAST_S_PER_HOUR
        and figures.share >= LEAST_SHARE
    )


def is_steady(evidence: LossEvidence, keys: Collection[PlaceKey]) -> bool:
    """Whether time is lost in these places in many hours, and not in a single jam."""
    found = [evidence.by_hour[key] for key in keys if key in evidence.by_hour]
    hours = [sum(of_hour) for of_hour in zip(*found, strict=True)]
    if len(hours) < STEADY_FROM_HOURS:
        return True
    least_s = sum(hours) / len(hours) / 2
    return sum(lost_s >= least_s for lost_s in hours) >= STEADY_SHARE * len(hours)


def saving_of(figures: SuggestionEvidence, shares: tuple[float, float]) -> Saving:
    """The range of the saving: the shares, of what is usually lost.

    The span has lost more or less than usual by chance. Losses that come at random (Poisson), of lengths that vary
    like those of an exponential distribution, sum up with a relative standard error of `sqrt(2 / losses)`.
    """
    chance = CHANCE * sqrt(2.0 / max(figures.losses, 1))
    low, high = (share * figures.lost_s_per_hour for share in shares)
    return Saving(
        low_s_per_hour=round(max(low * (1.0 - chance), 0.0), 1), high_s_per_hour=round(high * (1.0 + chance), 1)
    )


def rate(figures: SuggestionEvidence) -> str:
    observed = f"; of {minutes(3600 * figures.hours)} only" if figures.hours < 1.0 else ""
    return f"{minutes(figures.lost_s_per_hour)} an hour ({figures.share:.0%} of all lost time{observed})"


def saved(saving: Saving) -> str:
    return f"{minutes_between(saving.low_s_per_hour, saving.high_s_per_hour)} an hour"


def nearest_served(cell: CellLoss, served: Iterable[ServedPlace]) -> ServedPlace | None:
    """The resource near which a loss begins."""
    away_m = [
        (hypot(place.x_m - cell.x_m, place.y_m - cell.y_m), place) for place in served if place.floor == cell.key.floor
    ]
    nearest_m, nearest = min(away_m, default=(inf, None))
    return nearest if nearest_m <= NEAR_DOCK_M else None


def pairs_of(evidence: LossEvidence, cells: Iterable[CellLoss], kinds: Collection[str]) -> list[PairLoss]:
    keys = {cell.key for cell in cells}
    return [pair for pair in evidence.pairs if pair.key in keys and pair.kind in kinds]
