from datetime import UTC, datetime

from deconflict.operator.vendor_health import vendor_health
from deconflict_client.answers.vendor_models import ForecastError
from ingest.measures import clock_changes
from ingest.measures.change_detection import LevelChange
from ingest.measures.measures import Labels, Measures

SINCE_S = 1_792_000_000.0


def test_each_vendor_is_summed_over_states_outcomes_rules_and_roles() -> None:
    receiver, engine = Measures(), Measures()
    receiver.level("deconflict_robots", {("Bolt", "idle"): 2, ("Bolt", "silent"): 1, ("Acme", "navigating"): 4})
    receiver.count("deconflict_messages_total", "Bolt", "accepted", by=90)
    receiver.count("deconflict_messages_total", "Bolt", "rejected", by=10)
    receiver.count("deconflict_rejections_total", "Bolt", "not-json", by=10)
    receiver.count("deconflict_deviations_total", "Bolt", "clock-off", by=3)
    receiver.count("deconflict_deviations_total", "Bolt", "stamp-stale", by=4)
    receiver.level("deconflict_clock_offset_seconds", {("Acme",): -3.0})
    engine.count("deconflict_advisories_total", "conflict", "raised")
    engine.level("deconflict_forecast_grade", {("Acme", "B"): 1.0, ("Gone", "A"): 1.0})
    acme, bolt = vendor_health([receiver.as_document(), engine.as_document()])
    assert (bolt.name, bolt.robots, bolt.silent, bolt.messages, bolt.rejected, bolt.deviations) == (
        "Bolt",
        3,
        1,
        100,
        10,
        7,
    )
    assert bolt.deviations_by_rule == {"clock-off": 3, "stamp-stale": 4}
    assert bolt.rejections_by_rule == {"not-json": 10}
    assert (bolt.grade, bolt.grade_words) == (None, "fewer than 50 forecasts have come due")
    assert (acme.robots, acme.clock_s, acme.grade) == (4, -3.0, "B")
    assert acme.grade_words == "80 % of forecasts 3 s ahead were within 0.25 m"


def test_values_of_several_machines_are_summed_or_the_worst_is_taken() -> None:
    machines = [Measures(), Measures()]
    for item, robots, per_s, offset_s, p80_m, grade in zip(
        machines, (3, 4), (2.5, 4.0), (-3.0, 0.1), (0.2, 0.7), "BD", strict=True
    ):
        item.level("deconflict_robots", {("Acme", "idle"): robots})
        item.level("deconflict_messages_per_second", {("Acme",): per_s})
        item.level("deconflict_clock_offset_seconds", {("Acme",): offset_s})
        item.level("deconflict_forecast_error_metres", {("Acme", "3", str(share)): p80_m for share in (0.5, 0.8, 0.9)})
        item.level("deconflict_forecast_grade", {("Acme", grade): 1.0})
    for documents in ([measures.as_document() for measures in each] for each in (machines, machines[::-1])):
        (acme,) = vendor_health(documents)
        assert (acme.robots, acme.messages_per_s, acme.clock_s, acme.grade) == (7, 6.5, -3.0, "D")
        assert acme.forecast_error[0].p80_m == 0.7


def test_errors_are_given_by_horizon() -> None:
    measures = Measures()
    measures.count("deconflict_messages_total", "Acme", "accepted")
    sizes: dict[Labels, float]
    sizes = {("Acme", str(h), share): h * m for h in (10, 1) for share, m in (("0.5", 0.1), ("0.8", 0.2), ("0.9", 0.3))}
    measures.level("deconflict_forecast_error_metres", sizes)
    measures.level("deconflict_forecast_band_coverage_ratio", {("Acme", "0.9"): 0.91})
    measures.level("deconflict_arrival_error_seconds", {("Acme", "60", "0.5"): 4.0, ("Acme", "60", "0.9"): 9.0})
    measures.level("deconflict_arrivals_late_ratio", {("Acme", "60"): 0.25})
    (acme,) = vendor_health([measures.as_document()])
    assert acme.forecast_error[0] == ForecastError(horizon_s=1, p50_m=0.1, p80_m=0.2, p90_m=0.3)
    assert [forecast_error.horizon_s for forecast_error in acme.forecast_error] == [1, 10]
    assert [(coverage.share, coverage.covered) for coverage in acme.coverage] == [(0.9, 0.91)]
    assert [(arrival.ahead_up_to_s, arrival.p50_s, arrival.p90_s, arrival.late) for arrival in acme.arrivals] == [
        (60.0, 4.0, 9.0, 0.25)
    ]


