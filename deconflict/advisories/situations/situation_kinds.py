"""What is going on in a situation: its kind, by the advisories in it. Pure."""

from collections import Counter
from collections.abc import Sequence

from deconflict.advisories.situations.advice.stakes import cost_of
from deconflict.advisories.words.situation_words import Matter
from deconflict_client.advisory import AnyAdvisory, BlockageAdvisory, ConflictAdvisory, EncounterClass, SituationKind

KIND_OF: dict[str, SituationKind] = {
    "contention": "queue",
    "double_occupancy": "queue",
    "deadlock": "deadlock",
    "blockage": "blocked_aisle",
    "foreign_claim": "identity",
    "two_places": "identity",
    "crowd": "crowd",
}
"""By the kind of an advisory that is not a conflict."""
SILENT = "(silent)"
CLEARLY = 1.5
"""A situation changes its kind only if the other kind costs so many times as much."""


def matter_of(
    advisories: Sequence[AnyAdvisory], kind_before: SituationKind | None = None, asking: AnyAdvisory | None = None
) -> Matter:
    """What the advisory is about that is `asking` people for something; without it, the advisories that cost most.
    Of equal ones that is the oldest, so that it stays the same.

    Conflicts count together. What was of `kind_before` stays so unless the other costs `CLEARLY` more.
    """
    conflicts = [advisory for advisory in advisories if isinstance(advisory, ConflictAdvisory)]
    if isinstance(asking, ConflictAdvisory):
        return _matter_of_conflicts(conflicts, asking)
    if asking is not None:
        return _matter_of_other(asking)
    others = [advisory for advisory in advisories if not isinstance(advisory, ConflictAdvisory)]
    dearest = min(others, key=lambda advisory: (-_weight(advisory, kind_before), advisory.id), default=None)
    if dearest is None:
        return _matter_of_conflicts(conflicts)
    was_conflict = kind_before is not None and kind_before not in KIND_OF.values()
    if sum(map(cost_of, conflicts)) * (CLEARLY if was_conflict else 1.0) > _weight(dearest, kind_before):
        return _matter_of_conflicts(conflicts)
    return _matter_of_other(dearest)


def _matter_of_other(advisory: AnyAdvisory) -> Matter:
    culprit = advisory.blocker if isinstance(advisory, BlockageAdvisory) else None
    return Matter(KIND_OF[advisory.kind], advisory, (advisory,), culprit)


def _weight(advisory: AnyAdvisory, kind_before: SituationKind | None) -> float:
    return cost_of(advisory) * (CLEARLY if KIND_OF[advisory.kind] == kind_before else 1.0)


def _matter_of_conflicts(conflicts: Sequence[ConflictAdvisory], asking: ConflictAdvisory | None = None) -> Matter:
    principal = asking or min(conflicts, key=lambda each: (-cost_of(each), each.predicted_at, each.id))
    culprit = _culprit(conflicts)
    if culprit:
        is_silent = any(basis_of(conflict, culprit).endswith(SILENT) for conflict in conflicts)
        return Matter("silent_robot" if is_silent else "obstacle", principal, tuple(conflicts), culprit)
    if len({robot for conflict in conflicts for robot in conflict.robots}) > 2:
        return Matter("knot", principal, tuple(conflicts), None)
    is_head_on = principal.encounter_class is EncounterClass.HEAD_ON
    return Matter("head_on" if is_head_on else "meeting", principal, tuple(conflicts), None)


def basis_of(conflict: ConflictAdvisory, robot: str) -> str:
    """The basis of a robot's forecast in a conflict; empty if it is not in it."""
    return dict(zip(conflict.robots, conflict.basis, strict=True)).get(robot, "")


def _culprit(conflicts: Sequence[ConflictAdvisory]) -> str | None:
    """The robot that stands or is silent in every conflict."""
    if all(conflict.encounter_class is EncounterClass.STATIONARY_OBSTACLE for conflict in conflicts):
        counts = Counter(robot for conflict in conflicts for robot in conflict.robots)
        common = [robot for robot, count in counts.items() if count == len(conflicts)]
        still = [robot for robot in common if all(stands(conflict, robot) for conflict in conflicts)]
        return min(still, default=None)
    return None


def stands(conflict: ConflictAdvisory, robot: str) -> bool:
    """Whether a robot stands, or is silent, in a conflict."""
    return basis_of(conflict, robot).startswith("stationary") or basis_of(conflict, robot).endswith(SILENT)
