"""The interactions that the service finds in a log, compared with the truth of the floor."""

from itertools import chain
from math import nan
from pathlib import Path

import numpy as np

from benchmarks.planned_floors.scoring.figure import Figure, alone, share
from benchmarks.planned_floors.scoring.scored_floor import Floor
from benchmarks.planned_floors.truth.floor_truth import Stop
from benchmarks.planned_floors.truth.outcomes import Happenings
from deconflict.foresight.interactions.interaction_finder import InteractionOutcome
from deconflict.settings.site import Site
from ingest.recording.log_reader import LogReader
from metrics.replay.recorded_passes import PassReader
from metrics.scoring.forecast_scores import ForecastScores
from metrics.truth.interactions import Interactions, YieldEvent
from metrics.truth.placebo import Placebo

EARLY_S, LATE_S = 2.5, 1.0
"""An interaction belongs to a stop if it begins at most `EARLY_S` before the stop, or `LATE_S` after its end."""
FOUND_WITHIN_S = 5.0
"""A stop is found if an interaction of its pair begins at most this long before or after the onset of the stop."""
MET_WITHIN_S = 3.0
"""A pair has met if its encounter ends at most this long before the stop, or begins at most this long after its end."""


def interactions(log: Path, site: Site) -> Interactions:
    """The interactions of one log, found as `deconflict replay` finds them."""
    passes, errors, found = PassReader(site), ForecastScores(), Interactions(Placebo())
    for engine_pass in chain(passes.passes_of(LogReader().read([log])), passes.last_passes()):
        found.add_batch(engine_pass.batch, errors.add_batch(engine_pass.batch, engine_pass.now_s))
    return found


def finder_figures(log: Path, truth: Path, site: Site) -> dict[str, Figure]:
    """Precision and recall of the finder against the known stops of a floor, and what a placebo finds.

    The benchmark's README defines each figure.
    """
    floor, found = Floor.read(log, truth, site.conflict.clearance_m), interactions(log, site)
    yielded = [case for cases in found.by_pair.values() for case in cases if case.outcome is InteractionOutcome.YIELDED]
    placebo, happened = found.figures()["placebo"], floor.happened
    share_again = nan if placebo["same_robot"] is None else placebo["same_robot"]
    stops_of = [_stops_of(case, floor.truth.stops) for case in yielded]
    true = [_is_true(case, stops, happened) for case, stops in zip(yielded, stops_of, strict=True)]
    return {
        "found, true": share(np.array(true)),
        "found, a stop of the robot": share(np.array([bool(stops) for stops in stops_of])),
        "fresh stops found": share(np.array([_is_found(stop, found, happened) for stop in happened.stops])),
        "placebo found": alone(share_again, placebo["same_looked_at"]),
    }


def _stops_of(case: YieldEvent, stops: list[Stop]) -> list[Stop]:
    """The stops of the robot that an interaction belongs to."""
    return [
        stop
        for stop in stops
        if stop.robot == case.robot and stop.start_s - EARLY_S <= case.onset_s <= stop.end_s + LATE_S
    ]


def _is_true(case: YieldEvent, stops: list[Stop], happened: Happenings) -> bool:
    """Whether one of the robot's `stops` was for the other robot, or the pair had an outcome then."""
    return any(stop.by == case.other for stop in stops) or any(
        outcome.onset_s - LATE_S <= case.onset_s <= outcome.end_s + LATE_S
        for outcome in happened.outcomes.get(case.pair, ())
    )


def _is_found(stop: Stop, found: Interactions, happened: Happenings) -> bool:
    """Whether an interaction of the pair was found, or the pair met."""
    return any(
        abs(case.onset_s - stop.start_s) < FOUND_WITHIN_S or case.onset_s <= stop.start_s <= case.end_s
        for case in found.by_pair.get(stop.pair, ())
    ) or any(
        encounter.pair == stop.pair
        and encounter.start_s <= stop.end_s + MET_WITHIN_S
        and encounter.end_s >= stop.start_s - MET_WITHIN_S
        for encounter in happened.met
    )
