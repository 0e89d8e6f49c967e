import pytest

from metrics.monitoring.promql import UnknownSeriesError, increase, level, quantile, rate, share_within


def test_queries_are_those_a_person_would_write() -> None:
    assert rate("deconflict_messages_total", "5m", ["vendor"], where={"result": "accepted"}) == (
        'sum by (vendor) (rate(deconflict_messages_total{result="accepted"}[5m]))'
    )
    assert level("deconflict_connections") == "sum (deconflict_connections)"
    assert share_within(0.25, "deconflict_message_to_advisory_seconds", "1h") == (
        'sum (rate(deconflict_message_to_advisory_seconds_bucket{le="0.25"}[1h]))'
        " / sum (rate(deconflict_message_to_advisory_seconds_count[1h]))"
    )
    assert quantile(0.5, "deconflict_sweep_duration_seconds", "1m") == (
        "histogram_quantile(0.5, sum by (le) (rate(deconflict_sweep_duration_seconds_bucket[1m])))"
    )


def test_a_metric_or_label_outside_the_catalogue_is_refused() -> None:
    with pytest.raises(UnknownSeriesError, match="no metric deconflict_mesages_total"):
        rate("deconflict_mesages_total", "5m")
    with pytest.raises(UnknownSeriesError, match="is a gauge, not a counter"):
        increase("deconflict_robots", "5m")
    with pytest.raises(UnknownSeriesError, match="no label robot; it has vendor, state"):
        level("deconflict_robots", ["robot"])
    with pytest.raises(UnknownSeriesError, match="no label colour"):
        level("deconflict_robots", where={"colour": "red"})
    with pytest.raises(UnknownSeriesError, match=r"no bound at 0\.3"):
        share_within(0.3, "deconflict_message_to_advisory_seconds", "1h")
