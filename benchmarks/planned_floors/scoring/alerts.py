"""Alerts on pairs of robots: read from a service's advisories, or made from consecutive seconds."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from math import ceil, inf
from typing import Any

from benchmarks.planned_floors.truth.encounters import Pair

SERVICE, BELIEVER = "service", "believer"


@dataclass(frozen=True, slots=True)
class Alert:
    """One alert on a pair. It is open from `raised_s` until just before `cleared_s`."""

    pair: Pair
    raised_s: float
    cleared_s: float

    def stands_at(self, t_s: float) -> bool:
        return self.raised_s <= t_s < self.cleared_s

    def seconds(self) -> range:
        """The whole seconds at which it is open."""
        return range(ceil(self.raised_s), ceil(self.cleared_s))


def alerts_of_revisions(revisions: Iterable[dict[str, Any]], end_s: float) -> list[Alert]:
    """The alerts on conflicts in a stream of revisions. One that is never cleared is open until the end of the log."""
    pairs: dict[str, Pair] = {}
    raised_s: dict[str, float] = {}
    cleared_s: dict[str, float] = {}
    for revision in revisions:
        if revision["kind"] != "conflict":
            continue
        at_s, key = datetime.fromisoformat(revision["updated_at"]).timestamp(), revision["id"]
        low, high = sorted(revision["robots"])
        pairs.setdefault(key, (low, high))
        raised_s.setdefault(key, at_s)
        if revision["state"] == "cleared":
            cleared_s[key] = at_s
    alerts = [Alert(pair, raised_s[key], cleared_s.get(key, max(end_s, raised_s[key]))) for key, pair in pairs.items()]
    return by_time(alerts)


def revisions_in(text: str) -> list[dict[str, Any]]:
    """The revisions of a file of JSON lines."""
    return [json.loads(line) for line in text.splitlines() if line.strip()]


def alerts_of_seconds(seconds: dict[Pair, list[int]]) -> list[Alert]:
    """One alert for each run of consecutive seconds of a pair."""
    alerts = []
    for pair, alerting in seconds.items():
        first, last = None, -inf
        for second in sorted(alerting):
            if first is not None and second != last + 1:
                alerts.append(Alert(pair, float(first), last + 1.0))
                first = None
            first, last = second if first is None else first, second
        if first is not None:
            alerts.append(Alert(pair, float(first), last + 1.0))
    return by_time(alerts)


def by_time(alerts: list[Alert]) -> list[Alert]:
    return sorted(alerts, key=lambda alert: (alert.raised_s, alert.pair))
