"""The state of every robot as its messages tell it: bytes in, batches of forecasts out.

Pure: `receive` takes a message and when it arrived, `cut` takes the time of a tick. The same calls in the same
order give the same batches, whether they come from sockets or from a recording.
"""

from collections import Counter, OrderedDict, defaultdict
from collections.abc import Iterable
from math import isfinite, isnan, nan
from operator import attrgetter
from typing import Any

import numpy as np

from ingest.batch import Batch
from ingest.clocks import SenderClock, vendor_offset
from ingest.fleet import plausibility
from ingest.fleet.batch_builder import batch
from ingest.fleet.fast_path_types import FastPath, RepeatReader, ScannedStatus
from ingest.fleet.forecast import Sighting, forecast, matches, stops
from ingest.fleet.introductions import Introduction
from ingest.fleet.ownership_claims import Claims
from ingest.fleet.quarantine import Quarantine, rejected
from ingest.fleet.reading_views import Views
from ingest.fleet.robot import Robot, placed, told
from ingest.fleet.vendor_registry import Vendors
from ingest.frames.floor_index import NOWHERE, Floors
from ingest.frames.frame_registry import Frame, Frames
from ingest.languages.massrobotics import parser
from ingest.languages.model import Identity, Rejection, Status
from ingest.measures import clock_changes
from ingest.measures.measures import Labels, Measures
from ingest.measures.message_rates import MessageRates
from ingest.port.connection import Connection
from ingest.settings import UNKNOWN, Reading

STALE_S = 2.0
"""A status that takes this much longer than the sender's quickest is stale."""


