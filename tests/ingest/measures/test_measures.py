import numpy as np
import pytest

from ingest.measures.measures import MOST_SERIES, OTHER, Histogram, Measures


def test_observations_are_counted_by_the_least_bound_that_is_not_below_them() -> None:
    histogram = Histogram((0.1, 1.0))
    histogram.observe([0.0, 0.1, 0.5])
    histogram.observe(np.array([1.0, 1.5]))
    histogram.observe([])
    assert histogram.counts == [2, 2, 1]
    assert histogram.total == pytest.approx(3.1)


def test_what_was_observed_of_each_label_is_told_apart_and_as_plain_numbers() -> None:
    measures = Measures()
    measures.observe("waits", np.array([0.3]), "Alder")
    measures.observe("waits", [0.7], "Corvid")
    measures.observe("waits", [0.9], "Corvid")
    expected = {
        tuple(labels): (sum(counts), total)
        for labels, _, counts, total in measures.as_document()["histograms"]["waits"]
    }
    assert expected == {("Alder",): (1, 0.3), ("Corvid",): (2, pytest.approx(1.6))}
    assert all(type(count) is int for row in measures.as_document()["histograms"]["waits"] for count in row[2])


def test_invented_makers_make_a_bounded_number_of_series_and_nothing_goes_uncounted() -> None:
    measures = Measures()
    for number in range(MOST_SERIES + 10):
        measures.count("warned", f"Maker-{number}", "late")
        measures.observe("waits", [0.3], f"Maker-{number}")
    measures.count("warned", "Maker-0", "late")
    series = measures.values["warned"]
    assert (len(series), sum(series.values())) == (MOST_SERIES + 1, MOST_SERIES + 11)
    assert (series[OTHER, OTHER], series["Maker-0", "late"]) == (10, 2)
    assert sum(measures.histograms["waits"][(OTHER,)].counts) == 10
