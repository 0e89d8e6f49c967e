"""Grades of the forecasts of a vendor, for people."""

from math import inf

GRADED_S = 3
GRADES = (("A", 0.1), ("B", 0.25), ("C", 0.5), ("D", 1.0), ("E", inf))
"""Largest 80 % band three seconds ahead of each grade, metres. A means "does what it says", E "not reliable"."""
FEWEST_CASES = 50
"""A vendor with fewer known errors three seconds ahead has no grade."""


def grade(band_m: float) -> str:
    """The grade of a vendor whose 80 % band three seconds ahead is `band_m`."""
    return next(name for name, most_m in GRADES if band_m <= most_m)


def in_words(grade: str | None) -> str:
    """Why a vendor has that grade, or no grade (None)."""
    most_m = {name: most_m for name, most_m in GRADES if most_m < inf}
    if grade is None:
        return f"fewer than {FEWEST_CASES} forecasts have come due"
    if grade not in most_m:
        return f"more than 20 % of forecasts {GRADED_S} s ahead were over {max(most_m.values()):g} m off"
    return f"80 % of forecasts {GRADED_S} s ahead were within {most_m[grade]:g} m"
