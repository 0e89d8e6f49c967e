"""The findings of a look: their text, location, severity and evidence."""

from collections.abc import Callable, Mapping, Sequence

from deconflict.advisories.finding_lifecycle import Finding
from deconflict.advisories.severity import severity_of_deadlock, severity_of_finding
from deconflict.advisories.words import finding_words
from deconflict.advisories.words.finding_words import Named, advised_slots, shortened, way_out
from deconflict.advisories.words.words import RevisionWords
from deconflict.contention.queues.charger_forecast import ChargerShortage
from deconflict.contention.queues.queue_forecast import QueueEntry, QueueForecast
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.robot_view import RobotView
from deconflict.contention.slot_actions import with_queue_actions, with_ring_actions
from deconflict.contention.waiting.blockages import Blockage
from deconflict.contention.waiting.deadlocks import RingLink
from deconflict.contention.waiting.free_crossings import Crossing
from deconflict.contention.waiting.standing_reasons import state_phrase
from deconflict_client.advisory import Location, Recommendation, Severity, Wait, moment


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
    present, name = queue.present_at(first_s), _namer(robots)
    return Finding(
        kind="contention",
        about=place,
        severity=severity_of_finding(first_s - now_s),
        robots=tuple(sorted({*present, *(entry.robot for entry in waiting)})),
        predicted_s=first_s,
        location=geometry.location(place),
        words=lambda: finding_words.contention(
            [name(entry.robot) for entry in waiting],
            geometry.label(place),
            first_s - now_s,
            waiting[0].spread_s,
            queue.longest_wait_s,
            queue.free_s(geometry.capacity(place), now_s) - now_s,
            advised_slots(advice, place, {entry.robot for entry in waiting}, name, geometry.label),
        ),
        evidence=_queue_evidence(geometry, place, queue, len(present)),
        recommendation=with_queue_actions(advice, geometry, robots),
    )


def shortage(geometry: PlaceGeometry, pool: ChargerShortage, robots: Mapping[str, RobotView], now_s: float) -> Finding:
    """Chargers that will probably be full, for robots that have not announced that they come."""
    first, chargers = pool.chargers[0], shortened([geometry.label(charger) for charger in pool.chargers])
    expected = [need.robot for need in pool.needs]
    demand = len(pool.announced) + len(expected)
    return Finding(
        kind="contention",
        about=first,
        severity=Severity.CAUTION,
        robots=tuple(sorted({*pool.announced, *expected})),
        predicted_s=pool.from_s,
        location=geometry.location(first),
        words=lambda: finding_words.shortage(
            chargers, pool.from_s - now_s, [(robots[need.robot].name, need.level_pct) for need in pool.needs]
        ),
        evidence={
            "resource": first,
            "resource_name": chargers if len(pool.chargers) == 1 else f"one of {chargers}",
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
        words=lambda: finding_words.double_occupancy(len(inside), geometry.label(place), capacity),
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
    places, name = {link.where for link in ring}, _namer(robots)
    zone = next((link.where for link in ring if link.where != "path"), None)
    waiter = robots[ring[0].waiter]
    return _ring_finding(
        ring,
        geometry.location(zone) if zone else Location(datum=waiter.datum, x=waiter.x_m, y=waiter.y_m),
        lambda: finding_words.deadlock(
            [name(link.waiter) for link in ring],
            sorted({geometry.label(place) for place in places if place != "path"}),
            begins_s - now_s,
            way_out(advice, places, name, geometry.label),
        ),
        with_ring_actions(advice, ring, geometry, robots, now_s),
        now_s,
    )


def mutual_wait(
    ring: Sequence[RingLink],
    crossing: Crossing,
    advice: Recommendation,
    robots: Mapping[str, RobotView],
    now_s: float,
) -> Finding:
    """Robots that stand before a free crossing, each for the other. `ring` are their two waits."""
    x_m, y_m = crossing.middle_m
    first = robots[crossing.first]
    names = [robots[link.waiter].name for link in ring]
    return _ring_finding(
        ring,
        Location(datum=first.datum, x=round(x_m, 3), y=round(y_m, 3)),
        lambda: finding_words.mutual_wait(names, now_s - crossing.since_s, first.name),
        advice,
        now_s,
    )


def _ring_finding(
    ring: Sequence[RingLink],
    location: Location,
    words: Callable[[], RevisionWords],
    advice: Recommendation | None,
    now_s: float,
) -> Finding:
    begins_s = max(*(link.from_s for link in ring), now_s)
    waiters = tuple(sorted({link.waiter for link in ring}))
    return Finding(
        kind="deadlock",
        about=" ".join(waiters),
        severity=severity_of_deadlock(begins_s - now_s),
        robots=waiters,
        predicted_s=begins_s,
        location=location,
        words=words,
        recommendation=advice,
        evidence={
            "cycle": tuple(
                Wait(waiter=link.waiter, holder=link.holder, where=link.where, from_at=moment(link.from_s))
                for link in ring
            )
        },
    )


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
        words=lambda: finding_words.blockage(
            robot.name, state, now_s - blocked.since_s, [robots[uuid].name for uuid in blocked.holds_up], advice
        ),
        recommendation=advice,
        evidence={"blocker": blocked.blocker, "since_at": moment(blocked.since_s), "holds_up": blocked.holds_up},
    )


def _namer(robots: Mapping[str, RobotView]) -> Named:
    return lambda uuid: robots[uuid].name


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
