"""The findings of a look: their text, location, severity and evidence."""

from collections.abc import Mapping, Sequence

from deconflict.advice.actions.action_text import action_text
from deconflict.advice.document_limits import MOST_NAMED, listed
from deconflict.advisories.finding_lifecycle import Finding
from deconflict.advisories.severity import severity_of_deadlock, severity_of_finding
from deconflict.advisories.words.words import words
from deconflict.advisory import Location, Recommendation, Severity, Wait, moment
from deconflict.contention.queues.charger_forecast import ChargerShortage
from deconflict.contention.queues.queue_forecast import QueueEntry, QueueForecast
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.slot_actions import with_queue_actions, with_ring_actions
from deconflict.contention.waiting.blockages import Blockage
from deconflict.contention.waiting.deadlocks import RingLink
from deconflict.contention.waiting.standing_reasons import state_phrase

WIDE_SPREAD_S = 3.0
"""The text gives the spread of an arrival if it is at least so wide."""


def contention(
    geometry: PlaceGeometry,
    place: str,
    queue: QueueForecast,
    advice: Recommendation | None,
    robots: Mapping[str, RobotView],
    now_s: float,
) -> Finding:
    """More robots will want a place than its capacity."""
    queue = queue.at_height_of(queue.longest_waiting)
    waiting = queue.waiting
    first_s = max(waiting[0].arrival_s, now_s)
    present = queue.present_at(first_s)
    return Finding(
        kind="contention",
        about=place,
        severity=severity_of_finding(first_s - now_s),
        robots=tuple(sorted({*present, *(entry.robot for entry in waiting)})),
        predicted_s=first_s,
        location=geometry.location(place),
        words=lambda: words(
            lambda when: (
                f"{_names(robots, [entry.robot for entry in waiting])} will find {geometry.label(place)} taken{when} "
                f"and wait up to {queue.longest_wait_s:.0f} s"
            ),
            f" {_when(first_s - now_s)}{_spread(waiting[0])}",
            *_free(queue, geometry.capacity(place), now_s),
            *_advised(geometry, place, waiting, advice, robots),
        ),
        evidence=_queue_evidence(geometry, place, queue, len(present)),
        recommendation=with_queue_actions(advice, geometry, robots),
    )


def _spread(first: QueueEntry) -> str:
    """How far the arrival of the first robot may be off; empty if that is little."""
    return f", give or take {first.spread_s:.0f} s," if first.spread_s >= WIDE_SPREAD_S else ""


def _free(queue: QueueForecast, capacity: int, now_s: float) -> list[str]:
    free_s = queue.free_s(capacity, now_s) - now_s
    return [f"it comes free in {free_s:.0f} s"] if free_s > 0 else []


def _advised(
    geometry: PlaceGeometry,
    place: str,
    waiting: Sequence[QueueEntry],
    advice: Recommendation | None,
    robots: Mapping[str, RobotView],
) -> list[str]:
    """What a site service should do; if no order or place saves time, who should come later."""
    if advice is None:
        return []
    coming = {entry.robot for entry in waiting}
    if advice.expected_saving_s < 1:
        late = [slot for slot in advice.slots if slot.robot in coming and slot.wait_s >= 1]
        return [f"{robots[slot.robot].name} should come {slot.wait_s:.0f} s later" for slot in late[:2]]
    elsewhere = [slot for slot in advice.slots if slot.resource != place and slot.robot in coming]
    phrases = [f"{robots[slot.robot].name} should take {geometry.label(slot.resource)}" for slot in elsewhere]
    first = next((slot for slot in advice.slots if slot.resource == place and slot.robot in coming), None)
    if not phrases and first:
        phrases = [f"{robots[first.robot].name} should go first"]
    saving = f", which saves {advice.expected_saving_s:.0f} s in all"
    return [*phrases[:2][:-1], *(phrase + saving for phrase in phrases[:2][-1:])]


def shortage(geometry: PlaceGeometry, pool: ChargerShortage, robots: Mapping[str, RobotView], now_s: float) -> Finding:
    """Chargers that will probably be full, for robots that have not announced that they come."""
    first, chargers = pool.chargers[0], _shortened([geometry.label(charger) for charger in pool.chargers])
    expected = [need.robot for need in pool.needs]
    demand = len(pool.announced) + len(expected)
    levels = ", ".join(f"{robots[need.robot].name} {need.level_pct:.0f} %" for need in pool.needs[:4])
    return Finding(
        kind="contention",
        about=first,
        severity=Severity.CAUTION,
        robots=tuple(sorted({*pool.announced, *expected})),
        predicted_s=pool.from_s,
        location=geometry.location(first),
        words=lambda: words(
            lambda when: (
                f"{chargers} will probably be full{when}: {_names(robots, expected)} will need to be charged by then, "
                f"by the level of their batteries ({levels})"
            ),
            f" {_when(pool.from_s - now_s)}",
        ),
        evidence={
            "resource": first,
            "resource_name": chargers if len(pool.chargers) == 1 else f"one of {len(pool.chargers)} chargers",
            "capacity": pool.capacity,
            "demand": demand,
            "queue_length": max(demand - pool.capacity, 1),
            "wait_s": round(pool.wait_s, 1),
            "resources": pool.chargers,
            "expected": len(expected),
            "probability": round(pool.likely, 2),
        },
    )


