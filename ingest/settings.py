"""Settings of the receiving half: datums, vendors and their maps, sockets, clocks, recording.

Each is a frozen section of the site file (`deconflict/settings/site.py` composes and loads the file). An unknown key is
an error. Every field has a unit in its name, and a sentence that says what it means.
"""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

UNKNOWN = "unknown"
"""The vendor of a robot if neither its identity nor its connection nor the site file names one."""
NIL_DATUM = "00000000-0000-0000-0000-000000000000"

Metres = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Seconds = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Coordinate = Annotated[float, Field(allow_inf_nan=False)]
DatumId = Annotated[str, AfterValidator(str.lower)]
Priority = Annotated[float, Field(gt=0, le=100)]
Envelope = tuple[
    Annotated[float, Field(gt=0, allow_inf_nan=False)],
    Annotated[float, Field(gt=0, allow_inf_nan=False)],
    Metres,
]
"""Length along the heading, width across it and height, metres; height 0 means unknown."""
SecretSource = Annotated[str, Field(pattern=r"^((env|file):.+)?$")]
"""Where a secret is: `env:NAME` or `file:PATH`."""


class Section(BaseModel):
    """A part of the site file: frozen, and an unknown key is an error. Field docstrings go into its JSON Schema."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class ReferencePoint(Section):
    """A datum reference point (standard 3.1): a mark on the floor that every vendor can survey."""

    id: str
    """The UUID, or whatever else the vendors' readings call the point by."""
    name: str = ""
    """What a person calls the point."""
    x: Coordinate
    """In the datum's `coordinates`; latitude where they are degrees."""
    y: Coordinate
    """In the datum's `coordinates`; longitude where they are degrees."""


class FloorPlan(Section):
    """An image of the floor that lies under the map."""

    image: str
    """File of the image, PNG, JPEG, WebP or SVG; relative to where the service is started."""
    readings: dict[str, tuple[Coordinate, Coordinate]]
    """Reference point id to its column and row in the image, pixels from the upper left corner."""
    tolerance_m: Metres = 0.5
    """Largest residual of the fit accepted at a reference point, metres on the floor."""


class Datum(Section):
    """A planar datum (standard 3.2): one floor's common frame."""

    id: DatumId
    """The UUID that messages name it by; case is ignored."""
    name: str
    """What a person calls the floor."""
    level: int = 0
    """The floor of the building; 0 is the ground floor."""
    coordinates: Literal["metres", "latlon", "latlon-relative"] = "metres"
    """What x and y are: metres; latitude and longitude in degrees; or both relative to `reference_location`."""
    reference_location: tuple[Coordinate, Coordinate] | None = None
    """Latitude and longitude of the floor's origin, degrees; needed where `coordinates` are degrees."""
    reference_points: tuple[ReferencePoint, ...] = ()
    """Marks that vendors with a map of their own have surveyed: at least two, better four, spread over the floor."""
    plan: FloorPlan | None = None
    """An image of the floor, placed by the reference points."""


class VendorMap(Section):
    """A vendor's own map: its own readings of a datum's reference points."""

    datum: DatumId
    """The datum id this vendor sends when it speaks in this map; "" if it sends none."""
    site_datum: DatumId
    """The site's datum these readings belong to."""
    readings: dict[str, tuple[Coordinate, Coordinate]]
    """Reference point id to the x, y the vendor's map gives it, in that map's own unit of length."""
    mirrored: bool = False
    """True if the vendor's frame is left-handed as seen from above (y to the right of x)."""
    tolerance_m: Metres = 0.25
    """Largest residual of the global fit accepted at a reference point, metres on the floor."""


class Model(Section):
    """What the standard cannot say about a robot model."""

    envelope_m: Envelope | None = None
    """Replaces the envelope the robot reports."""
    offset_m: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    """Envelope centre relative to the reported location, along the heading and to its left."""
    loaded_envelope_m: Envelope | None = None
    """Envelope while any load is carried."""
    loaded_offset_m: tuple[Coordinate, Coordinate] | None = None
    """Centre of `loaded_envelope_m`; `offset_m` if absent."""
    priority: Priority | None = None
    """What a second of its waiting counts in advice; the vendor's if absent."""


