"""Each vendor's record over a log: the content of the live service's `/vendors`, read once a minute."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import islice
from typing import Any

from deconflict.operator.vendor_health import vendor_health
from deconflict_client.answers.vendor_models import Flag, VendorHealth
from ingest.measures.measures import joined_values

LOOK_S = 60.0
MOST_FLAGS = 100
"""Flags that are kept for one vendor, the newest."""
KEPT = {
    "grade",
    "grade_words",
    "coverage",
    "clock_s",
    "delay_s",
    "messages",
    "rejected",
    "rejections_by_rule",
    "deviations",
    "deviations_by_rule",
}
"""The fields of `/vendors` whose final values are in the result."""
DISTRUSTED = "deconflict_forecasts_distrusted_total"


FlagKey = tuple[str, datetime]
"""What has changed, and since when."""


@dataclass(slots=True)
class RaisedFlag:
    """A flag as it was when its change was largest."""

    flag: Flag
    until_s: float | None = None
    """When it was first found to be gone. None while it stands."""

    def document(self) -> dict[str, Any]:
        until = None if self.until_s is None else datetime.fromtimestamp(self.until_s, UTC)
        return {**self.flag.model_dump(mode="json"), "until": until and until.isoformat().replace("+00:00", "Z")}


@dataclass(slots=True)
class VendorRecord:
    """The record of one vendor so far."""

    health: VendorHealth
    flags: dict[FlagKey, RaisedFlag] = field(default_factory=dict)
    distrusted: int = 0
    """The largest number of distrusted robots at one time."""
    forecasts_distrusted: int = 0

    def update(self, health: VendorHealth, forecasts_distrusted: float, now_s: float) -> None:
        self.health, self.forecasts_distrusted = health, int(forecasts_distrusted)
        self.distrusted = max(self.distrusted, health.distrusted)
        standing: dict[FlagKey, Flag] = {(flag.what, flag.since): flag for flag in health.flags}
        for key, flag in standing.items():
            raised = self.flags.setdefault(key, RaisedFlag(flag))
            if abs(flag.by) > abs(raised.flag.by):
                raised.flag = flag
        for key in [known for known, flag in self.flags.items() if flag.until_s is None and known not in standing]:
            self.flags[key].until_s = now_s
        for key in [*islice(self.flags, max(len(self.flags) - MOST_FLAGS, 0))]:
            del self.flags[key]


class VendorRecords:
    """The records of all vendors, from the measures that the roles of the live service keep."""

    def __init__(self) -> None:
        self._of: dict[str, VendorRecord] = {}

    def update(self, now_s: float, documents: Iterable[dict[str, Any]]) -> None:
        """Add the measures of receiver and engine, as documents, at a time."""
        measures = [*documents]
        distrusted = joined_values(measures).get(DISTRUSTED, {})
        for health in vendor_health(measures):
            record = self._of.setdefault(health.name, VendorRecord(health))
            record.update(health, distrusted.get((health.name,), 0), now_s)

    def figures(self, ece: Mapping[str, float | None]) -> list[dict[str, Any]]:
        """The figures of each vendor, by name. `ece` is the calibration error of pairs with a robot of the vendor."""
        return [
            {
                "vendor": name,
                **record.health.model_dump(mode="json", include=KEPT),
                "flags": [flag.document() for flag in record.flags.values()],
                "distrusted": record.distrusted,
                "forecasts_distrusted": record.forecasts_distrusted,
                "ece": ece.get(name),
            }
            for name, record in sorted(self._of.items())
        ]
