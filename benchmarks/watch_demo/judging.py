"""The true outcome of each alert, and the figures of a run."""

from collections import Counter
from dataclasses import asdict, dataclass
from itertools import pairwise
from math import inf
from typing import Any

from benchmarks.watch_demo.watching import Alert, Watch

WITHIN_S = 10.0
"""An alert is true if its event begins while it is open, or within this time after that."""
AHEAD_S = 2.0
FAR_M, LONG_STOOD_S, REPEATED_S = 12.0, 3.0, 60.0
Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, order=True)
class PairEvent:
    """An event of a pair."""

    onset_s: float
    end_s: float
    what: str
    """`met`, `yielded` or `ordered`."""


def events_by_pair(watch: Watch) -> dict[Pair, list[PairEvent]]:
    """All events by pair, ordered by onset."""
    found: dict[Pair, list[PairEvent]] = {}
    for meeting in watch.floor.truth.encounters:
        found.setdefault(meeting.robots, []).append(PairEvent(meeting.start_s, meeting.last_s, "met"))
    for stop in watch.floor.stops:
        pair = (min(stop.robot, stop.other), max(stop.robot, stop.other))
        found.setdefault(pair, []).append(
            PairEvent(stop.start_s, stop.last_s, "ordered" if stop.ordered else "yielded"),
        )
    return {pair: sorted(every) for pair, every in found.items()}


def verdict(alert: Alert, events: list[PairEvent], end_s: float) -> tuple[str, float | None]:
    """The outcome of an alert, and when its event began."""
    until_s = min(alert.cleared_s, end_s) + WITHIN_S
    true = [event for event in events if event.what != "ordered" and alert.raised_s <= event.onset_s <= until_s]
    lasting = [event for event in events if event.what != "ordered" and event.onset_s < alert.raised_s <= event.end_s]
    if lasting:
        return f"in progress ({lasting[0].what})", lasting[0].onset_s
    if true:
        return f"true ({true[0].what})", true[0].onset_s
    ordered = [
        event
        for event in events
        if event.what == "ordered" and event.onset_s <= until_s and event.end_s >= alert.raised_s
    ]
    if ordered:
        return "ordered", ordered[0].onset_s
    return ("unknown" if until_s > end_s else "in vain"), None


def rows_of(watch: Watch, end_s: float) -> list[dict[str, Any]]:
    """Every alert with its outcome and its oddities, in the order in which they were raised."""
    events, rows = events_by_pair(watch), []
    before: dict[tuple[int, ...], list[float]] = {}
    for alert in sorted(watch.alerts.values(), key=lambda alert: alert.raised_s):
        pair = (min(alert.rows[:2]), max(alert.rows[:2]))
        became, onset_s = verdict(alert, events.get(pair, []), end_s) if alert.kind == "conflict" else ("", None)
        earlier = before.setdefault((*sorted(alert.rows), hash(alert.kind)), [])
        odd = _odd(alert, earlier) if alert.kind == "conflict" else []
        earlier.append(alert.raised_s)
        document = asdict(alert) | {"became": became, "onset_s": onset_s, "odd": odd}
        rows.append({name: None if value == inf else value for name, value in document.items()})
    return rows


def _odd(alert: Alert, earlier: list[float]) -> list[str]:
    odd = []
    if min(alert.stood_s) > LONG_STOOD_S:
        odd.append("both stand")
    if len(set(alert.vendors)) == 1:
        odd.append("one vendor")
    if alert.gap_m > FAR_M:
        odd.append("far apart")
    if sum(alert.raised_s - at_s < REPEATED_S for at_s in earlier) >= 1:
        odd.append("repeated")
    return odd


def summary(watch: Watch, rows: list[dict[str, Any]], robots: int, seconds: float) -> dict[str, Any]:
    """The figures of a run."""
    conflicts = [row for row in rows if row["kind"] == "conflict"]
    became = Counter(row["became"].split(" (")[0] for row in conflicts)
    hours, known = robots * seconds / 3600, became["true"] + became["in vain"] + became["ordered"]
    fresh = [stop for stop in watch.floor.stops if stop.counts]
    warned = [stop for stop in fresh if _is_warned(stop.robot, stop.other, stop.start_s, conflicts)]
    return {
        "robots": robots,
        "seconds": seconds,
        "alerts": len(conflicts),
        "alerts_per_robot_hour": round(len(conflicts) / hours, 1),
        "alert_minutes_per_robot_hour": round(watch.open_s / 60 / hours, 1),
        "became": dict(became),
        "true_share": round(became["true"] / known, 2) if known else None,
        "odd": dict(Counter(odd for row in conflicts for odd in row["odd"])),
        "classes": dict(Counter(row["encounter_class"] for row in conflicts)),
        "most_open": watch.most_open,
        "other_kinds": dict(Counter(row["kind"] for row in rows if row["kind"] != "conflict")),
        "fresh_stops": len(fresh),
        "fresh_stops_per_robot_hour": round(len(fresh) / hours, 1),
        "fresh_stops_told_2_s_ahead": round(len(warned) / len(fresh), 2) if fresh else None,
        "lost_time": asdict(watch.lost_time.now()),
        "passed_on": dict(watch.follower.counts),
        "encounters": len(watch.floor.truth.encounters),
        "longest_alert_s": round(max((_lasted_s(row, seconds) for row in conflicts), default=0.0), 1),
        "shortest_gap_between_alerts_of_a_pair_s": _shortest_gap_s(conflicts),
    }


def stops_of(watch: Watch, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Every fresh stop, with the lead time of an advisory that was open then; None if there was none."""
    found = []
    for stop in watch.floor.stops:
        if stop.counts:
            leads_s = [
                stop.start_s - row["raised_s"]
                for row in rows
                if row["kind"] == "conflict"
                and {stop.robot, stop.other} == set(row["rows"])
                and row["raised_s"] <= stop.start_s <= (row["cleared_s"] or stop.start_s)
            ]
            names = [watch.floor.members[robot].name for robot in (stop.robot, stop.other)]
            found.append(asdict(stop) | {"names": names, "told_s": max(leads_s, default=None)})
    return found


def _lasted_s(row: dict[str, Any], end_s: float) -> float:
    return float((end_s if row["cleared_s"] is None else row["cleared_s"]) - row["raised_s"])


def _is_warned(robot: int, other: int, onset_s: float, conflicts: list[dict[str, Any]]) -> bool:
    """Whether an alert of the pair was raised at least 2 s before, and is open."""
    return any(
        {robot, other} == set(row["rows"])
        and row["raised_s"] <= onset_s - AHEAD_S
        and (row["cleared_s"] is None or row["cleared_s"] >= onset_s)
        for row in conflicts
    )


def _shortest_gap_s(conflicts: list[dict[str, Any]]) -> float | None:
    by_pair: dict[tuple[int, ...], list[float]] = {}
    for row in conflicts:
        by_pair.setdefault(tuple(sorted(row["rows"])), []).append(row["raised_s"])
    gaps_s = [after - before for raised in by_pair.values() for before, after in pairwise(raised)]
    return round(min(gaps_s), 1) if gaps_s else None
