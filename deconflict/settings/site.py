"""The settings of a site: everything that a person sets in the site file (`site_file` reads it)."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.outlet_settings import Mqtt, Webhook
from deconflict.settings.shared_places import ContentionSettings, NamedArea, Obstacle, Resource, Zone
from ingest.fleet.owners.device_kinds import has_only_people
from ingest.port.brokers.mqtt_source import MqttSource
from ingest.settings import (
    Count,
    Datum,
    Metres,
    Reading,
    ReceiverSettings,
    RecorderSettings,
    Seconds,
    SecretSource,
    Section,
    Tls,
    Vendor,
)

ClockTime = Annotated[str, Field(pattern=r"^([01]\d|2[0-3]):[0-5]\d$")]
"""Such as "06:00"."""
Role = Literal["read", "answer", "acknowledge", "administer"]


class Conflict(Section):
    """What counts as a conflict, and when it is published."""

    clearance_m: Metres = 0.3
    """Envelopes nearer than this are in conflict. If too large, advisories are many; if too small, they come late."""
    horizon_s: Seconds = 10.0
    """How far ahead conflicts are predicted, at most `reading.horizon_s`. Too short warns late."""
    raise_probability: Annotated[float, Field(gt=0, le=1)] = 0.4
    """Probability from which a conflict is published. Low: early, with many false alerts. High: late or never."""
    confirm: tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]] = (3, 3)
    """[M, N]: an advisory is raised if M of N looks predict it. [1, 1] raises at the first look, also false ones."""
    urgent_s: Seconds = 2.0
    """A conflict nearer than this needs no confirmation. If too long, single false looks raise advisories."""
    evident_probability: Annotated[float, Field(gt=0, le=1)] = 0.5
    """A conflict more likely than this needs no confirmation. With 1 all need it, which warns a second later."""
    clear_after_s: Seconds = 3.0
    """An advisory is cleared once it has not been predicted for this long. If too short, advisories flicker."""
    clear_margin_m: Metres = 0.1
    """An encounter ends once the pair is so far beyond the clearance. With 0, advisories flicker."""
    warning_s: Seconds = 5.0
    """A conflict nearer than this is a warning; otherwise it is a caution."""
    critical_s: Seconds = 2.0
    """A conflict nearer than this is critical. Not above `warning_s`."""
    silent_growth_mps: Metres = 0.05
    """How fast a quiet robot's uncertainty grows on every side, metres a second. With 0, old poses stay trusted."""
    silent_growth_limit_m: Metres = 1.0
    """Limit of that growth. If too large, one silent robot is in conflict with a whole aisle."""

    @property
    def apart_m(self) -> float:
        """A pair that comes no nearer than this has drawn apart: its encounter is over."""
        return self.clearance_m + self.clear_margin_m


class Advice(Section):
    """Limits of the advice, and the effort of the solver."""

    effort: Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)] = 0.1
    """Limit of one solve, in the solver's deterministic time: about seconds of one processor."""
    longest_hold_s: Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)] = 15.0
    """No robot is advised to wait longer. If too short, the advice for many conflicts is another route."""
    switch_s: Seconds = 2.0
    """Advice changes to another robot only if it saves so much. With 0, advice flickers."""


USUAL_ADVICE = Advice()


class EngineSettings(Section):
    """The pace of the engine."""

    tick_s: Annotated[float, Field(ge=0.01, le=2, allow_inf_nan=False)] = 0.08
    """Shortest time between two passes. Passes that cost much are up to 0.1 s apart, and so are those without news."""
    deadline_s: Annotated[float, Field(gt=0, le=60, allow_inf_nan=False)] = 0.5
    """A pass that takes longer is late. If passes stay late, the engine computes less."""


class Person(Section):
    """A person who may use the operators' port."""

    name: str
    """Name of a person, or of a service of the site."""
    role: Role = "read"
    """`read` sees everything, `answer` may also answer advice, `acknowledge` also advisories, `administer` may also
    reload the site file."""
    vendor: str | None = None
    """The vendor for whose robots this person or program answers advice. Required for the role `answer`."""
    token: SecretSource
    """Source of this person's bearer token, `file:PATH` or `env:NAME`."""

    @model_validator(mode="after")
    def _check_vendor(self) -> Self:
        if self.role == "answer" and not self.vendor:
            raise PydanticCustomError("vendor", "the role answer needs a vendor: name whose robots it answers for")
        return self


