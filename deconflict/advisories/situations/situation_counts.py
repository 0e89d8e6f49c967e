"""Metrics of situations: how many are open, and how many revisions there were."""

from collections import Counter
from collections.abc import Iterable

from deconflict_client.advisory import AdvisoryState
from deconflict_client.situations import Situation
from ingest.measures.measures import Measures

SITUATION_FAILURES = "deconflict_situation_failures_total"


def count_situations(measures: Measures, revisions: Iterable[Situation]) -> None:
    """Count revisions by kind and state."""
    for revision in revisions:
        event = AdvisoryState(revision.state).value
        measures.count("deconflict_situations_total", revision.situation_kind, event)


def set_open_situations(measures: Measures, situations: Iterable[Situation]) -> None:
    """Set how many situations are open, by kind and severity."""
    counts = Counter[tuple[str, ...]]((each.situation_kind, each.severity.value) for each in situations)
    measures.level("deconflict_situations_open", {labels: float(count) for labels, count in counts.items()})
