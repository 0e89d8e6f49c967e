"""What health says of what is refused or lost: of every counter of the catalogue, by one rule."""

import asyncio
import json
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from deconflict.roles.health.refusal_health import (
    INSISTENT,
    RULES,
    SHOWN_S,
    STEP_S,
    RefusalHealth,
    Shown,
    rule_of,
)
from deconflict_client.answers.health_models import ServiceHealth
from ingest.measures.measures import Measures
from metrics.monitoring.catalogue import CATALOGUE
from tests.deconflict.roles.made_service import Served
from tests.helpers.patience import PATIENCE_S

COUNTERS = [name for name, entry in CATALOGUE.items() if entry.kind == "counter"]
REFUSED, SHED, DROPPED = (
    f"deconflict_{name}_total" for name in ("connections_refused", "messages_shed", "recorded_lines_dropped")
)
BY_PART = {
    "deconflict_advisories_set_aside_total": "delivery",
    "deconflict_store_failures_total": "store",
    "deconflict_pairs_left_out_total": "pairs",
    "deconflict_deadlines_missed_total": "effort",
    "deconflict_site_reloads_total": "site",
    "deconflict_role_restarts_total": "restarts",
}
"""Counters of what another part of the health says."""
NOTHING_LOST = {
    "deconflict_messages_total": "messages; `deconflict_rejections_total` counts those that are refused",
    "deconflict_statuses_superseded_total": "statuses of which the engine read a newer one",
    "deconflict_revisions_deferred_total": "revisions that come in a later pass",
    "deconflict_robots_forgotten_total": "robots that were silent for reading.forget_after_s",
    "deconflict_robots_moved_total": "robots that were moved; GET /robots says which",
    "deconflict_silences_total": "silences of robots",
    "deconflict_forecasts_distrusted_total": "forecasts that count less; GET /presence lists their robots",
    "deconflict_deviations_total": "deviations in messages that were accepted",
    "deconflict_advice_refused_total": "answers of vendors; GET /vendors has them",
    "deconflict_advice_refused_seconds_total": "time of robots; GET /vendors has it",
    "deconflict_advice_ended_total": "pieces of advice that ended",
    "deconflict_advice_asked_total": "pieces of advice",
    "deconflict_advice_yielded_seconds_total": "time of robots",
    "deconflict_lost_seconds_total": "time that robots lost to each other",
    "deconflict_near_misses_total": "near misses",
    "deconflict_recorded_bytes_total": "bytes that were recorded",
    "deconflict_ticks_total": "ticks",
    "deconflict_situations_total": "revisions",
    "deconflict_advisories_total": "revisions",
    "deconflict_advisories_stored_total": "revisions",
    "deconflict_conflicts_ended_total": "conflicts",
    "deconflict_warnings_judged_total": "warnings",
    "deconflict_vendor_warnings_judged_total": "warnings",
    "deconflict_events_judged_total": "events on the floor",
    "deconflict_vendor_events_judged_total": "events on the floor",
    "deconflict_probability_outcomes_total": "outcomes that probabilities are learned from",
    "deconflict_sweep_segment_pairs_total": "work of the engine",
    "deconflict_sweep_fcl_calls_total": "work of the engine",
    "deconflict_ordinary_waits_total": "waits of robots",
    "deconflict_ordinary_wait_seconds_total": "waits of robots",
    "deconflict_outlet_deliveries_total": "deliveries",
}
"""Counters of what is neither refused nor lost: what they count."""
NOTHING_LOST_BY_LABEL = {
    (REFUSED, "idle"): "robots that have nothing to say, or have left",
    (REFUSED, "face-idle"): "browsers and clients that keep connections open which they no longer use",
    ("deconflict_blackboxes_total", "kept"): "black boxes that were kept",
    ("deconflict_blackboxes_total", "unfounded"): "near misses that reports do not show",
    ("deconflict_advisories_pruned_total", "age"): "advisories that are as old as store.keep_days says",
}
"""The same of counters that count what is refused or lost by other labels."""
CASES = [(name, "acme") for name in (*BY_PART, *NOTHING_LOST)] + [
    (name, label)
    for name, rule in RULES.items()
    for label in (["acme"] if isinstance(rule, Shown) else [*rule, "a-reason-of-a-later-release"])
]


def counted(name: str, *labels: str, by: float = 1) -> list[dict[str, Any]]:
    measures = Measures()
    measures.count(name, *labels, by=by)
    return [measures.as_document()]


def health_with(name: str, *labels: str, by: float = 1) -> dict[str, Any]:
    health = RefusalHealth(since_start=True)
    health.note_measures("receiver", counted(name, *labels, by=by), 100.0)
    return health.document(100.0)


def test_every_counter_of_the_catalogue_is_said_in_health_or_says_why_not() -> None:
    assert sorted([*RULES, *BY_PART, *NOTHING_LOST]) == sorted(COUNTERS), "say in RULES how health says a new counter"
    rules = {case: rule_of(*case) for case in CASES if case[0] in RULES}
    assert {case for case, rule in rules.items() if rule is None} == NOTHING_LOST_BY_LABEL.keys()
    assert all(rule.words and rule.remedy for rule in rules.values() if rule)


