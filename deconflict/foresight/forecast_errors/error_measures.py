"""Metrics of the ledger by vendor: sizes of errors, coverage of the bands, and the grade."""

from deconflict.foresight.forecast_errors.error_ledger import RADIAL, SHARES, Ledger
from deconflict.foresight.forecast_errors.forecast_grades import FEWEST_CASES, GRADED_S, grade
from deconflict.foresight.forecast_errors.upper_quantiles import upper_quantiles
from ingest.measures.measures import Measures

SHOWN_S = (1, 3, 5, 10)
"""Seconds ahead for which errors are shown."""


def measure(ledger: Ledger, measures: Measures) -> None:
    """Update the metrics of every vendor's forecasts."""
    errors: dict[tuple[str, ...], float] = {}
    covered: dict[tuple[str, ...], float] = {}
    grades: dict[tuple[str, ...], float] = {}
    for vendor in dict.fromkeys(kind.vendor for kind in ledger.kinds):
        rows = [row for kind, row in ledger.kinds.items() if kind.vendor == vendor]
        cases = ledger.cases[rows].sum(axis=0)
        sizes_m = upper_quantiles(ledger.counts[rows, RADIAL].sum(axis=0), SHARES)
        for horizon_s in SHOWN_S:
            for share, size_m in zip(SHARES.tolist(), sizes_m[horizon_s - 1].tolist(), strict=True):
                errors[(vendor, str(horizon_s), str(share))] = size_m
        if cases.sum() > 0:
            within = ledger.covered[rows].sum(axis=(0, 1)) / cases.sum()
            covered |= {
                (vendor, str(share)): part for share, part in zip(SHARES.tolist(), within.tolist(), strict=True)
            }
        if cases[GRADED_S - 1] >= FEWEST_CASES:
            grades[(vendor, grade(float(sizes_m[GRADED_S - 1, 1])))] = 1.0
    measures.level("deconflict_forecast_error_metres", errors)
    measures.level("deconflict_forecast_band_coverage_ratio", covered)
    measures.level("deconflict_forecast_grade", grades)
