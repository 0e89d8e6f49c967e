"""What a look has found, in words and as evidence."""

from collections.abc import Mapping, Sequence

from deconflict.advisories.finding_lifecycle import Finding
from deconflict.advisory import Location, Recommendation, Severity, Wait, moment
from deconflict.contention.queues.charger_forecast import Shortage
from deconflict.contention.queues.queue_forecast import Row, Turns
from deconflict.contention.robots.place_geometry import Geometry
from deconflict.contention.robots.robot_view import Seen
from deconflict.contention.waiting.blockages import Blocked
from deconflict.contention.waiting.deadlocks import Link

QUIET_S = 30.0
"""A robot not heard of for this long is said to be so (standard 5.4)."""
IN_WORDS = {
    "waitingHumanEvent": "waits for a person",
    "waitingExternalEvent": "waits for something around it",
    "waitingInternalEvent": "busy with itself",
    "navigating": "says that it drives",
    "manualOverride": "driven by hand",
}
"""States of the standard (5.2) that do not read as words."""
TELL_SPREAD_S = 3.0
"""An arrival that is known better is told without how well."""
SOON_S = 30.0
"""What begins sooner than this is a warning."""


def contention(
    geometry: Geometry,
    place: str,
    turns: Turns,
    advice: Recommendation | None,
    robots: Mapping[str, Seen],
    now_s: float,
) -> Finding:
    """More robots will want a place than it takes."""
    turns = turns.at_height_of(turns.longest)
    waiting = turns.waiting
    first_s = max(waiting[0].arrival_s, now_s)
    there = turns.there(first_s)
    return Finding(
        kind="contention",
        about=place,
        severity=Severity.WARNING if first_s - now_s <= SOON_S else Severity.CAUTION,
        robots=tuple(sorted({*there, *(row.robot for row in waiting)})),
        predicted_s=first_s,
        location=geometry.location(place),
        summary=lambda: (
            f"{names(robots, [row.robot for row in waiting])} will find {geometry.label(place)} taken "
            f"{_when(first_s - now_s)}{_within(waiting[0])} and wait up to {turns.longest_s:.0f} s"
            f"{_free(turns, geometry.capacity(place), now_s)}{_advised(geometry, place, waiting, advice, robots)}"
        ),
        evidence=_queue_evidence(geometry, place, turns, len(there)),
        recommendation=advice,
    )


def _within(first: Row) -> str:
    """How well it is known when the first comes, where that is worth a word."""
    return f", give or take {first.spread_s:.0f} s," if first.spread_s >= TELL_SPREAD_S else ""


def _free(turns: Turns, capacity: int, now_s: float) -> str:
    free_s = turns.free_s(capacity, now_s) - now_s
    return f"; it comes free in {free_s:.0f} s" if free_s > 0 else ""


def _advised(
    geometry: Geometry,
    place: str,
    waiting: Sequence[Row],
    advice: Recommendation | None,
    robots: Mapping[str, Seen],
) -> str:
    """What a site service should do: where order or place save nothing, who should come when there is room."""
    if advice is None:
        return ""
    bound = {row.robot for row in waiting}
    if advice.expected_saving_s < 1:
        late = [slot for slot in advice.slots if slot.robot in bound and slot.wait_s >= 1]
        return "".join(f"; {robots[slot.robot].name} should come {slot.wait_s:.0f} s later" for slot in late[:2])
    others = [slot for slot in advice.slots if slot.resource != place and slot.robot in bound]
    told = [f"{robots[slot.robot].name} should take {geometry.label(slot.resource)}" for slot in others]
    first = next((slot for slot in advice.slots if slot.resource == place and slot.robot in bound), None)
    if not told and first:
        told = [f"{robots[first.robot].name} should go first"]
    return "".join(f"; {one}" for one in told[:2]) + f", which saves {advice.expected_saving_s:.0f} s in all"


def shortage(geometry: Geometry, one: Shortage, robots: Mapping[str, Seen], now_s: float) -> Finding:
    """Chargers that will probably be full, for robots that have not said that they come."""
    first, label = one.chargers[0], " and ".join(geometry.label(charger) for charger in one.chargers)
    expected = [need.robot for need in one.needs]
    demand = len(one.there) + len(expected)
    levels = ", ".join(f"{robots[need.robot].name} {need.level_pct:.0f} %" for need in one.needs[:4])
    return Finding(
        kind="contention",
        about=first,
        severity=Severity.CAUTION,
        robots=tuple(sorted({*one.there, *expected})),
        predicted_s=one.from_s,
        location=geometry.location(first),
        summary=lambda: (
            f"{label} will probably be full {_when(one.from_s - now_s)}: {names(robots, expected)} will need to be"
            f" charged by then, by the level of their batteries ({levels})"
        ),
        evidence={
            "resource": first,
            "resource_name": label,
            "capacity": one.capacity,
            "demand": demand,
            "queue_length": max(demand - one.capacity, 1),
            "wait_s": round(one.wait_s, 1),
            "resources": one.chargers,
            "expected": len(expected),
            "probability": round(one.likely, 2),
        },
    )