def test_a_counter_that_another_part_of_health_says_names_a_part() -> None:
    assert set(BY_PART.values()) <= ServiceHealth.model_fields.keys()


@pytest.mark.parametrize(("name", "label"), CASES)
def test_each_counter_that_rises_is_said_with_what_to_do(name: str, label: str) -> None:
    rule = rule_of(name, label) if name in RULES else None
    labels = [label or "another", *CATALOGUE[name].labels[1:]] if CATALOGUE[name].labels else []
    document = health_with(name, *labels, by=1e6)
    text = json.dumps(document)
    if rule is None:
        assert document == {"status": "ok", "notes": []}
    else:
        assert all(words in text for words in (rule.words, rule.remedy, "1000000"))
        assert document["status"] == ("degraded" if rule.degraded_from <= 1e6 else "ok")


def test_it_is_said_while_it_goes_on_and_for_ten_minutes() -> None:
    health = RefusalHealth(since_start=True)
    for second in range(0, 2000, 5):
        health.note_measures("receiver", counted(REFUSED, "full", by=second), float(second))
    assert health.document(1995.0)["status"] == "degraded"
    count = float(health.document(1995.0)["reason"].partition(" ")[0])
    assert SHOWN_S <= count <= SHOWN_S + STEP_S
    for now_s, status in ((1995.0 + SHOWN_S - 1.0, "degraded"), (1995.0 + SHOWN_S, "ok")):
        health.note_measures("receiver", counted(REFUSED, "full", by=1995), now_s)
        assert health.document(now_s)["status"] == status
    assert SHOWN_S == 600.0


@pytest.mark.parametrize(
    ("name", "label", "by"),
    [
        ("deconflict_rejections_total", "acme", 1),
        ("deconflict_rejections_total", "acme", 100_000),
        ("deconflict_stream_dropped_total", "", 1),
        (SHED, "acme", 100_000),
        (REFUSED, "unauthorised", INSISTENT - 1),
        (REFUSED, "idle", 100_000),
        ("deconflict_outlet_failures_total", "webhooks.duty", 1),
    ],
)
def test_what_one_sender_or_one_subscriber_does_is_a_note_and_no_fault(name: str, label: str, by: int) -> None:
    labels = [label, *CATALOGUE[name].labels[1:]][: len(CATALOGUE[name].labels)]
    document = health_with(name, *labels, by=by)
    assert document["status"] == "ok"
    assert bool(document["notes"]) is (label != "idle")


def test_a_note_names_those_with_most() -> None:
    measures = Measures()
    for number in range(1, 9):
        measures.count(SHED, f"vendor {number}", by=number)
    health = RefusalHealth(since_start=True)
    health.note_measures("receiver", [measures.as_document()], 0.0)
    (note,) = health.document(0.0)["notes"]
    assert note.startswith("36 messages were not read")
    assert "(vendor 8: 8, vendor 7: 7, vendor 6: 6, vendor 5: 5, vendor 4: 4)" in note
    assert "vendor 3" not in note


def test_what_was_lost_before_is_not_said_again_and_a_role_that_begins_anew_has_lost_nothing() -> None:
    health = RefusalHealth(since_start=False)
    for now_s, lines in ((0.0, 698), (5.0, 3)):
        health.note_measures("receiver", counted(DROPPED, by=lines), now_s)
        assert health.document(now_s) == {"status": "ok", "notes": []}
    health.note_measures("receiver", counted(DROPPED, by=5), 10.0)
    assert health.document(10.0)["reason"].startswith("2 lines were not recorded")


LIMITED = "import os, resource as r, sys; r.setrlimit(r.RLIMIT_NOFILE, (256, 256)); os.execv(sys.argv[1], sys.argv[1:])"


async def test_a_service_that_refuses_robots_for_want_of_files_says_so(tmp_path: Path) -> None:
    served = Served(tmp_path / "data", prefix=(sys.executable, "-c", LIMITED))

    async def come(url: str) -> None:
        with suppress(OSError, WebSocketException):
            async with connect(url, open_timeout=PATIENCE_S) as robot:
                await robot.wait_closed()

    with served.running():
        health = await served.until("/healthz", lambda health: health.get("roles", {}).get("engine") == "up")
        assert health["refused_or_lost"] == {"status": "ok", "notes": []}
        robots = [asyncio.create_task(come(served.robots_url)) for _ in range(150)]
        health = await served.until("/healthz", lambda health: health["refused_or_lost"]["status"] != "ok")
        for robot in robots:
            robot.cancel()
        await asyncio.gather(*robots, return_exceptions=True)
    assert health["status"] == "degraded"
    assert "raise the limit of open files" in health["refused_or_lost"]["reason"]