class Fleet:
    """All robots. Counts what it accepts, rejects and finds in `measures`; rejects go to `quarantine`."""

    def __init__(
        self, vendors: Vendors, frames: Frames, reading: Reading, measures: Measures, quarantine: Quarantine
    ) -> None:
        self.vendors, self.reading, self.measures, self.quarantine = vendors, reading, measures, quarantine
        self._frames = frames
        self.robots: OrderedDict[str, Robot] = OrderedDict()
        """By UUID, those heard from longest ago first."""
        self._changed: dict[str, Robot] = {}
        self._clock_changes, self._rates = clock_changes.ClockChanges(), MessageRates()
        self._floors = Floors(frames)
        self._speaking: defaultdict[int, set[str]] = defaultdict(set)
        """Vendors of the robots heard over a connection that speaks for none, by its number."""
        self._of_vendor: Counter[str] = Counter()
        self._claims = Claims()
        self._fast_path: FastPath[Any] | None = None
        self._repeat_readers: dict[bytes, RepeatReader[Any]] = {}
        """By a robot's UUID as sent."""
        self._views = Views(vendors, self._floors, reading)

    def use(self, fast_path: FastPath[Any]) -> None:
        """Read by compiled code from now on, with the same results."""
        self._fast_path = fast_path

    @property
    def reads_fast(self) -> bool:
        return self._fast_path is not None

    def receive(self, raw: bytes, arrival_s: float, connection: Connection) -> str | None:
        """Take one message; the code of the rule that rejected it, or None where it was accepted."""
        scanned = self._fast_path.scan(raw) if self._fast_path else None
        if scanned and (repeat_reader := self._repeat_reader(scanned, connection)):
            self._receive_repeat(repeat_reader, scanned, arrival_s)
            return None
        namer = self._namer(connection)
        message = scanned.message(namer) if scanned else parser.read(raw, names_as_uuid=namer)
        if isinstance(message, Rejection):
            vendor = self._vendor_of(message.uuid or "", connection)
            self._count(vendor, message.findings, None)
            self.refuse(message.rule, message.reason, raw, arrival_s, connection, vendor=vendor)
            return message.rule
        robot = self.robots.get(message.uuid)
        if self._frames.in_degrees and isinstance(message, Status) and not self._has_place(message, connection):
            reason = f"location {message.x}, {message.y} is nowhere on datum {message.datum}; check units and order"
            self.refuse("position-absurd", reason, raw, arrival_s, connection)
            return "position-absurd"
        speaker = self._speaker(message, connection)
        if speaker is not None and (owner := self._other_owner(message.uuid, robot, speaker)):
            self._claims.refused(message.uuid, owner, speaker, arrival_s)
            reason = f"robot {message.uuid} is {owner}'s; that vendor may report it, or the site file name another"
            self.refuse("uuid-of-another-vendor", reason, raw, arrival_s, connection)
            return "uuid-of-another-vendor"
        if robot is None and self._is_full(self._vendor_of(message.uuid, connection)):
            reason = "the vendor has as many robots as reading.max_robots_per_vendor allows; keep each robot's UUID"
            self.refuse("robots-too-many", reason, raw, arrival_s, connection)
            return "robots-too-many"
        robot = robot or self._admit(message.uuid, connection)
        if connection.vendor and not robot.owned:
            self._settle(robot, self.vendors.of_robot(robot.uuid) or connection.vendor)
        robot.owned = robot.owned or isinstance(message, Identity) or connection.vendor is not None
        if isinstance(message, Identity):
            findings = self._identify(robot, message, raw, arrival_s, connection)
        else:
            event_s, findings = self._timed(robot, message.stamp_s, message.stamp_resolution_s, arrival_s)
            findings += self._report(robot, message, raw, arrival_s, event_s)
            if scanned:
                self._renew_repeat_reader(robot, scanned, connection)
        self._accept(robot, connection, message.findings + findings)
        return None

    def _receive_repeat(self, repeat_reader: RepeatReader[Any], scanned: ScannedStatus, arrival_s: float) -> None:
        """Take a status that may repeat the robot's last; read it in full where it does not."""
        robot = repeat_reader.robot
        event_s, findings = self._timed(robot, scanned.stamp_s, scanned.stamp_resolution_s, arrival_s)
        gap_s = arrival_s - robot.arrival_s
        found = repeat_reader.read(scanned, event_s)
        if found is None:
            status = scanned.message(self._namer(repeat_reader.connection))
            assert isinstance(status, Status)  # noqa: S101 - its UUID was accepted before
            found = status.findings + self._report(robot, status, scanned.raw, arrival_s, event_s)
        else:
            findings += plausibility.frequency(gap_s, self.reading.quiet_after_s)
            self._note(robot, scanned.raw, arrival_s)
            self._changed[robot.uuid] = robot
        self._accept(robot, repeat_reader.connection, found + findings)

    def _accept(self, robot: Robot, connection: Connection, findings: tuple[str, ...]) -> None:
        if not connection.vendor:
            self._speaking[connection.id].add(robot.vendor)
        if findings:
            self._count(robot.vendor, findings, robot)
        self.measures.count("deconflict_messages_total", robot.vendor, "accepted")

    def _repeat_reader(self, scanned: ScannedStatus, connection: Connection) -> RepeatReader[Any] | None:
        """The reader of the robot's repeated statuses, renewed where only its texts have changed."""
        repeat_reader = self._repeat_readers.get(scanned.uuid)
        if repeat_reader is None or not repeat_reader.is_valid(connection):
            return None
        if repeat_reader.texts is scanned.texts:
            return repeat_reader
        return self._renew_repeat_reader(repeat_reader.robot, scanned, connection)

    def _renew_repeat_reader(
        self, robot: Robot, scanned: ScannedStatus, connection: Connection
    ) -> RepeatReader[Any] | None:
        self._drop_repeat_reader(robot)
        if self._fast_path is None:
            return None
        repeat_reader = self._fast_path.repeat_reader(robot, scanned, connection, self._namer(connection))
        if repeat_reader:
            robot.uuid_as_sent = scanned.uuid
            self._repeat_readers[robot.uuid_as_sent] = repeat_reader
        return repeat_reader

    def _drop_repeat_reader(self, robot: Robot) -> None:
        if robot.uuid_as_sent:
            self._repeat_readers.pop(robot.uuid_as_sent, None)
            robot.uuid_as_sent = b""

    def refuse(
        self,
        rule: str,
        reason: str,
        raw: bytes,
        arrival_s: float,
        connection: Connection,
        *,
        vendor: str | None = None,
    ) -> None:
        """Count and quarantine a message that can't be understood."""
        vendor = vendor or connection.vendor or UNKNOWN
        self.measures.count("deconflict_messages_total", vendor, "rejected")
        self.measures.count("deconflict_rejections_total", vendor, rule)
        self.quarantine.add(rejected(raw, rule, reason, connection.id, arrival_s), vendor)

    def overtaken(self, uuid: str, arrival_s: float, connection: Connection) -> None:
        """Count a status, said to be of a robot, that is not read because a newer one has come."""
        self.measures.count("deconflict_messages_total", self._vendor_of(uuid, connection), "overtaken")
        robot = self.robots.get(uuid)
        if robot and not self._other_owner(uuid, robot, connection.vendor):
            self._said(robot, arrival_s)

    def closed(self, connection: Connection) -> None:
        """Forget who spoke on a connection; its robots stay."""
        self._speaking.pop(connection.id, None)

    def renew(self, vendors: Vendors, frames: Frames, reading: Reading) -> None:
        """Read by other settings from now on; robots are placed anew from what they said last.

        A robot of a vendor that is no longer configured may be settled by whoever speaks for it next.
        """
        before, self.vendors, self._frames, self.reading = self.vendors, vendors, frames, reading
        self._floors.renew(frames)
        self._views.renew(vendors, reading)
        for robot in self.robots.values():
            robot.view = None
            self._resettle(robot, before)
            self._place_again(robot, robot.vendor if vendors.settings(robot.vendor).names_as_uuid else None)

    def _resettle(self, robot: Robot, before: Vendors) -> None:
        named = self.vendors.of_robot(robot.uuid)
        if named is None and not self.vendors.configured(robot.vendor):
            named = self.vendors.of_manufacturer(robot.identity.manufacturer) if robot.identity else robot.vendor
            taken_out = before.configured(robot.vendor) and not self.vendors.configured(named)
            robot.owned = robot.owned and not taken_out
        if named:
            self._settle(robot, named)

    def cut(self, now_s: float, everything: bool = False) -> Batch:
        """The robots that changed since the last cut, or all of them, and those forgotten."""
        gone = self._forget(now_s)
        self._rates.look(now_s, self.measures.values["deconflict_messages_total"])
        self._clock_changes.look(now_s, ((one.vendor, one.clock) for one in self.robots.values() if one.seen))
        changed = self.robots if everything else self._changed
        robots = [robot for robot in changed.values() if robot.forecast]
        self._changed = {}
        cut = self._batch(robots, now_s, gone)
        for robot in robots:
            robot.statuses = 0
        return cut

    def whole(self, now_s: float) -> Batch:
        """Every robot as it is known now; the next cut is as if nobody had looked."""
        return self._batch([robot for robot in self.robots.values() if robot.forecast], now_s, ())

    def unidentified(self) -> list[str]:
        """UUIDs of the robots that have not said who they are."""
        return [uuid for uuid, robot in self.robots.items() if robot.identity is None]

    def introductions(self, after_s: float) -> list[Introduction]:
        """What robots have said of themselves here after `after_s`, the first first."""
        told = (one.introduction for one in self.robots.values() if one.introduction)
        here = (one for one in told if one.arrival_s > after_s and not one.elsewhere)
        return sorted(here, key=attrgetter("arrival_s"))

    def introduce(self, one: Introduction, arrival_s: float, connection: Connection) -> str | None:
        """Take in what a robot said of itself elsewhere, and then; the answer is that of `receive`."""
        rule = self.receive(one.raw, arrival_s, connection)
        if rule is None:
            self.robots[one.uuid].introduction = one
        return rule

    def lacks(self, introduction: Introduction) -> bool:
        """Whether the robot is here and has not said that or something newer of itself."""
        robot = self.robots.get(introduction.uuid)
        return robot is not None and introduction.is_news_to(robot.introduction)

    def _batch(self, robots: list[Robot], now_s: float, gone: tuple[str, ...]) -> Batch:
        return batch(robots, now_s, self._floors.ids, gone, self._claims.standing(now_s))

    def documents(self, now_s: float) -> list[dict[str, Any]]:
        """Everything each robot said and what was made of it, JSON-ready, by UUID."""
        return [self.document(self.robots[uuid], now_s) for uuid in sorted(self.robots)]

    def measure(self, now_s: float) -> None:
        """Bring the levels in `measures` up to date."""
        robots: dict[tuple[str, ...], float] = {}
        ages: dict[str, list[float]] = {}
        clocks: dict[str, list[SenderClock]] = {}
        for robot in self.robots.values():
            key = (robot.vendor, self._shown_state(robot, now_s))
            robots[key] = robots.get(key, 0) + 1
            if robot.seen:
                clocks.setdefault(robot.vendor, []).append(robot.clock)
                ages.setdefault(robot.vendor, []).append(now_s - robot.seen.t_s)
        level = self.measures.level
        level("deconflict_robots", robots)
        level("deconflict_forecast_age_seconds", {(name,): float(np.median(age)) for name, age in ages.items()})
        level("deconflict_clock_offset_seconds", {(name,): vendor_offset(all_) for name, all_ in clocks.items()})
        delays: dict[Labels, float] = {
            (name,): float(np.median([one.delay_s for one in all_])) for name, all_ in clocks.items()
        }
        level("deconflict_clock_delay_seconds", delays)
        level("deconflict_messages_per_second", self._rates.per_s())
        clock_changes.tell(self.measures, {"clock": self._clock_changes.changed()})

    def presence(self, robot: Robot, now_s: float) -> str:
        """`present`, `quiet` or `silent`, by how long ago it was last heard."""
        age_s = now_s - robot.arrival_s
        if age_s > self.reading.silent_after_s:
            return "silent"
        return "quiet" if age_s > self.reading.quiet_after_s else "present"

    def _namer(self, connection: Connection) -> str | None:
        vendor = connection.vendor
        return vendor if vendor and self.vendors.settings(vendor).names_as_uuid else None

    def _vendor_of(self, uuid: str, connection: Connection) -> str:
        """Who answers for what a connection says of a robot: its own vendor where that is told, whosever the robot."""
        if connection.vendor:
            return connection.vendor
        robot = self.robots.get(uuid)
        if robot:
            return robot.vendor
        speaking = self._speaking.get(connection.id, set())
        only = next(iter(speaking)) if len(speaking) == 1 else UNKNOWN
        return self.vendors.of_robot(uuid) or only

    def _other_owner(self, uuid: str, robot: Robot | None, speaker: str | None) -> str | None:
        """The vendor that the robot, if there is one of that UUID, is known to belong to where another speaks of it."""
        owner = self.vendors.of_robot(uuid) or (robot.vendor if robot and robot.owned else None)
        return owner if speaker not in (None, owner) else None

    def _speaker(self, message: Identity | Status, connection: Connection) -> str | None:
        """The vendor that a message speaks for, where that is told."""
        if connection.vendor or isinstance(message, Status) or self.vendors.of_robot(message.uuid):
            return connection.vendor
        return self.vendors.of_manufacturer(message.manufacturer)

    def _admit(self, uuid: str, connection: Connection) -> Robot:
        robot = Robot(uuid, self._vendor_of(uuid, connection), SenderClock(self.reading.clock_tolerance_s))
        self.robots[uuid] = robot
        self._of_vendor[robot.vendor] += 1
        return robot

    def _is_full(self, vendor: str) -> bool:
        return self._of_vendor[vendor] >= self.reading.max_robots_per_vendor

    def _settle(self, robot: Robot, vendor: str) -> None:
        self._of_vendor[robot.vendor] -= 1
        self._of_vendor[vendor] += 1
        robot.settle(vendor)

    def _identify(
        self, robot: Robot, identity: Identity, raw: bytes, arrival_s: float, connection: Connection
    ) -> tuple[str, ...]:
        before = robot.identity
        robot.identity = identity
        assigned = self.vendors.of_robot(robot.uuid)
        self._settle(robot, assigned or connection.vendor or self.vendors.of_manufacturer(identity.manufacturer))
        said_for = connection.vendor, robot.vendor, assigned is not None
        robot.introduction = Introduction(robot.uuid, raw, arrival_s, *said_for)
        if isnan(robot.arrival_s):
            robot.arrival_s = arrival_s
        self._place_again(robot, self._namer(connection))
        changed = before is not None and _who(before) != _who(identity)
        return ("identity-changed",) if changed else ()

    def _timed(
        self, robot: Robot, stamp_s: float, resolution_s: float, arrival_s: float
    ) -> tuple[float, tuple[str, ...]]:
        """When what a status says was true, by what it shows of the sender's clock; and the findings."""
        event_s = robot.clock.take(stamp_s, arrival_s, resolution_s)
        findings: tuple[str, ...] = () if robot.identity else ("identity-missing",)
        if robot.clock.delay_s > STALE_S + resolution_s:
            findings += ("stamp-stale",)
        if abs(robot.clock.offset_s) > self.reading.clock_tolerance_s + resolution_s:
            findings += ("clock-off",)
        return event_s, findings

    def _report(self, robot: Robot, status: Status, raw: bytes, arrival_s: float, event_s: float) -> tuple[str, ...]:
        findings: tuple[str, ...] = ()
        frame, sight = self._sight(robot, status, event_s)
        if robot.seen:
            gap_s = arrival_s - robot.arrival_s
            findings += plausibility.frequency(gap_s, self.reading.quiet_after_s)
            if NOWHERE not in (sight.floor, robot.seen.floor):
                self._claims.seen(robot.uuid, robot.vendor, robot.seen, sight, gap_s, arrival_s)
            if event_s < robot.seen.t_s:
                return (*findings, "stamp-not-increasing")
        robot.state, robot.known_state = status.state, status.known_state
        robot.battery_pct = nan if status.battery_pct is None else status.battery_pct
        robot.run_time_left_s = nan if status.run_time_left_s is None else status.run_time_left_s
        self._note(robot, raw, arrival_s)
        return findings + self._place(robot, status, frame, sight, robot.seen)

    def _note(self, robot: Robot, raw: bytes, arrival_s: float) -> None:
        """That a status came that is the robot's newest."""
        robot.status_raw, robot.arrival_s = raw, arrival_s
        self._said(robot, arrival_s)
        self.robots.move_to_end(robot.uuid)

    def _said(self, robot: Robot, arrival_s: float) -> None:
        if robot.statuses:
            self.measures.count("deconflict_statuses_superseded_total", robot.vendor)
        else:
            robot.first_arrival_s = arrival_s
        robot.statuses += 1

    def _place_again(self, robot: Robot, namer: str | None) -> None:
        """From what it said last, by what is known of it now."""
        status = parser.read(robot.status_raw, names_as_uuid=namer) if robot.seen else None
        if robot.seen and isinstance(status, Status):
            self._place(robot, status, *self._sight(robot, status, robot.seen.t_s), None)

    def _sight(self, robot: Robot, status: Status, event_s: float) -> tuple[Frame, Sighting]:
        """Where the status puts the robot, in the floor's frame; a turn keeps its sense in a left-handed map."""
        frame, floor = self._floors.of(robot.vendor, status.datum)
        x_m, y_m, yaw_rad = frame.pose(status.x, status.y, status.yaw_rad)
        turn_radps = status.turn_rad_per_s or 0.0
        if turn_radps and frame.mirrored:
            turn_radps = -turn_radps
        offset_s = event_s - status.stamp_s
        return frame, Sighting(event_s, floor, x_m, y_m, yaw_rad, status.linear_mps, turn_radps, offset_s)

    def _place(
        self, robot: Robot, status: Status, frame: Frame, sight: Sighting, before: Sighting | None
    ) -> tuple[str, ...]:
        """Put the robot on its floor and forecast it from there."""
        view = self._views.of(robot, bool(status.load_used_pct), status.datum)
        robot.frame = frame
        robot.seen, findings = plausibility.reconcile(before, sight)
        robot.forecast = forecast(status, robot.seen, view)
        robot.stops = stops(status, robot.seen, view)
        lost = status.error_codes and matches(status.error_codes, self.reading.lost_errors)
        robot.doubt_m = self.reading.lost_doubt_m if lost else 0.0
        self._changed[robot.uuid] = robot
        unknown = () if frame.known else ("datum-unknown",)
        too_many = ("datum-too-many",) if frame.comparable and sight.floor == NOWHERE else ()
        return (*findings, *robot.forecast.findings, *unknown, *too_many)

    def _has_place(self, status: Status, connection: Connection) -> bool:
        """Whether the location lies anywhere: degrees may be such as no place has."""
        if status.datum not in self._frames.in_degrees:
            return True
        frame = self._frames.frame(self._vendor_of(status.uuid, connection), status.datum)
        if frame.projection is None:
            return True
        x_m, y_m, _ = frame.pose(status.x, status.y, 0.0)
        return isfinite(x_m) and isfinite(y_m)

    def _forget(self, now_s: float) -> tuple[str, ...]:
        gone = []
        for uuid, robot in self.robots.items():
            if not now_s - robot.arrival_s > self.reading.forget_after_s:
                break
            gone.append(uuid)
        for uuid in gone:
            robot = self.robots.pop(uuid)
            self._drop_repeat_reader(robot)
            vendor = robot.vendor
            self._of_vendor[vendor] -= 1
            self.measures.count("deconflict_robots_forgotten_total", vendor)
            self._changed.pop(uuid, None)
        return tuple(gone)

    def _count(self, vendor: str, findings: Iterable[str], robot: Robot | None) -> None:
        self.measures.count_each("deconflict_deviations_total", vendor, findings)
        if robot:
            deviations = robot.deviations
            for rule in findings:
                deviations[rule] = deviations.get(rule, 0) + 1

    def _shown_state(self, robot: Robot, now_s: float) -> str:
        if self.presence(robot, now_s) == "silent":
            return "silent"
        return robot.state if robot.state and robot.known_state else "other"

    def document(self, robot: Robot, now_s: float) -> dict[str, Any]:
        """One of the `documents`."""
        return {
            "uuid": robot.uuid,
            "name": robot.name,
            "vendor": robot.vendor,
            "participant": self.vendors.settings(robot.vendor).participant,
            "identified": robot.identity is not None,
            "presence": self.presence(robot, now_s),
            "age_s": round(now_s - robot.arrival_s, 3),
            "state": robot.state,
            "clock": {"offset_s": round(robot.clock.offset_s, 3), "delay_s": round(robot.clock.delay_s, 3)},
            "deviations": dict(sorted(robot.deviations.items())),
            "identity": told(robot, robot.introduction.raw if robot.introduction else b""),
            "status": told(robot, robot.status_raw),
            **placed(robot),
        }


def _who(identity: Identity) -> tuple[Any, ...]:
    return identity.manufacturer, identity.model, identity.serial, identity.envelope_m