class Vendor(Section):
    """One vendor: how to know its robots and how to read them."""

    name: str
    """A short name; it labels metrics and advisories."""
    manufacturers: tuple[str, ...] = ()
    """Values of `manufacturerName` that mean this vendor; its own name always does. Case is ignored."""
    participant: Literal["robot", "person"] = "robot"
    """What moves: robots, or people who carry a device."""
    priority: Priority | None = None
    """What a second of its robots' waiting counts in advice; if absent 1, and 10 for people, to whom robots yield."""
    default_envelope_m: Envelope | None = None
    """Envelope of a robot that has not identified itself; the site's default if absent."""
    models: dict[str, Model] = {}
    """What the standard cannot say of each model, by `robotModel` as identity reports spell it."""
    maps: tuple[VendorMap, ...] = ()
    """Maps of its own that it speaks in; without any, it sends in the datums' coordinates."""
    robots: tuple[str, ...] = ()
    """UUIDs that belong to this vendor whether or not they identify themselves."""
    names_as_uuid: bool = False
    """Accept robot names where a UUID belongs, each under a UUID derived from vendor and name."""
    dial: tuple[str, ...] = ()
    """`ws://` addresses of fleet managers to connect to."""
    token: SecretSource = ""
    """Where this vendor's bearer token is. Once one vendor has credentials, every connection needs some."""
    certificate_names: tuple[str, ...] = ()
    """Common or DNS names of this vendor's client certificates, signed by the authority in `receiver.tls.clients`."""


class Tls(Section):
    """The site's own certificates, PEM files; changed ones are read without a restart."""

    certificate: str
    """The server's certificate, with any intermediate ones."""
    key: str = ""
    """Its private key; in the file of the certificate if absent."""
    clients: str = ""
    """The authorities that sign clients' certificates; without it none are asked for."""


class ReceiverSettings(Section):
    """The robots' port."""

    host: str = "127.0.0.1"
    """Address to listen on; "0.0.0.0" for all of this machine's."""
    port: Annotated[int, Field(ge=0, le=65535)] = 3000
    """0 takes any free port."""
    max_message_bytes: Annotated[int, Field(gt=0)] = 65536
    """A longer message is refused and its connection closed."""
    open_timeout_s: Seconds = 5.0
    """How long a connection may take to open, and its handshake of TLS before that."""
    idle_timeout_s: Seconds = 120.0
    """A connection that has sent nothing for this long is closed; unanswered pings never close one."""
    max_connections: Annotated[int, Field(gt=0)] = 12000
    """Most connections at once; fewer where the limit of open files is lower."""
    max_connections_per_peer: Annotated[int, Field(gt=0)] = 10000
    """The same for one address; a sender that never closes its connections is stopped here."""
    max_messages_per_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 5000.0
    """Messages a second that a vendor may send. If a connection's vendor is not known, its address has this share."""
    tls: Tls | None = None
    """Serve `wss://` with these certificates; plain `ws://` if absent."""
    dial_backoff_s: tuple[Seconds, Seconds] = (0.5, 30.0)
    """First and longest wait between attempts to reach a fleet manager."""


class RecorderSettings(Section):
    """The append-only log of every message and tick."""

    enabled: bool = True
    """Without it nothing can be replayed, and a restart begins with an empty floor."""
    segment_bytes: Annotated[int, Field(gt=0)] = 64 * 1024 * 1024
    """The size at which a new segment is begun."""
    total_bytes: Annotated[int, Field(gt=0)] = 4 * 1024 * 1024 * 1024
    """The oldest segments go when the log grows beyond this."""
    keep_days: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 30.0
    """And segments to which nothing was added for this long."""


class Reading(Section):
    """How messages are read where the standard leaves it open."""

    horizon_s: Seconds = 10.0
    """How far ahead a path is used (standard 5.3.3)."""
    destination_horizon_s: Seconds = 900.0
    """How far ahead destinations are used (standard 5.2.3)."""
    default_envelope_m: Envelope = (1.0, 1.0, 0.0)
    """Envelope of a robot that has not identified itself and whose vendor has no default."""
    quiet_after_s: Seconds = 30.0
    """A robot not heard of for this long is quiet (standard 5.4)."""
    silent_after_s: Seconds = 60.0
    """And for this long, silent."""
    forget_after_s: Seconds = 86400.0
    """A robot silent for this long leaves the floor, logged and counted; until then it is an obstacle."""
    max_robots_per_vendor: Annotated[int, Field(gt=0)] = 20000
    """A sender that makes up UUIDs is stopped here; those it has already stay until they are forgotten."""
    clock_tolerance_s: Seconds = 0.25
    """A sender whose clock seems off by less is taken to be right and its messages to be delayed."""
    lost_doubt_m: Metres = 1.0
    """How far off the position of a robot that reports itself lost may be."""
    blocking_errors: tuple[str, ...] = ("stuck", "safety stop", "estop", "e-stop", "emergency stop")
    """Error codes containing one of these (case ignored) make the robot an obstacle where it stands."""
    lost_errors: tuple[str, ...] = ("lost",)
    """Error codes containing one of these make the robot's position doubtful."""
