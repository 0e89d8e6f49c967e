"""How many situations there were and are: for metrics, a replay, and the summary of a shift."""

from collections import Counter
from collections.abc import Iterable

from deconflict_client.advisory import AdvisoryState, SituationKind
from deconflict_client.situations import Situation
from ingest.measures.measures import Measures

SITUATION_FAILURES = "deconflict_situation_failures_total"


def counted(kinds: Iterable[tuple[str, SituationKind]]) -> Counter[SituationKind]:
    """How many situations there were, by the kind that each had first. `kinds` are ids and kinds, the first of each
    situation first. Every id counts once, whatever became of it."""
    first: dict[str, SituationKind] = {}
    for situation_id, kind in kinds:
        first.setdefault(situation_id, kind)
    return Counter(first.values())


def count_situations(measures: Measures, revisions: Iterable[Situation]) -> None:
    """Count revisions by kind and state: those that were raised as `counted`."""
    made = list(revisions)
    raised = counted((each.id, each.situation_kind) for each in made if each.state is AdvisoryState.RAISED)
    later = Counter((each.situation_kind, each.state) for each in made if each.state is not AdvisoryState.RAISED)
    for kind, count in raised.items():
        measures.count("deconflict_situations_total", kind, AdvisoryState.RAISED.value, by=count)
    for (kind, state), count in later.items():
        measures.count("deconflict_situations_total", kind, AdvisoryState(state).value, by=count)


def set_open_situations(measures: Measures, situations: Iterable[Situation]) -> None:
    """Set how many situations are open, by kind and severity."""
    counts = Counter[tuple[str, ...]]((each.situation_kind, each.severity.value) for each in situations)
    measures.level("deconflict_situations_open", {labels: float(count) for labels, count in counts.items()})
