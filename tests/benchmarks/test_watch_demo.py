"""The verdicts on alerts of the demo, and a short run of the whole benchmark."""

import json
from math import inf

import pytest

from benchmarks.watch_demo.judging import PairEvent, rows_of, summary, verdict
from benchmarks.watch_demo.situation_truth import situation_truth
from benchmarks.watch_demo.watching import Alert, Watch
from deconflict.simulation.demo.advice_follower import Follow

YIELDED, MET, ORDERED = PairEvent(20.0, 24.0, "yielded"), PairEvent(40.0, 41.0, "met"), PairEvent(20.0, 24.0, "ordered")


def alert(raised_s: float, cleared_s: float) -> Alert:
    return Alert(
        kind="conflict",
        names=("Alder 1", "Corvid 1"),
        vendors=("Alder", "Corvid"),
        rows=(0, 1),
        raised_s=raised_s,
        probability=0.5,
        time_to_conflict_s=5.0,
        encounter_class="crossing",
        basis=("path", "path"),
        summary="",
        separation_m=0.0,
        gap_m=5.0,
        stood_s=(0.0, 0.0),
        cleared_s=cleared_s,
        stands_s=[0.0, 0.0],
    )


@pytest.mark.parametrize(
    ("raised_s", "cleared_s", "events", "became"),
    [
        (15.0, 18.0, [YIELDED], ("true (yielded)", 20.0)),
        (9.0, 9.5, [YIELDED], ("in vain", None)),
        (22.0, 30.0, [YIELDED, MET], ("in progress (yielded)", 20.0)),
        (25.0, 31.0, [YIELDED, MET], ("true (met)", 40.0)),
        (15.0, 18.0, [ORDERED], ("ordered", 20.0)),
        (95.0, inf, [], ("unknown", None)),
    ],
)
def test_the_verdict_on_an_alert(
    raised_s: float, cleared_s: float, events: list[PairEvent], became: tuple[str, float | None]
) -> None:
    assert verdict(alert(raised_s, cleared_s), events, end_s=100.0) == became


def test_a_short_run_reports_what_happened() -> None:
    watch = Watch(robots=16, seed=1)
    watch.run(30.0)
    rows = rows_of(watch, 30.0)
    figures = summary(watch, rows, 16, 30.0)
    json.dumps([rows, figures])
    nose_to_nose = [row for row in rows if row["kind"] == "conflict" and min(row["rows"]) >= len(watch.floor.world)]
    assert [row["became"] for row in nose_to_nose] == ["true (met)"]
    assert figures["alerts"] == sum(row["kind"] == "conflict" for row in rows)
    assert figures["most_open"] >= 1
    situations = watch.situation_scores.figures(situation_truth(watch, 30.0))
    assert 1 <= situations["true"] <= situations["situations"]
    assert situations["foreseen"]["outcomes"] >= 1


def test_robots_wait_as_they_are_advised() -> None:
    watch = Watch(robots=40, seed=1, follow=Follow.ADVISORIES)
    watch.run(40.0)
    lost = watch.lost_time.now()
    assert watch.follower.counts["wait"] > 0
    assert 0.0 < lost.advised_s <= lost.waited_s <= lost.delay_s + 1.0 <= lost.driven_s


def test_nobody_waits_as_advised_if_nothing_is_followed() -> None:
    watch = Watch(robots=40, seed=1)
    watch.run(20.0)
    assert not watch.follower.counts
    assert watch.lost_time.now().advised_s == 0.0
