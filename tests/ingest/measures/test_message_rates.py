from ingest.measures.measures import Labels
from ingest.measures.message_rates import MessageRates


def test_a_rate_is_of_the_last_minute_and_of_all_results() -> None:
    rates, counted = MessageRates(), dict[Labels, float]()
    for second in range(200):
        counted["Acme", "accepted"] = 4.0 * second
        counted["Acme", "rejected"] = 1.0 * max(second - 100, 0)
        rates.observe(1000.0 + second / 1, counted)
        if second < 5:
            assert rates.per_s() == {}
        elif second <= 100:
            assert rates.per_s() == {("Acme",): 4.0}
    assert rates.per_s() == {("Acme",): 5.0}


def test_a_vendor_that_is_new_counts_from_nothing() -> None:
    rates = MessageRates()
    rates.observe(0.0, {})
    rates.observe(10.0, {("Acme", "accepted"): 20.0})
    assert rates.per_s() == {("Acme",): 2.0}


def test_a_clock_that_is_set_back_is_followed() -> None:
    rates = MessageRates()
    for second in range(100):
        rates.observe(1000.0 + second - (5000 if second >= 50 else 0), {("Acme", "accepted"): 2.0 * second})
    assert rates.per_s() == {("Acme",): 2.0}
