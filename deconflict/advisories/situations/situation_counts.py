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


class SituationCounts:
    """Counts revisions by event and by the kind that each situation was raised with, as `counted` does, so that those
    raised and those cleared of one kind can be compared."""

    def __init__(self) -> None:
        self._first: dict[str, SituationKind] = {}
        """The kind that each open situation had first, by id."""

    def restore(self, situations: Iterable[Situation]) -> None:
        """Those open before a restart count by the kind that they have now, as the counter begins anew as well."""
        self._first = {each.id: each.situation_kind for each in situations}

    def count(self, measures: Measures, revisions: Iterable[Situation]) -> None:
        for each in revisions:
            kind = self._first.setdefault(each.id, each.situation_kind)
            if each.state is AdvisoryState.CLEARED:
                del self._first[each.id]
            measures.count("deconflict_situations_total", kind, AdvisoryState(each.state).value)


def set_open_situations(measures: Measures, situations: Iterable[Situation]) -> None:
    """Set how many situations are open, by kind and severity."""
    counts = Counter[tuple[str, ...]]((each.situation_kind, each.severity.value) for each in situations)
    measures.level("deconflict_situations_open", {labels: float(count) for labels, count in counts.items()})
