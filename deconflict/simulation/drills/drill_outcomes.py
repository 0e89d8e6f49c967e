"""What comes of drills: when each was told of, what was advised, what that was to cost and what it cost."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from deconflict.advisories.revision_rules import SEVERITIES
from deconflict.advisory import AdvisoryState, AnyAdvisory, Severity
from deconflict.simulation.drills.drill_scripts import Drill, Stage

CLOSE_S = 3.0
"""A promise is kept that is off by no more than this."""


@dataclass(slots=True)
class Outcome:
    """Of one drill."""

    drill: str
    kind: str
    told: str = ""
    """The advisory of its kind, as it was raised."""
    lead_s: float | None = None
    """From then to what it warns of."""
    advised: str = ""
    """The first revision of it that carries advice."""
    passed_on: list[str] = field(default_factory=list)
    """Of every advisory of which robots were told what it advises."""
    promised_s: float = 0.0
    """What that advice was to cost in all."""
    late_s: float = 0.0
    """By how much all its robots together were later than they meant to be at first."""
    worst: str = ""
    """The highest severity of its advisory."""
    ended: str = ""
    """Why its advisory was cleared; empty while it is open."""
    through: bool = False
    """Whether all its robots are where they meant to go."""
    kinds: list[str] = field(default_factory=list)
    """Of all that was raised of its robots, in order."""

    @property
    def kept(self) -> bool:
        """Whether following the advice ended it at the promised cost."""
        on_time = abs(self.late_s - self.promised_s) <= CLOSE_S
        return bool(self.lead_s) and bool(self.ended) and self.through and bool(self.passed_on) and on_time


class Outcomes:
    """Takes in every revision, in order."""

    def __init__(self, drills: Sequence[Drill], stages: Sequence[Stage]) -> None:
        self._stages = stages
        self._all = [Outcome(one.name, one.kind) for one in drills]
        self._of = {
            errand.member.uuid: outcome
            for outcome, stage in zip(self._all, stages, strict=True)
            for errand in stage.errands
        }
        self._first: dict[str, Outcome] = {}
        """By id, the advisory that a drill is about."""

    def take(self, advisory: AnyAdvisory, *, passed_on: bool) -> None:
        """One revision, and whether robots were told what it advises."""
        one = self._of[advisory.robots[0]]
        if advisory.state is AdvisoryState.RAISED:
            one.kinds.append(advisory.kind)
            if advisory.kind == one.kind and one.lead_s is None:
                self._first[advisory.id] = one
                one.told, one.lead_s = advisory.summary, advisory.time_to_conflict_s
        if advisory.id in self._first:
            one.worst = max(one.worst or Severity.CAUTION, advisory.severity, key=SEVERITIES.index)
            one.ended = advisory.cleared_because or ""
            one.advised = one.advised or (advisory.summary if advisory.recommendation else "")
        if passed_on and advisory.recommendation:
            one.passed_on.append(advisory.summary)
            one.promised_s += advisory.recommendation.cost_s

    def now(self) -> list[Outcome]:
        """As things stand."""
        for one, stage in zip(self._all, self._stages, strict=True):
            one.late_s = round(sum(errand.late_s for errand in stage.errands), 1)
            one.promised_s = round(one.promised_s, 1)
            one.through = all(errand.through_s is not None for errand in stage.errands)
        return self._all

    def over(self) -> bool:
        """Whether all robots are through and every drill's advisory is cleared."""
        return all(one.through and one.ended for one in self.now())


def documents(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """As JSON tells them."""
    return [asdict(one) | {"kept": one.kept} for one in outcomes]