def double_occupancy(
    geometry: PlaceGeometry, place: str, queue: QueueForecast, group: Sequence[QueueEntry], now_s: float
) -> Finding:
    """The robots of `group` are in a place, more than its capacity."""
    inside, capacity = tuple(sorted(entry.robot for entry in group)), geometry.capacity(place)
    return Finding(
        kind="double_occupancy",
        about=place,
        severity=Severity.WARNING,
        robots=inside,
        predicted_s=now_s,
        location=geometry.location(place),
        words=lambda: words(lambda _: f"{len(inside)} robots are in {geometry.label(place)}, which takes {capacity}"),
        evidence=_queue_evidence(geometry, place, queue, len(inside)),
    )


def deadlock(
    geometry: PlaceGeometry,
    ring: Sequence[RingLink],
    advice: Recommendation | None,
    robots: Mapping[str, RobotView],
    now_s: float,
) -> Finding:
    """Robots that will wait for each other in a ring, from when the last of them waits."""
    begins_s = max(*(link.from_s for link in ring), now_s)
    first = ring[0]
    who = _names(robots, [link.waiter for link in ring])
    where = sorted({geometry.label(link.where) for link in ring if link.where != "path"})
    place = f" at {_joined(where)}" if where else ""
    zone = next((link.where for link in ring if link.where != "path"), None)
    waiter = robots[first.waiter]
    left_s = begins_s - now_s
    return Finding(
        kind="deadlock",
        about=" ".join(sorted({link.waiter for link in ring})),
        severity=severity_of_deadlock(left_s),
        robots=tuple(sorted({link.waiter for link in ring})),
        predicted_s=begins_s,
        location=geometry.location(zone) if zone else Location(datum=waiter.datum, x=waiter.x_m, y=waiter.y_m),
        words=lambda: words(
            lambda when: (
                f"{who} {'lock' if left_s <= 0 else 'will lock'} each other{place}{when}: each waits for the next"
            ),
            "" if left_s <= 0 else f" {_when(left_s)}",
            *_way_out(geometry, ring, advice, robots),
        ),
        recommendation=with_ring_actions(advice, ring, geometry, robots, now_s),
        evidence={
            "cycle": tuple(
                Wait(waiter=link.waiter, holder=link.holder, where=link.where, from_at=moment(link.from_s))
                for link in ring
            )
        },
    )


def _way_out(
    geometry: PlaceGeometry, ring: Sequence[RingLink], advice: Recommendation | None, robots: Mapping[str, RobotView]
) -> list[str]:
    if advice is None or advice.note or not advice.slots:
        return [advice.note] if advice and advice.note else []
    first = advice.slots[0]
    if first.resource not in {link.where for link in ring}:
        costs = f", which costs {advice.cost_s:.0f} s in all"
        return [f"{robots[first.robot].name} should go to {geometry.label(first.resource)} first{costs}"]
    last = max(advice.slots, key=lambda slot: slot.wait_s)
    lane = geometry.label(last.resource)
    return [f"{robots[last.robot].name} should wait {last.wait_s:.0f} s before {lane}"]


def blockage(
    blocked: Blockage,
    advice: Recommendation,
    robots: Mapping[str, RobotView],
    quiet_after_s: float,
    now_s: float,
) -> Finding:
    """A robot that stands where others will pass."""
    robot = robots[blocked.blocker]
    state, first_s = state_phrase(robot, quiet_after_s, now_s), max(min(blocked.from_s), now_s)
    return Finding(
        kind="blockage",
        about=blocked.blocker,
        severity=severity_of_finding(first_s - now_s),
        robots=tuple(sorted((blocked.blocker, *blocked.holds_up))),
        predicted_s=first_s,
        location=Location(datum=robot.datum, x=round(robot.x_m, 3), y=round(robot.y_m, 3)),
        words=lambda: words(
            lambda when: f"{robot.name} has stood{when} ({state}) in the way of {_names(robots, blocked.holds_up)}",
            f" for {now_s - blocked.since_s:.0f} s",
            *map(action_text, advice.actions),
        ),
        recommendation=advice,
        evidence={"blocker": blocked.blocker, "since_at": moment(blocked.since_s), "holds_up": blocked.holds_up},
    )


def _names(robots: Mapping[str, RobotView], uuids: Sequence[str]) -> str:
    return _shortened([robots[uuid].name for uuid in uuids])


def _shortened(names: Sequence[str]) -> str:
    """At most four names, or three and how many more."""
    return listed(names if len(names) <= 4 else [*names[:3], f"{len(names) - 3} others"])


def _joined(labels: Sequence[str]) -> str:
    """The labels of places, at most `MOST_NAMED`."""
    return " and ".join([*labels[:MOST_NAMED], *["others"] * (len(labels) > MOST_NAMED)])


def _when(left_s: float) -> str:
    return f"in {left_s:.0f} s" if left_s >= 1 else "now"


def _queue_evidence(geometry: PlaceGeometry, place: str, queue: QueueForecast, demand: int) -> dict[str, object]:
    return {
        "resource": place,
        "resource_name": geometry.label(place),
        "capacity": geometry.capacity(place),
        "demand": demand,
        "queue_length": queue.longest_queue,
        "wait_s": round(queue.longest_wait_s, 1),
        "resources": (),
        "expected": 0,
        "probability": None,
    }
