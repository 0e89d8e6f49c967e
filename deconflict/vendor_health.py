"""How each vendor does, as the page shows it, from the roles' measures."""

from collections.abc import Iterable
from typing import Any

from ingest.measures import joined_values

LEVELS = {
    "clock_s": "deconflict_clock_offset_seconds",
    "delay_s": "deconflict_clock_delay_seconds",
    "forecast_age_s": "deconflict_forecast_age_seconds",
}


def vendor_health(documents: Iterable[dict[str, Any]]) -> dict[str, dict[str, float | str]]:
    """By vendor: `robots`, `silent`, `messages` and `rejected` and `deviations` so far, and the levels there are.

    `grade`, from "A" to "E", tells how far its forecasts can be trusted; it comes with enough of them.
    """
    values = joined_values(documents)
    told: dict[str, dict[str, float]] = {}

    def add(vendor: str, key: str, value: float) -> None:
        of_vendor = told.setdefault(
            vendor, dict.fromkeys(("robots", "silent", "messages", "rejected", "deviations"), 0)
        )
        of_vendor[key] = of_vendor.get(key, 0) + value

    for (vendor, state), count in values.get("deconflict_robots", {}).items():
        add(vendor, "robots", count)
        add(vendor, "silent", count if state == "silent" else 0)
    for (vendor, outcome), count in values.get("deconflict_messages_total", {}).items():
        add(vendor, "messages", count)
        add(vendor, "rejected", count if outcome == "rejected" else 0)
    for (vendor, _), count in values.get("deconflict_deviations_total", {}).items():
        add(vendor, "deviations", count)
    for key, name in LEVELS.items():
        for (vendor,), level in values.get(name, {}).items():
            add(vendor, key, level)
    grades = {vendor: grade for vendor, grade in values.get("deconflict_forecast_grade", {}) if vendor in told}
    return {
        vendor: counts | ({"grade": grades[vendor]} if vendor in grades else {})
        for vendor, counts in sorted(told.items())
    }
