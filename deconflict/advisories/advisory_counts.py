"""How many advisories there are, and how they end, as measures."""

from collections import Counter
from collections.abc import Iterable, Mapping
from operator import attrgetter

from deconflict.advisories.conflict_lifecycle import PASSED, STAND, UNPREDICTED
from deconflict.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory, Severity
from ingest.measures.measures import Measures

OUTCOMES = {PASSED: "met", STAND: "met", UNPREDICTED: "not_met"}
"""By why a conflict was cleared, whether its robots came within the clearance; "left" where one was taken away."""
NEAR_MISSES = "deconflict_near_misses_total"
TALLIED = ("deconflict_advisories_total", "deconflict_advisories_open", "deconflict_conflicts_ended_total")


def by_severity(advisories: Iterable[AnyAdvisory]) -> Counter[tuple[str, Severity]]:
    """How many there are of each kind and severity."""
    return Counter(map(attrgetter("kind", "severity"), advisories))


def tally(measures: Measures, revisions: Iterable[AnyAdvisory]) -> None:
    """Count these revisions, by kind, and how conflicts end."""
    for one in revisions:
        measures.count("deconflict_advisories_total", one.kind, AdvisoryState(one.state).value)
        if isinstance(one, ConflictAdvisory) and one.cleared_because:
            for vendor in sorted(set(one.vendors)):
                outcome = OUTCOMES.get(one.cleared_because, "left")
                measures.count("deconflict_conflicts_ended_total", vendor, outcome)


def tell_open(measures: Measures, open_now: Mapping[tuple[str, Severity], int]) -> None:
    """Bring up to date how many advisories are open, by kind and severity."""
    levels: dict[tuple[str, ...], float] = {
        (kind, severity.value): count for (kind, severity), count in open_now.items()
    }
    measures.level("deconflict_advisories_open", levels)
