"""What people, metrics and other ingests are shown of a fleet."""

from collections import Counter
from collections.abc import Iterator
from itertools import islice
from math import dist, isfinite, isnan
from operator import attrgetter
from statistics import median
from typing import Any

from ingest.batch import Basis
from ingest.clocks import SenderClock, vendor_offset
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners import comparability, off_floor_report
from ingest.fleet.owners.admission import UNEXAMINED
from ingest.fleet.owners.comparability import NotCompared, shown_by_history, unexamined_sentence
from ingest.fleet.owners.device_kinds import participant_of
from ingest.fleet.robot import Robot
from ingest.fleet.shared_identities import SharedIdentity
from ingest.fleet.shown import odd_values
from ingest.fleet.shown.odd_values import OddValue
from ingest.frames.floor_index import NOWHERE
from ingest.languages.front_ends import FRONT_ENDS
from ingest.measures import clock_changes
from ingest.port.connection import Connection
from ingest.settings import Reading

NOT_COMPARED = "deconflict_robots_not_compared"
MOST_SHOWN_BYTES = 64 << 10
"""A longer message is not shown."""
MOST_SHOWN = 200
"""Robots that are compared with nobody, of which the page says why."""


def measure(fleet: Fleet, now_s: float) -> None:
    """Bring the levels in the fleet's measures up to date."""
    robots: dict[tuple[str, ...], float] = {}
    by_language: dict[tuple[str, ...], float] = {}
    ages_s: dict[str, list[float]] = {}
    clocks: dict[str, list[SenderClock]] = {}
    for robot in fleet.off_floor.without(list(fleet.robots.values())):
        key = robot.vendor, _measured_state(robot, fleet.reading, now_s)
        robots[key] = robots.get(key, 0) + 1
        spoken = robot.vendor, robot.language
        by_language[spoken] = by_language.get(spoken, 0) + 1
        if robot.seen:
            clocks.setdefault(robot.vendor, []).append(robot.clock)
            ages_s.setdefault(robot.vendor, []).append(now_s - robot.seen.t_s)
    level = fleet.measures.level
    level("deconflict_robots", robots)
    level("deconflict_robots_by_language", by_language)
    level(UNEXAMINED, fleet.owners.admission.level())
    level("deconflict_forecast_age_seconds", {(vendor,): median(ages) for vendor, ages in ages_s.items()})
    level("deconflict_clock_offset_seconds", {(vendor,): vendor_offset(group) for vendor, group in clocks.items()})
    delays_s = {vendor: median(clock.delay_s for clock in group) for vendor, group in clocks.items()}
    level("deconflict_clock_delay_seconds", {(vendor,): delay_s for vendor, delay_s in delays_s.items()})
    level("deconflict_messages_per_second", fleet.message_rates.per_s())
    faults = Counter((robot.vendor, why.fault) for robot, why in _not_compared(fleet, now_s) if why.fault)
    faults.update((vendor, comparability.NOT_READ) for _, vendor, _ in _not_read(fleet, now_s))
    level(NOT_COMPARED, {key: float(count) for key, count in faults.items()})
    clock_changes.publish(fleet.measures, {"clock": fleet.clock_changes.changed()})


def presence(robot: Robot, reading: Reading, now_s: float) -> str:
    """`present`, `quiet` or `silent`, by the time since its last status; before the first, since its last message."""
    age_s = _age_s(robot, now_s)
    if age_s > reading.silent_after_s:
        return "silent"
    return "quiet" if age_s > reading.quiet_after_s else "present"


def _age_s(robot: Robot, now_s: float) -> float:
    return now_s - (robot.arrival_s if robot.seen else max(robot.arrival_s, robot.heard_s))


def _measured_state(robot: Robot, reading: Reading, now_s: float) -> str:
    if presence(robot, reading, now_s) == "silent":
        return "silent"
    return robot.state if robot.state and robot.known_state else "other"


