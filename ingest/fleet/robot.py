"""The state of one robot, as its messages report it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import nan

from deconflict_client.participant_kinds import ParticipantKind
from ingest.batch import NO_AMOUNTS, Amounts, Floats
from ingest.clocks import SenderClock
from ingest.fleet.prediction.forecast_model import NO_STOPS, Forecast, ForecastContext, Sighting
from ingest.fleet.prediction.hand_moves import HandMove
from ingest.fleet.prediction.heading_sense import Sense
from ingest.fleet.prediction.held_poses import HeldPoses
from ingest.fleet.prediction.pace import SPACED_S, Pace
from ingest.fleet.prediction.position_unit import UnitMoves
from ingest.fleet.shared_identities import SharedIdentity
from ingest.fleet.shown.odd_values import Oddities, OddValues
from ingest.frames.frame_registry import Frame
from ingest.languages.front_ends import FRONT_ENDS, MASSROBOTICS
from ingest.languages.model import Identity, Status
from ingest.languages.visible_text import visible
from ingest.port.connection import Connection
from ingest.sizes.stated_bodies import BodyReading
from ingest.sizes.stated_loads import NO_LOADS, LoadsReading, StatedLoad


@dataclass(slots=True, eq=False)
class Robot:
    """The newest messages of one robot, and what is derived from them."""

    uuid: str
    vendor: str
    clock: SenderClock
    language: str = MASSROBOTICS
    """The language of its messages."""
    serial: str = ""
    """The serial number that its topics have; "" if they have none."""
    memory: object = None
    """What its language keeps of it between two messages."""
    name: str = field(init=False)
    """What a person calls the robot."""
    model: str = field(init=False)
    """As its vendor names it; "" before it has identified itself."""
    participant: ParticipantKind = "robot"
    """What it stands for, by the settings with which it was forecast."""
    identity: Identity | None = None
    shared_identity: SharedIdentity | None = None
    """The report that its identity was read from."""
    status_raw: bytes = b""
    """The bytes of its newest status."""
    status_from: Connection | None = None
    """The connection over which that came."""
    state: str = ""
    """Operational state as the schema spells it, or as the sender does if the standard does not have it."""
    known_state: bool = True
    """Whether the standard has this state."""
    statuses: int = 0
    """How many statuses came since the robot was last in a batch."""
    first_arrival_s: float = nan
    """When the first of them arrived."""
    arrival_s: float = nan
    """When its newest status arrived; before the first, when its first message did."""
    heard_s: float = nan
    """When its newest message of any kind arrived."""
    came_s: float = nan
    """When its first one did, of those that this fleet knows: after a restart, of those that were kept."""
    rejected: int = 0
    """How many messages were rejected since its newest status."""
    rejected_s: float = nan
    """When the newest of them arrived."""
    rejected_reason: str = ""
    """What was wrong with it."""
    seen: Sighting | None = None
    """The newest sighting, reconciled with the one before it."""
    before: Sighting | None = None
    """The one with which that was reconciled."""
    between: Sighting | None = None
    """The one that follows `before` once it is old enough, if they come fast."""
    moved: HandMove | None = None
    """The last move that it can't have driven."""
    is_outdated: bool = False
    """Whether an update came that its forecast does not have yet."""
    astray_m: float = 0.0
    """How far it has driven while its order, on a map that nobody has, led elsewhere."""
    was_blocked: bool = False
    """Whether it could not move, by its newest status."""
    held: HeldPoses = field(default_factory=HeldPoses)
    """How long it holds its poses while it drives."""
    pace: Pace = field(default_factory=Pace)
    """How fast it was seen to drive and to turn."""
    unit_moves: UnitMoves | None = None
    """Its newest moves, if these show that its positions are in another unit."""
    sense: Sense = field(default_factory=dict)
    """What its moves show of the way in which its heading is meant."""
    frame: Frame | None = None
    """The frame in which it reported that sighting."""
    forecast: Forecast | None = None
    trailer_yaws_rad: tuple[float, ...] = ()
    """The headings of its trailers at the newest sighting."""
    stops: Floats = field(default_factory=lambda: NO_STOPS)
    """The destinations ahead, as `prediction.forecast.stops` returns them."""
    doubt_m: float = 0.0
    """How far off its position may be."""
    reports_within_s: float = 0.0
    """Its next status may come as late as this by the rules of its language; 0 if there is no such rule."""
    amounts: Amounts = NO_AMOUNTS
    """Those of its newest status."""
    owned: bool = False
    """Whether its vendor is settled: it identified itself, or reported over a connection of that vendor."""
    examined: bool = False
    """Whether it is compared with others; see `admission`."""
    context: ForecastContext | None = None
    """How its messages are read; None if settings or identity may have changed."""
    context_key: tuple[bool, str, tuple[StatedLoad, ...]] = (False, "", ())
    """What the context depends on: whether the robot is loaded, its datum, and its loads."""
    size: BodyReading | None = None
    """How the size in its identity is read."""
    loads: LoadsReading = NO_LOADS
    """How its loads in the context are read."""
    uuid_as_sent: bytes = b""
    """The key of its repeat reader in the fast path; empty if it has none."""
    deviations: dict[str, int] = field(default_factory=dict)
    """By rule, how many of its messages deviated."""
    odd_values: OddValues = field(default_factory=OddValues)
    """The values that show it, as far as they are named."""

    @property
    def source(self) -> str:
        """Who reported its newest status, as `Connection.source` says it; "" before the first."""
        return self.status_from.source if self.status_from else ""

    def hear(self, oddities: Oddities, arrival_s: float) -> None:
        """Take note of an accepted message of any kind."""
        self.heard_s = arrival_s
        self.odd_values.note(oddities, arrival_s)

    def hear_rejected(self, reason: str, arrival_s: float) -> None:
        """Take note of a rejected message."""
        is_further = self.rejected_s >= self.arrival_s
        self.rejected = self.rejected + 1 if is_further else 1
        self.heard_s = self.rejected_s = arrival_s
        self.rejected_reason = reason

    def begin_anew(self, move: HandMove) -> None:
        """It was moved by hand: its next sighting is compared with none before."""
        self.moved, self.seen, self.before, self.between = move, None, None, None
        self.trailer_yaws_rad = ()
        self.pace.begin_anew()

    def compared_with(self, now: Sighting) -> Sighting | None:
        """The earlier sighting with which a new one is compared: the newest if it is at least `SPACED_S` old,
        else one that is. In less time a robot moves by no more than the noise of positions."""
        return self.held.begun(self._spaced_before(now.t_s), now)

    def _spaced_before(self, t_s: float) -> Sighting | None:
        newest, between = self.seen, self.between
        if newest is None or t_s - newest.t_s >= SPACED_S:
            self.between = None
            return newest
        if between and t_s - between.t_s >= SPACED_S:
            self.between = newest
            return between
        self.between = between or newest
        return self.before or newest

    def count(self, findings: Iterable[str]) -> list[str]:
        """Count the deviations that its language knows. Returns these."""
        rules, deviations = FRONT_ENDS[self.language].rules, self.deviations
        known = [rule for rule in findings if rule in rules]
        for rule in known:
            deviations[rule] = deviations.get(rule, 0) + 1
        return known

    def newest_status(self, names_as_uuid: str | None) -> Status | None:
        """Its last message with a pose; None if there is none."""
        return FRONT_ENDS[self.language].status(self.status_raw, self.memory, names_as_uuid)

    def __post_init__(self) -> None:
        self.assign_vendor(self.vendor)

    def assign_vendor(self, vendor: str) -> None:
        """Make it a robot of the vendor, with a name and model from its present identity."""
        self.vendor, self.context = vendor, None
        self.model = self.identity.model if self.identity else ""
        serial = visible(self.identity.serial if self.identity else self.serial or self.uuid[:8])
        self.name = serial if serial.casefold().startswith(vendor.casefold()) else f"{vendor} {serial}"
