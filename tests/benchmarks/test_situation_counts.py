"""Two minutes and a half of the demo: the summary of a shift, a replay and the metrics count the same situations."""

import json
from collections import Counter
from pathlib import Path
from typing import Any, cast

import pytest
from fastapi import FastAPI

from benchmarks.watch_demo.situation_truth import situation_truth
from benchmarks.watch_demo.watching import Watch
from deconflict.advisories.situations.situation_counts import SituationCounts
from deconflict.operator.http.page_routes import PageRoutes
from deconflict.operator.store.store import Store
from deconflict_client.advisory import AdvisoryState
from deconflict_client.situations import Situation
from ingest.measures.measures import Measures

SECONDS = 150.0


class Told:
    """What a run of the demo told people."""

    def __init__(self, robots: int, seed: int) -> None:
        self.measures, self.revisions = Measures(), list[Situation]()
        watch, counts = Watch(robots, seed), SituationCounts()
        add = watch.situation_scores.add

        def kept(now_s: float, revisions: Any) -> None:
            add(now_s, revisions)
            counts.count(self.measures, revisions)
            self.revisions += revisions

        cast(Any, watch.situation_scores).add = kept
        watch.run(SECONDS)
        self.figures = watch.situation_scores.figures(situation_truth(watch, SECONDS))


@pytest.fixture(scope="module")
def shown() -> Told:
    return Told(robots=60, seed=1)


def test_shift_summary_replay_and_metrics_count_the_same_situations(shown: Told, tmp_path: Path) -> None:
    store = Store(tmp_path / "advisories.db")
    store.append(shown.revisions)
    shift = json.loads(cast(bytes, PageRoutes(FastAPI(), store, cast(Any, None)).shift(0.0).body))
    store.close()
    raised = {
        kind: count
        for (kind, event), count in shown.measures.values["deconflict_situations_total"].items()
        if event == AdvisoryState.RAISED.value
    }
    assert raised == {row["kind"]: row["situations"] for row in shown.figures["by_kind"]} == shift["counts"]
    ended = {
        kind: count
        for (kind, event), count in shown.measures.values["deconflict_situations_total"].items()
        if event == AdvisoryState.CLEARED.value
    }
    open_now = Counter(row["first_kind"] for row in shift["situations"] if row["situation"]["state"] != "cleared")
    assert raised == Counter(ended) + open_now
    assert sum(raised.values()) == shown.figures["situations"] == len(shift["situations"]) >= 20
    listed = Counter(each["first_kind"] for each in shift["situations"])
    assert listed == shift["counts"]


def test_no_situation_of_the_demo_changes_its_subject_or_is_gone_at_once(shown: Told) -> None:
    assert shown.figures["changed_subject"] == 0
    assert shown.figures["open_s"]["shortest"] >= 5.0
