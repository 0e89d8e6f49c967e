"""Which vendor a robot belongs to, and whether a message about it is accepted from its sender."""

from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import replace

from ingest.fleet.owners.admission import Admission
from ingest.fleet.owners.departures import OffFloor
from ingest.fleet.owners.kept_bytes import KeptBytes
from ingest.fleet.owners.language_choice import LanguageChoice
from ingest.fleet.owners.owner_register import OwnerRegister
from ingest.fleet.owners.ownership_claims import OwnershipClaims
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.robot import Robot
from ingest.fleet.shared_identities import INTRODUCER
from ingest.languages.front_end import TopicSender
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.model import Identity, Rejection, Status, Update
from ingest.port.connection import Connection
from ingest.settings import UNKNOWN

NAMED = "uuid-is-name"
"""The finding of a message that has a name in place of a UUID."""


class RobotOwners:
    """Settles the vendor of each robot. Refused reports go to `claims`."""

    def __init__(self, vendors: VendorRegistry, max_robots_per_vendor: int, claims: OwnershipClaims) -> None:
        self.vendors, self._max_robots_per_vendor, self._claims = vendors, max_robots_per_vendor, claims
        self._languages = LanguageChoice()
        self.register = OwnerRegister(lambda vendor: self.vendors.configured(vendor))  # noqa: PLW0108 - it is replaced
        self.admission = Admission()
        self.kept_bytes = KeptBytes()
        self.off_floor = OffFloor()
        self._robot_counts: Counter[str] = Counter()
        """How many robots each vendor has."""
        self._vendors_heard: defaultdict[int, set[str]] = defaultdict(set)
        """By number of a connection that speaks for no vendor: the vendors of the robots that report over it."""

    def with_vendor(self, connection: Connection, sender: TopicSender | None) -> Connection:
        """The connection, with the vendor of the manufacturer that its topic names if it has none."""
        if connection.vendor or sender is None or not sender.manufacturer:
            return connection
        vendor = self.vendors.of_manufacturer(sender.manufacturer)
        return replace(connection, vendor=vendor, proven=self.vendors.configured(vendor))

    def names_as_uuid(self, connection: Connection) -> str | None:
        """The vendor of the connection if its robots may send names as UUIDs; None otherwise."""
        vendor = connection.vendor
        return vendor if vendor and self.vendors.settings(vendor).names_as_uuid else None

    def named_vendor(self, robot: Robot) -> str | None:
        """The vendor of a known robot if its robots may send names as UUIDs; None otherwise."""
        return robot.vendor if self.vendors.settings(robot.vendor).names_as_uuid else None

    def vendor_of(self, uuid: str, robot: Robot | None, connection: Connection) -> str:
        """The vendor responsible for what a connection reports of a robot. `robot` is None if it is not known yet.

        This is the connection's own vendor if it has one, whoever owns the robot.
        """
        if connection.vendor:
            return connection.vendor
        if robot:
            return robot.vendor
        heard = self._vendors_heard.get(connection.id, set())
        only = next(iter(heard)) if len(heard) == 1 else UNKNOWN
        return self.owner(uuid) or only

    def other_owner(self, uuid: str, robot: Robot | None, speaker: str | None) -> str | None:
        """The vendor that owns the robot, if that is another one than `speaker`. None if there is no conflict."""
        if speaker is None:
            return None
        owner = self.vendors.of_robot(uuid) or (robot.vendor if robot and robot.owned else None)
        owner = owner or self._entered_owner(uuid, speaker)
        return owner if owner != speaker else None

    def _entered_owner(self, uuid: str, speaker: str) -> str | None:
        """The owner in the register. One that the site file does not name has no right against one that it names."""
        owner = self.register.owner(uuid)
        is_weaker = owner and self.vendors.configured(speaker) and not self.vendors.configured(owner)
        return None if is_weaker else owner

    def owner(self, uuid: str) -> str | None:
        """The vendor that alone may report the robot. None if it is not settled."""
        return self.vendors.of_robot(uuid) or self.register.owner(uuid)

    def owner_of_topic(self, connection: Connection) -> str | None:
        """The owner of the robot that the topic of a connection names, if the site file has that vendor."""
        sender = FRONT_ENDS[connection.language].sender(connection.topic)
        owner = self.owner(sender.uuid) if sender else None
        return owner if owner and self.vendors.configured(owner) else None

    def is_named(self, message: Identity | Status | Update, connection: Connection) -> bool:
        """Whether a vendor names its robot. Then the robot is its own: the UUID was derived from vendor and name."""
        is_name = connection.vendor is not None and NAMED in message.findings
        return is_name and self.vendors.of_robot(message.uuid) in (None, connection.vendor)

    def rejection(
        self,
        message: Identity | Status | Update,
        robot: Robot | None,
        connection: Connection,
        sender: TopicSender | None,
        arrival_s: float,
        silent_after_s: float,
    ) -> Rejection | None:
        """Why the message may not come from this sender. None if it may."""
        speaker = self._speaker(message, connection)
        owner = None if self.is_named(message, connection) else self.other_owner(message.uuid, robot, speaker)
        if owner and speaker:
            self._claims.add(message.uuid, owner, speaker, arrival_s)
            reason = (
                f"robot {message.uuid} is {owner}'s; that vendor may report it, or somebody with the role administer "
                f"give it to another: POST /robots/{message.uuid}/owner"
            )
            return Rejection("uuid-of-another-vendor", reason)
        if robot is None and (rejection := self.admission.rejection(connection, is_named=self._is_named(message.uuid))):
            return rejection
        if robot is None and self._is_full(self.vendor_of(message.uuid, None, connection)):
            reason = "the vendor has as many robots as reading.max_robots_per_vendor allows; keep each robot's UUID"
            return Rejection("robots-too-many", reason)
        if robot and not robot.owned and connection.vendor and connection.vendor == self.owner(message.uuid):
            return None  # the owner is heard in its own language, whoever spoke while it was silent
        serial = message.serial if isinstance(message, Identity) else sender.serial if sender else ""
        heard_since_s = arrival_s - silent_after_s
        return self._languages.rejection(message.uuid, robot, connection.language, (speaker, serial), heard_since_s)

    def _speaker(self, message: Identity | Status | Update, connection: Connection) -> str | None:
        """The vendor that a message speaks for. None if neither the connection nor the message says it."""
        if connection.vendor or not isinstance(message, Identity) or self.vendors.of_robot(message.uuid):
            return connection.vendor
        return self.vendors.of_manufacturer(message.manufacturer)

    def _is_full(self, vendor: str) -> bool:
        return self._robot_counts[vendor] >= self._max_robots_per_vendor

    def add(self, robot: Robot) -> None:
        """Count a new robot."""
        self._robot_counts[robot.vendor] += 1
        self._languages.note(robot)

    def remove(self, robot: Robot) -> None:
        """Count a robot no more."""
        self._enter(robot)
        self._robot_counts[robot.vendor] -= 1
        self._languages.remove(robot)
        self.admission.forget(robot)

    def examines(self, robot: Robot, connection: Connection, arrival_s: float) -> bool:
        """Whether a robot that was not examined is so from now on. What another ingest passes on decides nothing."""
        if connection.peer == INTRODUCER:
            return False
        self.admission.consider(robot, connection, arrival_s, is_named=self._is_named(robot.uuid))
        return robot.examined

    def _is_named(self, uuid: str) -> bool:
        """Whether the site file names the robot."""
        return self.vendors.of_robot(uuid) is not None

    def assign_by_connection(self, robot: Robot, message: Identity | Status | Update, connection: Connection) -> None:
        """Give a robot without owner to the vendor of the connection. An identity report makes it owned too.

        A message that was kept for a restart only says which vendor it is probably of.
        """
        if robot.owned:
            return
        if connection.vendor:
            self._assign(robot, self.vendors.of_robot(robot.uuid) or connection.vendor)
        is_settled = connection.vendor is not None or isinstance(message, Identity)
        robot.owned = connection.settles_owners and is_settled
        self._enter(robot)

    def assign_by_identity(self, robot: Robot, identity: Identity, connection: Connection) -> bool:
        """Give a robot to the vendor that its identity report names. Returns whether the site file assigns it."""
        assigned = self.vendors.of_robot(robot.uuid)
        self._assign(robot, assigned or connection.vendor or self.vendors.of_manufacturer(identity.manufacturer))
        self._enter(robot)
        return assigned is not None

    def note_sender(self, robot: Robot, connection: Connection) -> None:
        """Note that the robot reports over the connection."""
        if not connection.vendor:
            self._vendors_heard[connection.id].add(robot.vendor)

    def connection_closed(self, connection: Connection) -> None:
        self._vendors_heard.pop(connection.id, None)

    def reconfigure(self, vendors: VendorRegistry, max_robots_per_vendor: int, robots: Iterable[Robot]) -> None:
        """Use other settings from now on, and settle all robots by them.

        A robot of a vendor that is no longer configured may be settled by the next vendor that reports it.
        """
        before, self.vendors, self._max_robots_per_vendor = self.vendors, vendors, max_robots_per_vendor
        self.register.settle(lambda vendor: vendors.settled_name(vendor, was_configured=before.configured(vendor)))
        for robot in robots:
            self._assign_again(robot, before)

    def _assign_again(self, robot: Robot, before: VendorRegistry) -> None:
        vendor = self.vendors.of_robot(robot.uuid)
        if vendor is None and not self.vendors.configured(robot.vendor):
            vendor = self.vendors.of_manufacturer(robot.identity.manufacturer) if robot.identity else robot.vendor
            removed = before.configured(robot.vendor) and not self.vendors.configured(vendor)
            robot.owned = robot.owned and not removed
        if vendor:
            self._assign(robot, vendor)

    def _enter(self, robot: Robot) -> None:
        if robot.owned and robot.vendor != UNKNOWN:
            self.register.enter(robot.uuid, robot.vendor)

    def _assign(self, robot: Robot, vendor: str) -> None:
        self._robot_counts[robot.vendor] -= 1
        self._robot_counts[vendor] += 1
        robot.assign_vendor(vendor)
        self._languages.note(robot)
