"""What the engine measures of itself: conflicts, advisories, near misses, the sweep's work and map drift."""

from collections.abc import Callable, Iterable, Mapping, Sequence

from deconflict.advisories.advisory_counts import (
    NEAR_MISSES,
    count_by_severity,
    count_revisions,
    set_open_count,
)
from deconflict.engine.learned.map_drift import MapDrift
from deconflict.foresight.losses.loss_places import PlacedLoss
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict_client.advisory import AnyAdvisory
from ingest.batch import Pair
from ingest.fleet.owners.admission import PARTLY_EXAMINED
from ingest.measures import clock_changes
from ingest.measures.measures import Measures

LOST_SECONDS = "deconflict_lost_seconds_total"


def count_losses(measures: Measures, losses: Iterable[PlacedLoss]) -> None:
    for placed in losses:
        loss = placed.loss
        measures.count(LOST_SECONDS, loss.vendor, loss.by_vendor, loss.kind.value, placed.place, by=loss.lost_s)


class EngineMetrics:
    """Counts what each pass does; works out levels when somebody asks for the measures."""

    def __init__(
        self,
        measures: Measures,
        open_advisories: Callable[[], Iterable[AnyAdvisory]],
        foresight: ProbabilityEstimator,
        map_drift: MapDrift,
        partly_examined: Callable[[], Mapping[str, int]],
    ) -> None:
        """`partly_examined` gives by vendor how many robots are compared with some others only."""
        self._measures, self._open_advisories = measures, open_advisories
        self._foresight, self._map_drift, self._partly_examined = foresight, map_drift, partly_examined
        self._conflicts = 0
        """Pairs in predicted conflict at the last pass."""
        measures.call_before_reading(self._set_levels)

    def count_pass(
        self,
        conflicts: PairConflicts,
        are_on_foot: Callable[[Pair], bool],
        near_misses: Sequence[Pair],
        revisions: Iterable[AnyAdvisory],
        deferred: Mapping[str, int],
    ) -> None:
        """Conflicts of two that `are_on_foot` do not count. `deferred` is how many revisions of conflicts wait for a
        later pass, by vendor."""
        self._conflicts = sum(not are_on_foot(pair) for pair in conflicts.pairs)
        self._measures.count(NEAR_MISSES, by=len(near_misses))
        count_revisions(self._measures, revisions)
        for vendor, conflicts_left in sorted(deferred.items()):
            self._measures.count("deconflict_revisions_deferred_total", vendor, by=conflicts_left)
        self._measures.count("deconflict_pairs_left_out_total", by=conflicts.left_out)
        self._measures.count("deconflict_sweep_segment_pairs_total", by=conflicts.segment_pairs)
        self._measures.count("deconflict_sweep_fcl_calls_total", by=conflicts.fcl_calls)

    def _set_levels(self) -> None:
        set_open_count(self._measures, count_by_severity(self._open_advisories()))
        self._measures.level("deconflict_datum_drift_metres", self._map_drift.drift_m())
        changes = {"forecast": self._foresight.degradation.changed(), "datum": self._map_drift.changed()}
        clock_changes.publish(self._measures, changes)
        self._measures.level("deconflict_conflicts", {(): self._conflicts})
        self._measures.level(PARTLY_EXAMINED, {(vendor,): robots for vendor, robots in self._partly_examined().items()})
