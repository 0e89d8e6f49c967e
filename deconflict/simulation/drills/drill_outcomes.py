"""The outcomes of drills: when each advisory was raised, the advice, its predicted cost and its actual cost."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from deconflict.advice.actions.action_text import action_text
from deconflict.advisories.severity import SEVERITIES
from deconflict.simulation.drills.drill_scripts import Drill, DrillSetup
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, Severity
from deconflict_client.situations import AnyRevision, Situation, is_advisory

CLOSE_S = 3.0
"""The greatest error of a predicted cost that counts as correct."""


@dataclass(slots=True)
class DrillOutcome:
    """The outcome of one drill. The fields are the keys of the JSON output."""

    drill: str
    kind: str
    told: str = ""
    """Summary of the advisory of its kind when it was raised."""
    lead_s: float | None = None
    """Time from then to the predicted event."""
    advised: str = ""
    """Summary of its first revision with advice."""
    asked: str = ""
    """What that advice asks for."""
    passed_on: list[str] = field(default_factory=list)
    """Summary of every advisory, or advice of every situation, that was passed on to robots."""
    promised_s: float = 0.0
    """Total predicted cost of that advice; of situations' advice, the seconds of waiting that it asks for."""
    late_s: float = 0.0
    """Total delay of all its robots against their first plans."""
    worst: str = ""
    """Highest severity of its advisory."""
    ended: str = ""
    """Why its advisory was cleared. Empty while it is open."""
    through: bool = False
    """Whether all its robots have reached their goals."""
    kinds: list[str] = field(default_factory=list)
    """Kinds of all advisories raised about its robots, in order."""

    @property
    def resolved(self) -> bool:
        """Whether its advisory is cleared and all its robots have reached their goals."""
        return bool(self.ended) and self.through

    @property
    def kept(self) -> bool:
        """Whether following the advice ended the conflict at the predicted cost."""
        on_time = abs(self.late_s - self.promised_s) <= CLOSE_S
        return bool(self.lead_s) and self.resolved and bool(self.passed_on) and on_time


class DrillOutcomes:
    """Collects the outcomes of drills from every revision, in order."""

    def __init__(self, drills: Sequence[Drill], setups: Sequence[DrillSetup]) -> None:
        self._stages = setups
        self._all = [DrillOutcome(drill.name, drill.kind) for drill in drills]
        self._of = {
            errand.member.uuid: outcome
            for outcome, setup in zip(self._all, setups, strict=True)
            for errand in setup.errands
        }
        self._first: dict[str, DrillOutcome] = {}
        """By id of the advisory that a drill should cause: its drill's outcome."""

    def add_revision(self, revision: AnyRevision, passed_on_s: float | None) -> None:
        """Add one revision. `passed_on_s` is the cost of what robots were told; None if they were told nothing."""
        outcome = self._of[revision.robots[0]]
        if passed_on_s is not None:
            outcome.passed_on.append(_advised(revision))
            outcome.promised_s += passed_on_s
        if is_advisory(revision):
            self._add_advisory(outcome, revision)

    def _add_advisory(self, outcome: DrillOutcome, advisory: AnyAdvisory) -> None:
        if advisory.state is AdvisoryState.RAISED:
            outcome.kinds.append(advisory.kind)
            if advisory.kind == outcome.kind and outcome.lead_s is None:
                self._first[advisory.id] = outcome
                outcome.told, outcome.lead_s = advisory.summary, advisory.time_to_conflict_s
        if advisory.id in self._first:
            outcome.worst = max(outcome.worst or Severity.CAUTION, advisory.severity, key=SEVERITIES.index)
            outcome.ended = advisory.cleared_because or ""
            advice = advisory.recommendation
            if advice and (advice.holds or advice.slots or advice.actions) and not outcome.advised:
                outcome.advised, outcome.asked = advisory.summary, "; ".join(map(action_text, advice.actions))

    def now(self) -> list[DrillOutcome]:
        """The outcomes so far."""
        for outcome, setup in zip(self._all, self._stages, strict=True):
            outcome.late_s = round(sum(errand.late_s for errand in setup.errands), 1)
            outcome.promised_s = round(outcome.promised_s, 1)
            outcome.through = all(errand.through_s is not None for errand in setup.errands)
        return self._all

    def over(self) -> bool:
        """Whether all robots have reached their goals and every drill's advisory is cleared."""
        return all(outcome.resolved for outcome in self.now())


def documents(outcomes: Sequence[DrillOutcome]) -> list[dict[str, Any]]:
    """The outcomes as JSON documents."""
    return [asdict(outcome) | {"kept": outcome.kept} for outcome in outcomes]


def _advised(revision: AnyRevision) -> str:
    if isinstance(revision, Situation):
        return revision.advice.text if revision.advice else ""
    return revision.summary
