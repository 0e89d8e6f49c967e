"""What the ledger says of each vendor: how far off, how well covered, and a grade that a person can act on."""

import numpy as np

from deconflict.foresight.ledger import RADIAL, SHARES, Ledger
from deconflict.foresight.sketch import quantiles
from ingest.measures import Measures

GRADED_S = 3
GRADES = (("A", 0.1), ("B", 0.25), ("C", 0.5), ("D", 1.0), ("E", np.inf))
"""By the 80 % band three seconds ahead, metres: from "does what it says" to "is not to be relied on"."""
FEWEST_CASES = 50
"""A vendor of which fewer errors are known that far ahead is not graded."""
SHOWN_S = (1, 3, 5, 10)


def grade(band_m: float) -> str:
    """The grade of a vendor whose 80 % band three seconds ahead is `band_m`."""
    return next(name for name, most_m in GRADES if band_m <= most_m)


def in_words(grade: str | None) -> str:
    """Why a vendor has that grade, or none."""
    most_m = {name: most_m for name, most_m in GRADES if most_m < np.inf}
    if grade is None:
        return f"fewer than {FEWEST_CASES} forecasts have come due"
    if grade not in most_m:
        return f"more than 20 % of forecasts {GRADED_S} s ahead were over {max(most_m.values()):g} m off"
    return f"80 % of forecasts {GRADED_S} s ahead were within {most_m[grade]:g} m"


def measure(ledger: Ledger, measures: Measures) -> None:
    """Bring the levels of every vendor's forecasts up to date."""
    errors: dict[tuple[str, ...], float] = {}
    covered: dict[tuple[str, ...], float] = {}
    grades: dict[tuple[str, ...], float] = {}
    for vendor in dict.fromkeys(kind.vendor for kind in ledger.kinds):
        rows = [row for kind, row in ledger.kinds.items() if kind.vendor == vendor]
        cases = ledger.cases[rows].sum(axis=0)
        sizes_m = quantiles(ledger.counts[rows, RADIAL].sum(axis=0), SHARES)
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
