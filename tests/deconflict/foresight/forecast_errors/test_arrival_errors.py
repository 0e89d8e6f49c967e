import numpy as np
import pytest

from deconflict.foresight.forecast_errors.arrival_errors import ArrivalErrors
from deconflict.foresight.forecast_errors.error_ledger import HALF_LIFE_S
from deconflict.runtime.learned_state import UnreadableError, packed, unpacked
from ingest.batch import Floats
from ingest.measures.measures import Measures

NOW_S = 1_790_000_000.0


def told(arrival_errors: ArrivalErrors) -> tuple[dict[tuple[str, ...], float], dict[tuple[str, ...], float]]:
    """The metrics of arrivals: errors, and shares that were late."""
    measures = Measures()
    arrival_errors.measure(measures)
    names = ("deconflict_arrival_error_seconds", "deconflict_arrivals_late_ratio")
    return measures.values[names[0]], measures.values[names[1]]


def alike(n: int, value: float) -> Floats:
    return np.full(n, value)


def test_errors_are_grouped_by_how_long_ahead_they_were_announced() -> None:
    arrival_errors = ArrivalErrors()
    for ahead_s, late_s in ((40.0, -4.0), (200.0, 20.0), (800.0, 90.0), (5000.0, 700.0)):
        arrival_errors.record("Alder", alike(9, ahead_s), alike(9, late_s), NOW_S)
    off_s, late = told(arrival_errors)
    assert {key[1]: value for key, value in off_s.items() if key[2] == "0.9"} == {
        "60": pytest.approx(4.0, rel=0.1),
        "300": pytest.approx(20.0, rel=0.1),
        "900": pytest.approx(90.0, rel=0.1),
    }
    assert late == {("Alder", "60"): 0.0, ("Alder", "300"): 1.0, ("Alder", "900"): 1.0}


def test_few_arrivals_are_not_shown() -> None:
    arrival_errors = ArrivalErrors()
    arrival_errors.record("Alder", alike(4, 40.0), alike(4, 5.0), NOW_S)
    assert told(arrival_errors) == ({}, {})


def test_what_is_newer_counts_for_more() -> None:
    arrival_errors = ArrivalErrors()
    arrival_errors.record("Alder", alike(20, 40.0), alike(20, 30.0), NOW_S)
    arrival_errors.record("Alder", alike(20, 40.0), alike(20, -1.0), NOW_S + 2 * HALF_LIFE_S)
    off_s, late = told(arrival_errors)
    assert off_s["Alder", "60", "0.5"] == pytest.approx(1.0, rel=0.1)
    assert late["Alder", "60"] == pytest.approx(0.2)


def test_it_goes_on_after_a_restart() -> None:
    arrival_errors, resumed = ArrivalErrors(), ArrivalErrors()
    arrival_errors.record("Alder", alike(20, 40.0), alike(20, 30.0), NOW_S)
    resumed.resume(unpacked(packed({"arrival_errors": arrival_errors.learned()}))["arrival_errors"])
    for learned_errors in (arrival_errors, resumed):
        learned_errors.record("Alder", alike(20, 40.0), alike(20, -1.0), NOW_S + HALF_LIFE_S)
    assert told(resumed) == told(arrival_errors)
    ArrivalErrors().resume(ArrivalErrors().learned())


def test_counts_of_another_shape_are_refused() -> None:
    with pytest.raises(UnreadableError):
        ArrivalErrors().resume({"vendors": [["Alder", NOW_S]], "counts": np.zeros((1, 2, 2))})
