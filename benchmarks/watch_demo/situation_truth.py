"""What truly happened on the demo's floor, to judge situations by. Nobody leaves the floor."""

from math import inf

from benchmarks.watch_demo.judging import PairEvent, events_by_pair
from benchmarks.watch_demo.watching import START_S, Watch
from ingest.batch import Pair
from metrics.scoring.situation_scores import LONG_STOP_S, SituationTruth
from metrics.truth.pair_outcomes import OutcomeSpan, PairOutcomes
from metrics.truth.resource_use import TimeSpan


def situation_truth(watch: Watch, seconds: float) -> SituationTruth:
    """The truth of a run that lasted `seconds`."""
    events = {_pair(watch, rows): of_pair for rows, of_pair in events_by_pair(watch).items()}
    stops_s: dict[Pair, list[float]] = {}
    for stop in watch.floor.stops:
        if stop.counts:
            stops_s.setdefault(_pair(watch, (stop.robot, stop.other)), []).append(START_S + stop.start_s)
    advised: dict[Pair, list[TimeSpan]] = {}
    for alert in watch.alerts.values():
        if alert.kind == "conflict":
            stood = TimeSpan(START_S + alert.raised_s, START_S + alert.cleared_s)
            advised.setdefault(_pair(watch, alert.rows), []).append(stood)
    watch.contention.figures()
    return SituationTruth(
        span_s=seconds,
        robot_hours=len(watch.floor.members) * seconds / 3600,
        outcomes={pair: _outcomes(of_pair, stops_s.get(pair, [])) for pair, of_pair in events.items()},
        lasting_s={pair: _lasting_s(of_pair) for pair, of_pair in events.items()},
        advised=advised,
        others=watch.contention.outcomes,
        waits=watch.waits,
        left_s=lambda *_: START_S + seconds,
    )


def _outcomes(events: list[PairEvent], stops_s: list[float]) -> PairOutcomes:
    spans = [OutcomeSpan(START_S + event.onset_s, START_S + event.end_s) for event in events if event.what != "ordered"]
    return PairOutcomes(spans, stops_s=stops_s)


def _lasting_s(events: list[PairEvent]) -> list[float]:
    """The onsets of encounters, and of stops that last."""
    least_s = {"met": 0.0, "yielded": LONG_STOP_S, "ordered": inf}
    return [START_S + event.onset_s for event in events if event.end_s - event.onset_s >= least_s[event.what]]


def _pair(watch: Watch, rows: tuple[int, ...]) -> Pair:
    a, b = sorted(watch.floor.members[row].uuid for row in rows)
    return a, b