def robot_document(fleet: Fleet, robot: Robot, now_s: float, floors: Counter[str] | None = None) -> dict[str, Any]:
    """Everything that a robot reported and what was derived from it, JSON-ready. Who asks for many robots gives
    `floors`, as of `robots_by_floor`."""
    why = _why_not_compared(fleet, robot, robots_by_floor(fleet) if floors is None else floors, now_s)
    return {
        "uuid": robot.uuid,
        "name": robot.name,
        "vendor": robot.vendor,
        "language": robot.language,
        "participant": participant_of(fleet.owners.vendors.settings(robot.vendor), robot.model, robot.uuid),
        "source": robot.source,
        "examined": robot.examined,
        "unexamined_reason": None if robot.examined else unexamined_sentence(robot),
        "compared": why is None,
        "not_compared_reason": why and why.sentence,
        "identified": robot.identity is not None,
        "presence": presence(robot, fleet.reading, now_s),
        "age_s": round(_age_s(robot, now_s), 3),
        "state": robot.state,
        **_doing(fleet, robot),
        "clock": {"offset_s": round(robot.clock.offset_s, 3), "delay_s": round(robot.clock.delay_s, 3)},
        "deviations": dict(sorted(robot.deviations.items())),
        "odd_values": [value.document() for value in _odd_values(fleet, robot)],
        "sizes": [*(robot.size.notes if robot.size else ()), *robot.loads.notes],
        "identity": _message(robot, robot.shared_identity.raw if robot.shared_identity else b""),
        "status": _message(robot, robot.status_raw),
        **off_floor_report.robot_parts(fleet.off_floor, robot, now_s),
        **_placement(robot),
    }


def _doing(fleet: Fleet, robot: Robot) -> dict[str, Any]:
    """Where a robot goes next, and its amounts, as far as it says."""
    return {
        "destination": _destination(fleet, robot),
        **{name: None if isnan(value) else round(value, 1) for name, value in robot.amounts._asdict().items()},
    }


def _destination(fleet: Fleet, robot: Robot) -> dict[str, Any] | None:
    if not len(robot.stops):
        return None
    expected_s, x_m, y_m, floor = robot.stops[0].tolist()
    shown_s = round(expected_s, 3) if isfinite(expected_s) else None
    datum = None if int(floor) == NOWHERE else fleet.placement.floor_ids[int(floor)]
    return {"floor": datum, "x": round(x_m, 3), "y": round(y_m, 3), "expected_s": shown_s}


def robots_by_floor(fleet: Fleet) -> Counter[str]:
    """How many robots are on each floor, by its name."""
    return Counter(robot.frame.floor for robot in fleet.robots.values() if robot.frame)


def _why_not_compared(fleet: Fleet, robot: Robot, floors: Counter[str], now_s: float) -> NotCompared | None:
    if mark := fleet.off_floor.marks.get(robot.uuid):
        return NotCompared("", f"it is off the floor, says {mark.by}")
    return comparability.not_compared(robot, fleet.reading, fleet.site_floors, floors, now_s)


def _not_compared(fleet: Fleet, now_s: float) -> Iterator[tuple[Robot, NotCompared]]:
    """The robots that are compared with nobody, except those that are silent or off the floor, with the reason."""
    floors = robots_by_floor(fleet)
    for robot in fleet.off_floor.without(list(fleet.robots.values())):
        why = _why_not_compared(fleet, robot, floors, now_s)
        if why and (why.fault or presence(robot, fleet.reading, now_s) != "silent"):
            yield robot, why


def _not_read(fleet: Fleet, now_s: float) -> Iterator[tuple[str, str, str]]:
    """UUID, vendor and reason of robots that are not known, since all of their messages are rejected."""
    rejected = fleet.quarantine.rejected_robots(now_s - fleet.reading.silent_after_s)
    for uuid, (vendor, message) in rejected.items():
        if uuid not in fleet.robots:
            yield uuid, vendor, f"all its messages are rejected ({message.rule}): {message.reason}"


def senders(fleet: Fleet, now_s: float) -> list[dict[str, Any]]:
    """What each vendor should mend, JSON-ready: values that deviate, and robots that are compared with nobody. And how
    many of each kind it has, if they are not all robots."""
    kinds = _kinds(fleet)
    named = odd_values.by_vendor((robot.vendor, _odd_values(fleet, robot)) for robot in fleet.robots.values())
    robots: dict[str, list[dict[str, Any]]] = {}
    for robot, why in islice(_not_compared(fleet, now_s), MOST_SHOWN):
        shown = {"uuid": robot.uuid, "name": robot.name, "placed": robot.forecast is not None}
        robots.setdefault(robot.vendor, []).append(shown | {"reason": why.sentence, "fault": why.fault})
    for uuid, vendor, reason in islice(_not_read(fleet, now_s), MOST_SHOWN):
        shown = {"uuid": uuid, "name": f"{vendor} {uuid[:8]}", "placed": False}
        robots.setdefault(vendor, []).append(shown | {"reason": reason, "fault": comparability.NOT_READ})
    return [
        {
            "vendor": vendor,
            "odd_values": named.get(vendor, []),
            "not_compared": robots.get(vendor, []),
            "participants": dict(kinds.get(vendor, {})),
        }
        for vendor in sorted({*named, *robots, *kinds})
    ]


