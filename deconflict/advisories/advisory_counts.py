"""Metrics of advisories: how many are open, how many revisions there were, and how conflicts ended."""

from collections import Counter
from collections.abc import Iterable, Mapping
from operator import attrgetter

from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ClearedCode, ConflictAdvisory, Severity
from ingest.measures.measures import Measures

OUTCOMES: dict[ClearedCode | None, str] = {
    ClearedCode.PASSED: "met",
    ClearedCode.BOTH_STAND: "met",
    ClearedCode.GAVE_WAY: "gave_way",
    ClearedCode.UNPREDICTED: "not_met",
}
"""By reason of clearing, how a conflict ended; "left" for all other reasons."""
NEAR_MISSES = "deconflict_near_misses_total"
ADVISORY_METRICS = ("deconflict_advisories_total", "deconflict_advisories_open", "deconflict_conflicts_ended_total")
"""What the two functions below that take `measures` write."""


def count_by_severity(advisories: Iterable[AnyAdvisory]) -> Counter[tuple[str, Severity]]:
    """How many advisories there are of each kind and severity."""
    return Counter(map(attrgetter("kind", "severity"), advisories))


def count_revisions(measures: Measures, revisions: Iterable[AnyAdvisory]) -> None:
    """Count revisions by kind and state, and cleared conflicts by vendor and outcome."""
    for revision in revisions:
        measures.count("deconflict_advisories_total", revision.kind, AdvisoryState(revision.state).value)
        if isinstance(revision, ConflictAdvisory) and revision.state is AdvisoryState.CLEARED:
            outcome = OUTCOMES.get(revision.cleared_code, "left")
            for vendor in sorted(set(revision.vendors)):
                measures.count("deconflict_conflicts_ended_total", vendor, outcome)


def set_open_count(measures: Measures, counts: Mapping[tuple[str, Severity], int]) -> None:
    """Set how many advisories are open, by kind and severity."""
    levels: dict[tuple[str, ...], float] = {(kind, severity.value): count for (kind, severity), count in counts.items()}
    measures.level("deconflict_advisories_open", levels)