def double_occupancy(geometry: Geometry, place: str, turns: Turns, crowd: Sequence[Row], now_s: float) -> Finding:
    """The robots of `crowd` are in a place, more than it takes."""
    inside, capacity = tuple(sorted(row.robot for row in crowd)), geometry.capacity(place)
    return Finding(
        kind="double_occupancy",
        about=place,
        severity=Severity.WARNING,
        robots=inside,
        predicted_s=now_s,
        location=geometry.location(place),
        summary=lambda: f"{len(inside)} robots are in {geometry.label(place)}, which takes {capacity}",
        evidence=_queue_evidence(geometry, place, turns, len(inside)),
    )


def deadlock(
    geometry: Geometry, ring: Sequence[Link], advice: Recommendation | None, robots: Mapping[str, Seen], now_s: float
) -> Finding:
    """Robots that will wait for each other in a ring, once the last of them waits."""
    begins_s = max(*(link.from_s for link in ring), now_s)
    first = ring[0]
    who = names(robots, [link.waiter for link in ring])
    where = sorted({geometry.label(link.where) for link in ring if link.where != "path"})
    place = f" at {' and '.join(where)}" if where else ""
    drawn = next((link.where for link in ring if link.where != "path"), None)
    seen = robots[first.waiter]
    left_s = begins_s - now_s
    return Finding(
        kind="deadlock",
        about=" ".join(sorted({link.waiter for link in ring})),
        severity=Severity.CRITICAL if left_s <= 0 else Severity.WARNING if left_s <= SOON_S else Severity.CAUTION,
        robots=tuple(sorted({link.waiter for link in ring})),
        predicted_s=begins_s,
        location=geometry.location(drawn) if drawn else Location(datum=seen.datum, x=seen.x_m, y=seen.y_m),
        summary=lambda: (
            f"{who} {'lock' if left_s <= 0 else 'will lock'} each other{place}"
            f"{'' if left_s <= 0 else ' ' + _when(left_s)}: each waits for the next"
            f"{_way_out(geometry, ring, advice, robots)}"
        ),
        recommendation=advice,
        evidence={
            "cycle": tuple(
                Wait(waiter=link.waiter, holder=link.holder, where=link.where, from_at=moment(link.from_s))
                for link in ring
            )
        },
    )


def _way_out(
    geometry: Geometry, ring: Sequence[Link], advice: Recommendation | None, robots: Mapping[str, Seen]
) -> str:
    if advice is None or advice.note or not advice.slots:
        return f"; {advice.note}" if advice and advice.note else ""
    first = advice.slots[0]
    if first.resource not in {link.where for link in ring}:
        costs = f", which costs {advice.cost_s:.0f} s in all"
        return f"; {robots[first.robot].name} should go to {geometry.label(first.resource)} first{costs}"
    last = max(advice.slots, key=lambda slot: slot.wait_s)
    lane = geometry.label(last.resource)
    return f"; {robots[last.robot].name} should wait {last.wait_s:.0f} s before {lane}"


def _says(seen: Seen, now_s: float) -> str:
    """What a standing robot says of itself, in words."""
    quiet_s = now_s - seen.event_s
    if quiet_s >= QUIET_S:
        return f"last heard {quiet_s:.0f} s ago"
    return IN_WORDS.get(seen.state, seen.state) or "no state"


def blockage(one: Blocked, robots: Mapping[str, Seen], now_s: float) -> Finding:
    """A robot that stands where others will pass."""
    seen = robots[one.blocker]
    return Finding(
        kind="blockage",
        about=one.blocker,
        severity=Severity.WARNING if one.from_s - now_s <= SOON_S else Severity.CAUTION,
        robots=tuple(sorted((one.blocker, *one.holds_up))),
        predicted_s=max(one.from_s, now_s),
        location=Location(datum=seen.datum, x=round(seen.x_m, 3), y=round(seen.y_m, 3)),
        summary=lambda: (
            f"{seen.name} has stood for {now_s - one.since_s:.0f} s ({_says(seen, now_s)}) in the way of "
            f"{names(robots, one.holds_up)}"
        ),
        evidence={"blocker": one.blocker, "since_at": moment(one.since_s), "holds_up": one.holds_up},
    )


def names(robots: Mapping[str, Seen], uuids: Sequence[str]) -> str:
    """At most four names, and how many more."""
    shown = [robots[uuid].name for uuid in uuids[:4]]
    if len(uuids) > 4:
        shown = [*shown[:3], f"{len(uuids) - 3} others"]
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"


def _when(left_s: float) -> str:
    return f"in {left_s:.0f} s" if left_s >= 1 else "now"


def _queue_evidence(geometry: Geometry, place: str, turns: Turns, demand: int) -> dict[str, object]:
    return {
        "resource": place,
        "resource_name": geometry.label(place),
        "capacity": geometry.capacity(place),
        "demand": demand,
        "queue_length": turns.queue,
        "wait_s": round(turns.longest_s, 1),
        "resources": (),
        "expected": 0,
        "probability": None,
    }