def _kinds(fleet: Fleet) -> dict[str, Counter[str]]:
    """Of the vendors whose devices do not all stand for robots, how many stand for what."""
    kinds: dict[str, Counter[str]] = {}
    for robot in fleet.robots.values():
        kind = participant_of(fleet.owners.vendors.settings(robot.vendor), robot.model, robot.uuid)
        kinds.setdefault(robot.vendor, Counter())[kind] += 1
    return {vendor: counts for vendor, counts in kinds.items() if counts.keys() != {"robot"}}


def _odd_values(fleet: Fleet, robot: Robot) -> list[OddValue]:
    """The values of its messages that deviate, the newest first, then those that its history and the site show."""
    named = robot.odd_values.newest_first()
    rules = {value.newest.rule for value in named}
    shown = (oddity for oddity in shown_by_history(robot, fleet.site_floors) if oddity.rule not in rules)
    return named + [OddValue(oddity, robot.deviations[oddity.rule], robot.heard_s) for oddity in shown]


def _message(robot: Robot, raw: bytes) -> dict[str, Any] | None:
    """A message with the UUID as which it was read, since the sender may use a name. None if there is no message.

    Of a long one only its length is shown: who asks for all robots gets those of thousands.
    """
    if len(raw) > MOST_SHOWN_BYTES:
        return {"uuid": robot.uuid, "too_long_bytes": len(raw)}
    return FRONT_ENDS[robot.language].document(raw) | {"uuid": robot.uuid} if raw else None


def _placement(robot: Robot) -> dict[str, Any]:
    """The part of a robot's document that is in the floor's frame. All None before its first status."""
    if not (robot.seen and robot.frame and robot.forecast):
        return {"floor": None, "location": None, "envelope": None, "forecast": None}
    forecast, seen = robot.forecast, robot.seen
    return {
        "floor": robot.frame.floor,
        "comparable": robot.frame.comparable,
        "location": {"x": seen.x_m, "y": seen.y_m, "yaw_rad": None if isnan(seen.yaw_rad) else seen.yaw_rad},
        "event_s": seen.t_s,
        "doubt_m": robot.doubt_m,
        "envelope": {
            "length_m": forecast.length_m,
            "width_m": forecast.width_m,
            "height_m": forecast.top_m - forecast.bottom_m if isfinite(forecast.top_m) else None,
        },
        "forecast": {
            "basis": Basis(forecast.basis).name.lower(),
            "reach_m": round(dist(forecast.knots[0][1:3], forecast.knots[-1][1:3]), 3),
            "knots": [[round(float(value), 3) for value in knot] for knot in forecast.knots],
        },
    }


def unidentified(fleet: Fleet) -> list[str]:
    """UUIDs of the robots that have not sent an identity report."""
    return [uuid for uuid, robot in fleet.robots.items() if robot.identity is None]


def shared_identities(fleet: Fleet, after_s: float) -> list[SharedIdentity]:
    """The identity reports that arrived here after `after_s`, oldest first."""
    all_known = (robot.shared_identity for robot in fleet.robots.values() if robot.shared_identity)
    newer = (known for known in all_known if known.arrival_s > after_s and not known.elsewhere)
    return sorted(newer, key=attrgetter("arrival_s"))


def lacks(fleet: Fleet, shared_identity: SharedIdentity) -> bool:
    """Whether the robot is here and has not sent this identity report or a newer one."""
    robot = fleet.robots.get(shared_identity.uuid)
    return robot is not None and shared_identity.is_news_to(robot.shared_identity)


def add_identity(fleet: Fleet, shared_identity: SharedIdentity, arrival_s: float, connection: Connection) -> str | None:
    """Process an identity report that arrived at another ingest. Returns what `Fleet.receive` returns."""
    rule = fleet.receive(shared_identity.raw, arrival_s, connection)
    if rule is None:
        fleet.robots[shared_identity.uuid].shared_identity = shared_identity
    return rule
