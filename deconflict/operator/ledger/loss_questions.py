"""Questions about lost time, and their answers with costs."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from deconflict_client.answers.loss_models import LossKey, LossList, LossRow

HOUR_S, DAY_S = 3600, 86400
CELL_M = 2.0
OF_LOSSES = "losses", "lost_s", "over_usual_s", "sure_s", "warned_s", "advised_s", "heeded_s"
OF_REFUSALS = "refusals", "refused_s", "unable", "unable_s"
SUMS = *OF_LOSSES, *OF_REFUSALS
"""What the ledger sums."""
FIGURES = *OF_LOSSES[1:], OF_LOSSES[0], "cost", *OF_REFUSALS
"""In the order in which tables have them."""
LOST = SUMS.index("lost_s")


class LossQuestion(NamedTuple):
    """Which losses are asked for, and by which keys they are summed."""

    from_s: float
    until_s: float
    keys: tuple[LossKey, ...] = ()
    vendor: str | None = None
    by: str | None = None
    kind: str | None = None
    place: str | None = None
    limit: int = 1000


class LossSum(NamedTuple):
    """The losses of robots of one vendor and model."""

    values: tuple[Any, ...]
    """The values of the question's keys; that of `cell` is x and y of its middle in metres."""
    vendor: str
    model: str
    sums: tuple[float, ...]
    """One for each of `SUMS`."""


def hourly_cost(costs: Mapping[str, float], vendor: str, model: str) -> float | None:
    """What an hour of a robot costs: by vendor and model, as "Alder/A100", or else by vendor; None if not known."""
    return costs.get(f"{vendor}/{model}", costs.get(vendor))


def answer(
    question: LossQuestion,
    sums: Iterable[LossSum],
    costs: Mapping[str, float],
    currency: str,
    begun_s: float | None,
) -> LossList:
    """The answer to a question. The first loss of the ledger began at `begun_s`; None if it has no loss."""
    total, sums_of = _Sums(), defaultdict[tuple[Any, ...], _Sums](_Sums)
    for part in sums:
        per_hour = hourly_cost(costs, part.vendor, part.model)
        for each in (total, sums_of[part.values]):
            each.add(part.sums, per_hour)
    found = sorted(sums_of.items(), key=lambda item: -item[1].rounded_lost_s) if question.keys else []
    return LossList(
        from_s=question.from_s,
        until_s=question.until_s,
        begun_s=begun_s,
        currency=currency,
        total=total.row(),
        rows=[each.row(**dict(zip(question.keys, values, strict=True))) for values, each in found[: question.limit]],
        more=len(found) > question.limit,
    )


class _Sums:
    """The sums of some losses, and what they cost."""

    __slots__ = ("cost", "values")

    def __init__(self) -> None:
        self.values: Sequence[float] = (0,) * len(SUMS)
        """One for each of `SUMS`."""
        self.cost: float | None = None

    def add(self, values: Sequence[float], per_hour: float | None) -> None:
        """Add losses of robots that cost so much each hour, if that is known."""
        self.values = [value + more for value, more in zip(self.values, values, strict=True)]
        if per_hour is not None:
            self.cost = (self.cost or 0.0) + per_hour * values[LOST] / HOUR_S

    @property
    def rounded_lost_s(self) -> float:
        return round(self.values[LOST], 1)

    def row(self, **keys: Any) -> LossRow:
        figures = {name: round(value, 1) for name, value in zip(SUMS, self.values, strict=True)}
        return LossRow(**figures, cost=None if self.cost is None else round(self.cost, 2), **keys)
