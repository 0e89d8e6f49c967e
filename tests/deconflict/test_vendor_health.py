from deconflict.vendor_health import vendor_health
from ingest.measures import Measures


def test_each_vendor_is_summed_over_states_outcomes_rules_and_roles() -> None:
    receiver, engine = Measures(), Measures()
    receiver.level("deconflict_robots", {("Bolt", "idle"): 2, ("Bolt", "silent"): 1, ("Acme", "navigating"): 4})
    receiver.count("deconflict_messages_total", "Bolt", "accepted", by=90)
    receiver.count("deconflict_messages_total", "Bolt", "rejected", by=10)
    receiver.count("deconflict_deviations_total", "Bolt", "clock-off", by=3)
    receiver.count("deconflict_deviations_total", "Bolt", "stamp-stale", by=4)
    receiver.level("deconflict_clock_offset_seconds", {("Acme",): -3.0})
    engine.count("deconflict_advisories_total", "conflict", "raised")
    engine.level("deconflict_forecast_grade", {("Acme", "B"): 1.0, ("Gone", "A"): 1.0})
    told = vendor_health([receiver.as_document(), engine.as_document()])
    assert list(told) == ["Acme", "Bolt"]
    assert told["Bolt"] == {"robots": 3, "silent": 1, "messages": 100, "rejected": 10, "deviations": 7}
    assert (told["Acme"]["robots"], told["Acme"]["clock_s"], told["Acme"]["grade"]) == (4, -3.0, "B")