class Operator(Section):
    """The operators' port: API, stream, metrics."""

    host: str = "127.0.0.1"
    """Address to listen on; "0.0.0.0" for all addresses of this machine."""
    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    """Port to listen on; 0 for any free port."""
    stream_send_timeout_s: Seconds = 10.0
    """A subscriber is disconnected if a message to it takes longer."""
    people: tuple[Person, ...] = ()
    """People with access. If there is any, nobody else has access."""
    tls: Tls | None = None
    """Certificates for `https://` and `wss://`; without them the port serves plain `http://`."""


class StoreSettings(Section):
    """Storage of recordings and advisories."""

    directory: str = "data"
    """Data directory, relative to the working directory. Two services must not share one."""
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = 30.0
    """How long a cleared advisory is kept; open ones stay."""
    advisories_bytes: Count = 4 << 30
    """Above this size of the database cleared advisories are removed, the oldest of the vendors with most first."""


class LossSettings(Section):
    """The ledger of the time that robots lose to each other."""

    keep_days: Annotated[float, Field(gt=0, le=36_500)] = 100.0
    """How long an hour of the ledger is kept."""
    most_bytes: Count = 1 << 30
    """Above this size of the ledger its oldest hours are removed."""
    currency: str = ""
    """Unit of the costs, such as "EUR"."""
    cost_per_robot_hour: dict[str, Annotated[float, Field(ge=0, allow_inf_nan=False)]] = {}  # noqa: RUF012 - pydantic copies it
    """What an hour of a robot costs, by vendor ("Alder") or by vendor and model ("Alder/A100")."""


class BlackBox(Section):
    """A file for each near miss with what was received and decided, for replays; needs `recorder.enabled`."""

    enabled: bool = True
    """Whether black boxes are written."""
    before_s: Seconds = 60.0
    """Time before a near miss that its file covers."""
    after_s: Seconds = 60.0
    """Time after a near miss that its file covers."""
    files: Count = 500
    """Most files; the oldest are removed first."""
    total_bytes: Count = 1024 * 1024 * 1024
    """Largest size of all files; the oldest are removed first."""
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = 30.0
    """Files older than this are removed."""


class Site(Section):
    """One site. Without a file all defaults hold, and every datum that robots name is a floor of its own."""

    name: str = "site"
    """Name of the site for people."""
    shifts_begin: Annotated[tuple[ClockTime, ...], Field(min_length=1)] = ("06:00", "14:00", "22:00")
    """Local times at which shifts begin: what is said of the worst places stands for a shift."""
    datums: tuple[Datum, ...] = ()
    """Floors that several vendors share."""
    vendors: tuple[Vendor, ...] = ()
    """Vendors that need settings beyond what their messages contain."""
    resources: tuple[Resource, ...] = ()
    """Docks, chargers, stations, lifts and parking that robots share."""
    zones: tuple[Zone, ...] = ()
    """Crossings, single-lane aisles and doors that robots share."""
    areas: tuple[NamedArea, ...] = ()
    """Parts of the floors that people have a name for, or that robots should keep clear."""
    obstacles: tuple[Obstacle, ...] = ()
    """Racks, walls and machines, which the map draws, and onto which advice sends no robot."""
    mqtt_sources: tuple[MqttSource, ...] = ()
    """Brokers whose robots are heard."""
    receiver: ReceiverSettings = ReceiverSettings()
    recorder: RecorderSettings = RecorderSettings()
    reading: Reading = Reading()
    conflict: Conflict = Conflict()
    advice: Advice = Advice()
    contention: ContentionSettings = ContentionSettings()
    engine: EngineSettings = EngineSettings()
    operator: Operator = Operator()
    webhooks: tuple[Webhook, ...] = ()
    """Addresses that advisories are posted to."""
    mqtt: Mqtt | None = None
    """A broker that retains the open advisories."""
    store: StoreSettings = StoreSettings()
    cluster: Cluster | None = None
    """Settings of a cluster of machines; without them the service runs on this machine alone."""
    losses: LossSettings = LossSettings()
    blackbox: BlackBox = BlackBox()

    @property
    def keeps_boxes(self) -> bool:
        """Whether black boxes are written."""
        return self.blackbox.enabled and self.recorder.enabled

    @property
    def people(self) -> frozenset[str]:
        """Names of the vendors of which every device is carried by a person on foot."""
        return frozenset(vendor.name for vendor in self.vendors if has_only_people(vendor))


DEFAULT = Site()