def test_a_change_is_described_with_its_start() -> None:
    receiver, engine = Measures(), Measures()
    receiver.count("deconflict_messages_total", "Acme", "accepted")
    clock_changes.publish(receiver, {"clock": {"Acme": LevelChange(SINCE_S, -3.04099)}})
    clock_changes.publish(engine, {"forecast": {"Acme": LevelChange(SINCE_S + 60, 0.41)}, "datum": {}})
    (acme,) = vendor_health([receiver.as_document(), engine.as_document()])
    assert [(flag.what, flag.by, flag.words) for flag in acme.flags] == [
        ("clock", -3.041, "clocks 3.0 s faster than usual"),
        ("forecast", 0.41, "forecasts 0.4 m further off than usual"),
    ]
    assert acme.flags[0].since == datetime.fromtimestamp(SINCE_S, UTC)


def test_what_vendors_should_mend_is_joined_over_receivers() -> None:
    measures = Measures()
    measures.count("deconflict_messages_total", "Acme", "accepted")
    measures.count("deconflict_messages_total", "Bolt", "accepted")
    odd = {"rule": "key-unknown", "path": "a", "value": "1", "reading": "not read", "nearest": "b"}
    row = odd | {"robots": 2, "count": 5, "last_received": "2026-01-01T00:00:00Z"}
    robots = [
        {"uuid": name, "name": name, "reason": "send a position", "fault": "", "placed": False}
        for name in ("one", "two")
    ]
    senders = [{"vendor": "Acme", "odd_values": [row], "not_compared": [robot]} for robot in robots]
    acme, bolt = vendor_health([measures.as_document()], senders)
    assert [(value.path, value.robots, value.count) for value in acme.odd_values] == [("a", 4, 10)]
    assert [robot.uuid for robot in acme.not_compared] == ["one", "two"]
    assert (bolt.odd_values, bolt.not_compared) == ([], [])


def test_each_vendor_shows_what_was_asked_of_it_and_who_yielded_to_whom() -> None:
    engine = Measures()
    engine.level("deconflict_robots", {("Acme", "navigating"): 1, ("Bolt", "navigating"): 1})
    engine.count("deconflict_advice_asked_total", "Acme", "go_around", by=5)
    engine.count("deconflict_advice_asked_total", "Acme", "back_out", by=2)
    for code, number in (("done", 3), ("declined", 2), ("withdrawn", 1), ("lapsed", 1), ("restarted", 4)):
        engine.count("deconflict_advice_ended_total", "Acme", "go_around", code, by=number)
    for why, number, seconds in (("unwilling", 3, 40.5), ("unable", 1, 7.0)):
        engine.count("deconflict_advice_refused_total", "Acme", why, by=number)
        engine.count("deconflict_advice_refused_seconds_total", "Acme", why, by=seconds)
    engine.level("deconflict_advice_yielded_seconds_total", {("Acme", "Bolt"): 12.5, ("Bolt", "Acme"): 4.0})
    acme, bolt = (vendor.advice for vendor in vendor_health([engine.as_document()]))
    assert (acme.asked, acme.done, acme.declined, acme.not_begun) == (7, 3, 2, 2)
    assert (acme.refusals, acme.refused_s, acme.unable, acme.unable_s) == (3, 40.5, 1, 7.0)
    assert (acme.yielded_s, acme.let_through_s) == (bolt.let_through_s, bolt.yielded_s) == (12.5, 4.0)
    assert (bolt.asked, bolt.refusals, bolt.unable_s) == (0, 0, 0.0)
