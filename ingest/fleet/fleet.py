"""The state of all robots: messages in, batches of forecasts out.

Pure: `receive` gets a message and the time at which it arrived, `next_batch` gets the time of a tick. The same calls in
the same order give the same batches, whether they come from sockets or from a recording.

`Fleet.receive` shows what happens to a message: it is read, checked against the owner of its robot, given a time on the
service's clock, placed on a floor, forecast, and counted.
"""

from collections import OrderedDict
from collections.abc import Callable
from itertools import takewhile
from typing import TYPE_CHECKING

from ingest.batch import Batch
from ingest.clocks import SenderClock
from ingest.fleet.batch_builder import batch
from ingest.fleet.owners import language_choice
from ingest.fleet.owners.departures import Departures
from ingest.fleet.owners.kept_bytes import UNMEASURED_BYTES
from ingest.fleet.owners.ownership_claims import OwnershipClaims
from ingest.fleet.owners.robot_owners import RobotOwners
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.placement import Placement
from ingest.fleet.prediction import plausibility
from ingest.fleet.repeat_readers import RepeatReaders
from ingest.fleet.robot import Robot
from ingest.fleet.shared_identities import SharedIdentity
from ingest.fleet.shown.quarantine import Quarantine, rejected_message
from ingest.frames.floor_index import NOWHERE
from ingest.frames.frame_registry import FrameRegistry
from ingest.languages.front_end import TopicSender
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.model import Identity, Message, Rejection, Status, Update
from ingest.measures.clock_changes import ClockChanges
from ingest.measures.measures import Measures
from ingest.measures.message_rates import MessageRates
from ingest.port.connection import Connection
from ingest.recording.log_reader import Received
from ingest.settings import UNKNOWN, Reading

if TYPE_CHECKING:  # a receiver starts without numba
    from ingest.fast_path.status_scanner import ScannedStatus
    from ingest.fleet.repeat_status import FastPath, RepeatReader


