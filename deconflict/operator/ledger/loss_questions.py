"""Questions about lost time, and their answers with costs."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, Field

LossKey = Literal["vendor", "model", "by", "root", "kind", "floor", "place", "cell", "hour", "day"]
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


class LossRow(BaseModel, extra="allow"):
    """The sum of some losses. Further fields are the keys that were asked for."""

    lost_s: float = Field(description="seconds that robots lost")
    over_usual_s: float = Field(
        description="how much longer these robots needed than their models usually do there; where that is not known, "
        "than planned"
    )
    sure_s: float = Field(description="the part whose cause is sure")
    warned_s: float = Field(description="the part of which an advisory warned at least 2 s before")
    advised_s: float = Field(description="the part of these for which one of the two robots was advised")
    heeded_s: float = Field(description="the part of these for which that robot did as advised")
    losses: int = Field(description="number of losses, or parts of long ones")
    refusals: int = Field(description="advice that robots of `by` refused though they can follow it")
    refused_s: float = Field(description="seconds that robots stood because of these refusals, at most 60 s for each")
    unable: int = Field(description="advice that robots of `by` declined because they cannot")
    unable_s: float = Field(description="the same seconds because of these")
    cost: float | None = Field(description="of the robots whose vendor or model has a cost; null if none has")


class LossList(BaseModel):
    """Lost time. docs/losses.md defines the figures and has their errors."""

    from_s: float = Field(description="the first hour begins then, seconds since the epoch")
    until_s: float = Field(description="the last hour begins before")
    begun_s: float | None = Field(description="the first loss of the ledger began then; null if there is none")
    currency: str
    total: LossRow
    rows: list[LossRow] = Field(description="one for each combination of the keys, the largest first")
    more: bool = Field(description="true if `limit` left some out")


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
