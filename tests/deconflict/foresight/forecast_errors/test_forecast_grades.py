import numpy as np
import pytest

from deconflict.foresight.forecast_errors.error_ledger import Ledger
from deconflict.foresight.forecast_errors.error_measures import measure
from deconflict.foresight.forecast_errors.forecast_grades import FEWEST_CASES, grade
from ingest.batch import Basis
from ingest.measures.measures import Measures
from tests.deconflict.foresight.forecast_errors.made_errors import off

NOW_S = 1_790_000_000.0


def told(error_m: float, cases: int) -> Measures:
    """The measures of a vendor with so many errors of `error_m` three seconds ahead."""
    ledger, measures = Ledger(), Measures()
    row, alike = ledger.row("Alder", "A-7", Basis.PATH, NOW_S), np.zeros(cases)
    ledger.record(off(row, 3, alike, alike + error_m, ledger.bands_m[row, 2]), NOW_S)
    measure(ledger, measures)
    return measures


@pytest.mark.parametrize(("band_m", "letter"), [(0.1, "A"), (0.11, "B"), (0.5, "C"), (0.9, "D"), (30.0, "E")])
def test_grades_go_by_what_a_person_can_measure(band_m: float, letter: str) -> None:
    assert grade(band_m) == letter


def test_a_vendor_has_its_errors_coverage_and_grade() -> None:
    values = told(0.4, 500).values
    assert values["deconflict_forecast_error_metres"][("Alder", "3", "0.8")] == pytest.approx(0.4, rel=0.1)
    assert values["deconflict_forecast_grade"] == {("Alder", "C"): 1.0}
    # the prior's bands three seconds ahead were far narrower
    assert values["deconflict_forecast_band_coverage_ratio"][("Alder", "0.9")] == 0.0


def test_few_cases_are_no_grade() -> None:
    assert told(0.4, FEWEST_CASES - 1).values["deconflict_forecast_grade"] == {}