class Fleet:
    """All robots. Counts messages and deviations in `measures`; rejected messages go to `quarantine`."""

    def __init__(
        self,
        vendors: VendorRegistry,
        frames: FrameRegistry,
        reading: Reading,
        measures: Measures,
        quarantine: Quarantine,
    ) -> None:
        self.reading, self.site_floors, self.measures, self.quarantine = reading, frames.floors, measures, quarantine
        self.robots: OrderedDict[str, Robot] = OrderedDict()
        """By UUID, those heard from longest ago first."""
        self._changed: dict[str, Robot] = {}
        """By UUID, the robots with a forecast that was in no batch yet."""
        self.newest: Robot | None = None
        """The robot of the newest message that was accepted."""
        self.newest_deviates = False
        """Whether that message deviates from any rule."""
        self._claims = OwnershipClaims()
        self.owners = RobotOwners(vendors, reading.max_robots_per_vendor, self._claims)
        self.off_floor = self.owners.off_floor
        self._left: list[str] = []
        """UUIDs of robots that were dropped since the last batch."""
        self.note_identity: Callable[[str], object] = lambda _: None
        """Called with the UUID of each robot that has another identity than before, or is kept no longer."""
        self.placement = Placement(vendors, frames, reading)
        self._repeat_readers: RepeatReaders | None = None
        self.clock_changes, self.message_rates = ClockChanges(), MessageRates()

    def use(self, fast_path: "FastPath") -> None:
        """Read plain messages with compiled code from now on. The results stay the same."""
        self._repeat_readers = RepeatReaders(fast_path, self.owners.names_as_uuid)

    def receive(self, raw: bytes, arrival_s: float, connection: Connection) -> str | None:
        """Process one message. Returns the code of the rule that rejects it; None if it is accepted."""
        readers, scanned = self._repeat_readers if len(raw) <= UNMEASURED_BYTES else None, None
        if connection.topic:
            return self._receive_from_topic(raw, arrival_s, connection)
        if readers and (scanned := readers.scan(raw)) and (reader := readers.find(scanned, connection)):
            self._receive_repeat(reader, scanned, arrival_s)
            return None
        named, front_end = self.owners.names_as_uuid(connection), FRONT_ENDS[connection.language]
        message: Message = scanned.message(named) if scanned else front_end.read(raw, "", None, named)[0]
        rule, robot = self._take_in(message, raw, arrival_s, connection)
        if readers and scanned and robot:
            readers.replace(robot, scanned, connection)
        return rule

    def receive_recorded(self, message: Received) -> str | None:
        """Process a message of a log. Whether its robot is examined was decided when it arrived."""
        admission = self.owners.admission
        admission.recorded = not message.waits
        rule = self.receive(message.raw, message.arrival_s, message.connection)
        admission.recorded = None
        return rule

    def _receive_from_topic(self, raw: bytes, arrival_s: float, connection: Connection) -> str | None:
        front_end = FRONT_ENDS[connection.language]
        sender = front_end.sender(connection.topic)
        connection = self.owners.with_vendor(connection, sender)
        known = self.robots.get(sender.uuid) if sender else None
        before = known.memory if known and known.language == connection.language else None
        named = self.owners.names_as_uuid(connection)
        message, memory = front_end.read(raw, connection.topic, before, named, arrival_s)
        return self._take_in(message, raw, arrival_s, connection, memory, sender)[0]

    def _take_in(
        self,
        message: Message,
        raw: bytes,
        arrival_s: float,
        connection: Connection,
        memory: object = None,
        sender: TopicSender | None = None,
    ) -> tuple[str | None, Robot | None]:
        """Process what a message says. Returns the rule that rejects it, or the robot if it is accepted."""
        robot = self.robots.get(message.uuid or "")
        if isinstance(message, Rejection):
            vendor = self.owners.vendor_of(message.uuid or "", robot, connection)
            self.reject(message, raw, arrival_s, connection, vendor=vendor)
            return message.rule, None
        if rejection := self._rejection(message, robot, connection, sender, arrival_s, raw, memory):
            self.reject(rejection, raw, arrival_s, connection)
            if robot and robot.language == connection.language and rejection.rule == language_choice.RULE:
                self._left.append(self._drop(robot))
            return rejection.rule, None
        is_taken_over = robot and robot.vendor != connection.vendor and self.owners.is_named(message, connection)
        if robot and (robot.language != connection.language or is_taken_over):
            self._drop(robot)
            robot = None
        robot = robot or self._admit(message.uuid, arrival_s, connection, sender)
        self.owners.assign_by_connection(robot, message, connection)
        self._consider(robot, connection, arrival_s)
        is_remembered, robot.memory = robot.memory is not memory, memory
        findings: tuple[str, ...] = ()
        if isinstance(message, Identity):
            findings = self._update_identity(robot, message.sized_as(robot.identity), raw, arrival_s, connection)
        elif isinstance(message, Status):
            event_s, findings = self.placement.event_time(robot, message, raw, arrival_s)
            findings += self._update_status(robot, message, raw, arrival_s, event_s, connection)
        elif is_remembered and robot.seen:
            robot.is_outdated, self._changed[robot.uuid] = True, robot
        robot.hear(message.oddities, arrival_s)
        self._accept(robot, connection, message.findings + findings)
        return None, robot

    def _receive_repeat(self, reader: "RepeatReader", scanned: "ScannedStatus", arrival_s: float) -> None:
        """Process a status that may repeat the robot's last one. If it does not, it is read in full."""
        robot, gap_s = reader.robot, arrival_s - reader.robot.arrival_s
        self._consider(robot, reader.connection, arrival_s)
        event_s, findings = self.placement.event_time(robot, scanned, scanned.raw, arrival_s)
        if (read := reader.read(scanned, event_s)) is None:
            status = scanned.message(self.owners.names_as_uuid(reader.connection))
            assert isinstance(status, Status)  # noqa: S101 - its UUID was accepted before
            found, oddities = status.findings, status.oddities
            found += self._update_status(robot, status, scanned.raw, arrival_s, event_s, reader.connection)
        else:
            found, oddities = read
            findings += plausibility.frequency(gap_s, max(self.reading.quiet_after_s, robot.reports_within_s))
            self._note_newest(robot, scanned.raw, arrival_s, reader.connection)
            self._changed[robot.uuid] = robot
        robot.hear(oddities, arrival_s)
        self._accept(robot, reader.connection, found + findings)

    def _rejection(
        self,
        message: Identity | Status | Update,
        robot: Robot | None,
        connection: Connection,
        sender: TopicSender | None,
        arrival_s: float,
        raw: bytes,
        memory: object,
    ) -> Rejection | None:
        """Why a message that could be read is not accepted. None if it is."""
        if isinstance(message, Status) and self.placement.is_in_degrees(message):
            vendor = self.owners.vendor_of(message.uuid, robot, connection)
            if rejection := self.placement.rejection(message, vendor):
                return rejection
        rejection = self.owners.rejection(message, robot, connection, sender, arrival_s, self.reading.silent_after_s)
        return rejection or self.owners.kept_bytes.rejection(message, robot, raw, memory, connection.source)

    def _admit(self, uuid: str, arrival_s: float, connection: Connection, sender: TopicSender | None) -> Robot:
        vendor, clock = self.owners.vendor_of(uuid, None, connection), SenderClock(self.reading.clock_tolerance_s)
        robot = self.robots[uuid] = Robot(uuid, vendor, clock, connection.language, sender.serial if sender else "")
        robot.arrival_s = robot.came_s = arrival_s
        self.owners.add(robot)
        return robot

    def _consider(self, robot: Robot, connection: Connection, arrival_s: float) -> None:
        """Examine the robot from now on, if it may be. Then the next batch has it."""
        if not robot.examined and self.owners.examines(robot, connection, arrival_s):
            self.note_identity(robot.uuid)
            if robot.forecast:
                self._changed[robot.uuid] = robot

    def _update_identity(
        self, robot: Robot, identity: Identity, raw: bytes, arrival_s: float, connection: Connection
    ) -> tuple[str, ...]:
        """Take over an identity. The robot's last status is forecast again with it. Returns the deviations."""
        before, robot.identity, known = robot.identity, identity, robot.shared_identity
        assigned = self.owners.assign_by_identity(robot, identity, connection)
        shared_identity = SharedIdentity.received(identity, raw, arrival_s, connection, robot.vendor, assigned)
        robot.shared_identity = shared_identity
        if not (before and known and identity.says_the_same(before) and shared_identity.is_sent_as(known)):
            self.note_identity(robot.uuid)
        explained = self.placement.judge_size(robot)
        self._forecast_again(robot, self.owners.names_as_uuid(connection))
        for other in filter(None, map(self.robots.get, explained)):
            self.placement.judge_size(other)
            self._forecast_again(other, self.owners.named_vendor(other))
        changed = before is not None and before.distinguishing != identity.distinguishing
        return (*(("identity-changed",) if changed else ()), *(robot.size.rules if robot.size else ()))

    def _update_status(
        self, robot: Robot, status: Status, raw: bytes, arrival_s: float, event_s: float, connection: Connection
    ) -> tuple[str, ...]:
        """Place and forecast the robot by its status, unless it already sent a newer one. Returns the deviations."""
        findings: tuple[str, ...] = ()
        frame, sighting = self.placement.sighting(robot, status, event_s)
        if robot.seen:
            gap_s = arrival_s - robot.arrival_s
            findings += plausibility.frequency(gap_s, max(self.reading.quiet_after_s, robot.reports_within_s))
            if NOWHERE not in (sighting.floor, robot.seen.floor):
                self._claims.add_sighting(robot.uuid, robot.vendor, robot.seen, sighting, gap_s, arrival_s)
            if event_s < robot.seen.t_s:
                return (*findings, "stamp-not-increasing")
            self.off_floor.note_sighting(robot, robot.seen, sighting, self.measures)
        robot.state, robot.known_state = status.state, status.known_state
        robot.amounts, robot.is_outdated = status.amounts, False
        self._note_newest(robot, raw, arrival_s, connection)
        self._changed[robot.uuid] = robot
        return findings + self.placement.forecast(robot, status, frame, sighting, robot.compared_with(sighting))

    def _note_newest(self, robot: Robot, raw: bytes, arrival_s: float, connection: Connection) -> None:
        robot.status_raw, robot.arrival_s, robot.status_from = raw, arrival_s, connection
        self._count_status(robot, arrival_s)
        self.robots.move_to_end(robot.uuid)

    def _count_status(self, robot: Robot, arrival_s: float) -> None:
        if robot.statuses:
            self.measures.count("deconflict_statuses_superseded_total", robot.vendor)
        else:
            robot.first_arrival_s = arrival_s
        robot.statuses += 1

    def _accept(self, robot: Robot, connection: Connection, findings: tuple[str, ...]) -> None:
        self.newest, self.newest_deviates = robot, bool(findings)
        self.owners.note_sender(robot, connection)
        self.measures.count_each("deconflict_deviations_total", robot.vendor, robot.count(findings))
        self.measures.count("deconflict_messages_total", robot.vendor, "accepted")

    def reject(
        self, rejection: Rejection, raw: bytes, arrival_s: float, connection: Connection, *, vendor: str | None = None
    ) -> None:
        """Count a rejected message and keep it in the quarantine. `vendor` replaces that of the connection."""
        vendor = vendor or connection.vendor or UNKNOWN
        if robot := self.robots.get(rejection.uuid or ""):
            robot.hear_rejected(rejection.reason, arrival_s)
        self.measures.count("deconflict_messages_total", vendor, "rejected")
        self.measures.count("deconflict_rejections_total", vendor, rejection.rule)
        self.measures.count_each("deconflict_deviations_total", vendor, rejection.findings)
        self.quarantine.add(rejected_message(raw, rejection, connection.id, arrival_s), vendor, connection.peer)

    def count_overtaken(self, uuid: str, arrival_s: float, connection: Connection) -> None:
        """Count a status of the robot `uuid` that is not read because a newer one has come."""
        robot = self.robots.get(uuid)
        self.measures.count("deconflict_messages_total", self.owners.vendor_of(uuid, robot, connection), "overtaken")
        if robot and not self.owners.other_owner(uuid, robot, connection.vendor):
            self._count_status(robot, arrival_s)

    def give(self, uuid: str, vendor: str) -> None:
        """Let a robot belong to a vendor from now on. It begins anew with the next report of that vendor."""
        if (robot := self.robots.get(uuid)) and robot.vendor != vendor:
            self._left.append(self._drop(robot))
        self.note_identity(uuid)
        self.owners.register.enter(uuid, vendor)

    def reconfigure(self, vendors: VendorRegistry, frames: FrameRegistry, reading: Reading) -> None:
        """Use other settings from now on. The last status of each robot is forecast again with them."""
        self.reading, self.site_floors = reading, frames.floors
        self.placement.reconfigure(vendors, frames, reading)
        self.owners.reconfigure(vendors, reading.max_robots_per_vendor, self.robots.values())
        for robot in self.robots.values():
            self.placement.judge_size(robot)
        for robot in self.robots.values():
            robot.context = robot.before = robot.between = None
            self._forecast_again(robot, self.owners.named_vendor(robot))

    def _forecast_again(self, robot: Robot, names_as_uuid: str | None) -> None:
        """Forecast the robot from its last status, with its present identity and settings."""
        if self.placement.forecast_again(robot, names_as_uuid):
            self._changed[robot.uuid] = robot

    def _reconsider(self) -> None:
        """Forecast the robots that updates have changed, from where they were seen."""
        for robot in [robot for robot in self._changed.values() if robot.is_outdated]:
            robot.is_outdated, status = False, robot.newest_status(self.owners.named_vendor(robot))
            if robot.seen and robot.frame and status:
                robot.state, robot.known_state = status.state, status.known_state
                findings = self.placement.forecast(robot, status, robot.frame, robot.seen, None)
                self.measures.count_each("deconflict_deviations_total", robot.vendor, robot.count(findings))

    def next_batch(self, now_s: float, everything: bool = False) -> Batch:
        """The robots that changed since the last batch, or all with `everything`, and those forgotten."""
        gone = self._forget_silent(now_s)
        self.owners.kept_bytes.forget(uuid for uuid in gone if uuid not in self.robots)
        self.message_rates.observe(now_s, self.measures.values["deconflict_messages_total"])
        self.clock_changes.observe(now_s, ((robot.vendor, robot.clock) for robot in self.robots.values() if robot.seen))
        self._reconsider()
        robots = [robot for robot in (self.robots if everything else self._changed).values() if robot.forecast]
        self._changed = {}
        departures = self.off_floor.departures(robots, self.robots, gone, self.placement.floor_ids, self.measures)
        built = batch(departures, now_s, self.placement.floor_ids, self._claims.standing(now_s))
        for robot in robots:
            robot.statuses = 0
        return built

    def snapshot(self, now_s: float) -> Batch:
        """All robots as they are known now. The next batch does not depend on it."""
        self._reconsider()
        robots = self.off_floor.without([robot for robot in self.robots.values() if robot.forecast])
        return batch(Departures(robots), now_s, self.placement.floor_ids, self._claims.standing(now_s))

    def _forget_silent(self, now_s: float) -> tuple[str, ...]:
        """Forget the robots that were silent for too long. Returns their UUIDs, and those that were dropped before."""
        silent = [*takewhile(lambda robot: now_s - robot.arrival_s > self.reading.forget_after_s, self.robots.values())]
        left, self._left = self._left, []
        for robot in silent:
            left.append(self._drop(robot))
            self.measures.count("deconflict_robots_forgotten_total", robot.vendor)
        return tuple(left)

    def _drop(self, robot: Robot) -> str:
        """Keep a robot no longer. Returns its UUID."""
        if self._repeat_readers:
            self._repeat_readers.remove(robot)
        self.owners.remove(robot)
        self.placement.model_sizes.forget(robot.uuid)
        self.note_identity(robot.uuid)
        self._changed.pop(robot.uuid, None)
        return self.robots.pop(robot.uuid).uuid
