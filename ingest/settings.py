"""Settings of this package: datums, vendors and their maps, sockets, clocks, recording.

Each is a frozen section of the site file, which `deconflict/settings/site.py` composes and loads. An unknown key is an
error. A field with a unit names it. The docstring of a field says what it means.
"""

import re
from math import inf
from typing import Annotated, Literal, Self, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from deconflict_client.participant_kinds import ParticipantKind
from deconflict_client.verbs import Verb
from ingest.shapes import MOST_PARTS, MOST_TRAILERS, Corner, ShapePart, outline_fault

UNKNOWN = "unknown"
"""The vendor of a robot that no identity, connection or site file names."""
NIL_DATUM = "00000000-0000-0000-0000-000000000000"

Metres = Annotated[float, Field(ge=0, le=100_000, allow_inf_nan=False)]
Seconds = Annotated[float, Field(gt=0, le=366 * 86_400, allow_inf_nan=False)]
MOST_COUNTED = 1 << 50
Count = Annotated[int, Field(gt=0, le=MOST_COUNTED)]
Coordinate = Annotated[float, Field(allow_inf_nan=False)]
Priority = Annotated[float, Field(gt=0, le=100)]
Size = Annotated[float, Field(gt=0, allow_inf_nan=False)]
"""At most `reading.largest_body_m`, which `ingest/sizes` checks."""
MOST_BODY_M = 100.0
"""Most that this key may be."""
Envelope = tuple[Size, Size, Metres]
"""Length along the heading, width across it, and height, in metres. A height of 0 means unknown."""
SecretSource = Annotated[str, Field(pattern=r"^((env|file):.+)?$")]
"""Source of a secret: `env:NAME` or `file:PATH`."""
_HEX = re.compile(r"[0-9a-f]{32}")


def plain_uuid(text: str) -> str | None:
    """The UUID that a text spells, also without dashes, in braces or after `urn:uuid:`: in lower case with dashes."""
    digits = text.strip().lower().removeprefix("urn:uuid:").strip("{}").replace("-", "")
    if not _HEX.fullmatch(digits):
        return None
    return f"{digits[:8]}-{digits[8:12]}-{digits[12:16]}-{digits[16:20]}-{digits[20:]}"


def _datum_id(text: str) -> str:
    return plain_uuid(text) or text.lower()


DatumId = Annotated[str, AfterValidator(_datum_id)]


class Section(BaseModel):
    """A frozen part of the site file. An unknown key is an error. The JSON Schema has the docstrings of the fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class ReferencePoint(Section):
    """A datum reference point (standard 3.1): a mark on the floor. Every vendor can survey it."""

    id: str
    """Name of the point in the vendors' readings, usually a UUID."""
    name: str = ""
    """Name of the point for people."""
    x: Coordinate
    """x in the `coordinates` of the datum, or the latitude."""
    y: Coordinate
    """y in the `coordinates` of the datum, or the longitude."""


class FloorPlan(Section):
    """An image of the floor, drawn under the map."""

    image: str
    """File of the image: PNG, JPEG, WebP or SVG. The path is relative to the working directory."""
    readings: dict[str, tuple[Coordinate, Coordinate]]
    """Column and row of each reference point in the image, by its id: pixels from the upper left corner."""
    tolerance_m: Metres = 0.5
    """Largest accepted error of the fit at a reference point, metres on the floor."""


class Datum(Section):
    """A planar datum (standard 3.2): the common frame of one floor."""

    id: DatumId
    """The UUID of the datum in messages. Case is ignored."""
    name: str
    """Name of the floor for people."""
    level: int = 0
    """Storey of the building. 0 is the ground floor."""
    coordinates: Literal["metres", "latlon", "latlon-relative"] = "metres"
    """Unit of x and y: metres, latitude and longitude in degrees, or degrees relative to `reference_location`."""
    reference_location: tuple[Coordinate, Coordinate] | None = None
    """Latitude and longitude of the floor's origin, in degrees. Required if `coordinates` are degrees."""
    reference_points: tuple[ReferencePoint, ...] = ()
    """Marks that the vendors have surveyed in their own maps. Two are needed; four across the floor are better."""
    plan: FloorPlan | None = None
    """An image of the floor, placed by the reference points."""


class VendorMap(Section):
    """The map of one vendor: its readings of a datum's reference points."""

    datum: DatumId
    """Datum id in the vendor's messages that use this map. "" if they have none."""
    site_datum: DatumId
    """The site's datum of these reference points."""
    readings: dict[str, tuple[Coordinate, Coordinate]]
    """x and y of each reference point in the vendor's map, by its id, in the unit of that map."""
    mirrored: bool = False
    """True if the vendor's frame is left-handed: seen from above, y is to the right of x."""
    tolerance_m: Metres = 0.25
    """Largest accepted error of the fit at a reference point, metres on the floor."""


def _sound_outline(corners_m: tuple[Corner, ...]) -> tuple[Corner, ...]:
    if fault := outline_fault(corners_m):
        raise PydanticCustomError("footprint", "{fault}", {"fault": fault})
    return corners_m


Footprint = Annotated[tuple[tuple[Coordinate, Coordinate], ...], AfterValidator(_sound_outline)]
"""The corners of a polygon that does not cross itself, in metres: along the heading, and to its left."""


class PartOutline(Section):
    """The outline of a robot, or of a part of it, in the plane."""

    shape: Literal["rectangle", "circle"] = "rectangle"
    """A circle needs `diameter_m`."""
    diameter_m: Size | None = None
    """Diameter of a circle."""
    footprint_m: Footprint | None = None
    """Corners of a polygon in its place, convex or not, at most 32: along the heading, and to its left."""
    offset_m: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    """From the reported location to the centre of the outline: along the heading, and to its left."""

    @model_validator(mode="after")
    def _check_outline(self) -> Self:
        if (self.shape == "circle") != (self.diameter_m is not None):
            raise _fault('shape = "circle" and diameter_m need each other')
        if self.footprint_m and self.diameter_m:
            raise _fault("footprint_m and diameter_m are two shapes; remove one, or use parts")
        return self

    def round_part(self, heights_m: tuple[float, float] = (-inf, inf)) -> ShapePart | None:
        """The circle or polygon, from the reported location; None for a rectangle."""
        if self.diameter_m:
            return ShapePart((self.offset_m,), self.diameter_m / 2, *heights_m)
        ahead_m, left_m = self.offset_m
        outline = tuple((x + ahead_m, y + left_m) for x, y in self.footprint_m or ())
        return ShapePart(outline, 0.0, *heights_m) if outline else None


class Part(PartOutline):
    """A part of a robot: an outline over a range of heights."""

    length_m: Size | None = None
    """Length of a rectangle, along the heading."""
    width_m: Size | None = None
    """Width of a rectangle, across the heading."""
    bottom_m: Metres
    """Height of its bottom above the floor on which the robot stands."""
    top_m: Metres
    """Height of its top."""
    load: bool = False
    """Whether the part is there only while the robot carries a load."""

    @model_validator(mode="after")
    def _check_part(self) -> Self:
        if self.bottom_m >= self.top_m:
            raise _fault(f"bottom_m has to be below top_m = {self.top_m:g}")
        sides = [key for key in ("length_m", "width_m") if getattr(self, key)]
        if len(sides) != (0 if self.footprint_m or self.diameter_m else 2):
            raise _fault("a rectangle needs length_m and width_m, and no other shape has them")
        return self

    def shape_part(self) -> ShapePart:
        """The part, from the reported location."""
        heights_m = self.bottom_m, self.top_m
        box = ShapePart.box(self.offset_m, self.length_m or 0.0, self.width_m or 0.0, *heights_m)
        return self.round_part(heights_m) or box


def _fault(message: str) -> PydanticCustomError:
    return PydanticCustomError("model", "{message}", {"message": message})


class Trailers(Section):
    """The trailers of a tugger train, one behind the other. Each follows the axle of the vehicle ahead."""

    count: Annotated[int, Field(gt=0, le=MOST_TRAILERS)]
    """How many there are."""
    length_m: Size
    """Length of each."""
    width_m: Size
    """Width of each."""
    hitch_m: Size
    """From the axle ahead to that of a trailer, below its middle. The robot's axle is at its reported location."""


class Model(PartOutline):
    """Facts of a robot model that messages do not contain."""

    envelope_m: Envelope | None = None
    """Replaces the envelope that the robot reports. Of a circle or polygon only the height counts."""
    parts: Annotated[tuple[Part, ...], Field(max_length=MOST_PARTS)] = ()
    """Parts at different heights, and loads that overhang. They replace the envelope."""
    trailers: Trailers | None = None
    """Trailers that it pulls."""
    loaded_envelope_m: Envelope | None = None
    """Envelope while the robot carries a load."""
    loaded_offset_m: tuple[Coordinate, Coordinate] | None = None
    """Centre of `loaded_envelope_m`. If absent, `offset_m`."""
    priority: Priority | None = None
    """Weight of a second of waiting in advice. If absent, that of the vendor."""
    participant: ParticipantKind | None = None
    """What moves. If absent, that of the vendor."""

    @model_validator(mode="after")
    def _check_model(self) -> Self:
        if self.parts and any((self.diameter_m, self.footprint_m, self.envelope_m, self.loaded_envelope_m)):
            raise _fault("parts replace the other shapes and envelopes; remove either")
        if self.parts and all(part.load for part in self.parts):
            raise _fault("parts need at least one that is not a load")
        return self


class Vendor(Section):
    """One vendor: which robots are its own, and how to read their messages."""

    name: str
    """Short name in metrics and advisories."""
    manufacturers: tuple[str, ...] = ()
    """Further values of `manufacturerName` that mean this vendor. Case is ignored."""
    participant: ParticipantKind = "robot"
    """What moves: robots, people on foot who carry a device, or vehicles with a driver."""
    participants: dict[ParticipantKind, tuple[str, ...]] = {}
    """By what moves, UUIDs of its devices, or how these begin, with a `*` at the end. They come before models."""
    priority: Priority | None = None
    """Weight of a second of waiting in advice. If absent, 1 for robots and 10 for people."""
    default_envelope_m: Envelope | None = None
    """Envelope of a robot that has not identified itself. If absent, the default of the site."""
    models: dict[str, Model] = {}
    """Facts of each model. The keys are the values of `robotModel` in identity reports."""
    maps: tuple[VendorMap, ...] = ()
    """The vendor's own maps. Without any, its messages use the coordinates of the datums."""
    robots: tuple[str, ...] = ()
    """UUIDs of this vendor's robots, also of robots that do not identify themselves."""
    names_as_uuid: bool = False
    """Accept names in place of UUIDs. Each name gets a UUID that is derived from vendor and name."""
    dial: tuple[str, ...] = ()
    """Addresses (`ws://`) of fleet managers to connect to."""
    token: SecretSource = ""
    """Source of this vendor's bearer token. If any vendor has credentials, every connection needs some."""
    verbs: tuple[Verb, ...] = get_args(Verb)
    """What advice may ask of its robots. With [] nothing is asked of them."""
    certificate_names: tuple[str, ...] = ()
    """Common or DNS names in this vendor's client certificates. The authority in `receiver.tls.clients` signs them."""


class Tls(Section):
    """The certificates of the site, as PEM files. Changed files are read without a restart."""

    certificate: str
    """Certificate of the server, with intermediate ones."""
    key: str = ""
    """Private key of the certificate. If absent, it is in the same file."""
    clients: str = ""
    """Authorities that sign client certificates. If absent, no client certificate is requested."""


class ReceiverSettings(Section):
    """The robots' port."""

    host: str = "127.0.0.1"
    """Address to listen on; "0.0.0.0" for all addresses of this machine."""
    port: Annotated[int, Field(ge=0, le=65535)] = 3000
    """Port to listen on; 0 for any free port."""
    max_message_bytes: Count = 65536
    """A longer message is refused, and its connection is closed."""
    open_timeout_s: Seconds = 5.0
    """Longest time to open a connection. The TLS handshake before it may take as long."""
    idle_timeout_s: Seconds = 120.0
    """A connection that sends nothing for this long is closed."""
    max_connections: Count = 12000
    """Most connections at once. A low limit of open files makes it fewer."""
    max_connections_per_peer: Count = 10000
    """Most connections from one address, for senders that never close theirs."""
    max_messages_per_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 5000.0
    """Most messages a second of one vendor. Unknown vendors are limited by address, those that topics claim as one."""
    max_bytes_per_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 10e6
    """Most bytes of messages a second of one vendor."""
    max_processor_share: Annotated[float, Field(gt=0, le=1)] = 0.4
    """Largest part of a core that reading the messages of one vendor may take. Rejected messages count four times."""
    tls: Tls | None = None
    """Certificates for `wss://`. If absent, the port serves plain `ws://`."""
    dial_backoff_s: tuple[Seconds, Seconds] = (0.5, 30.0)
    """First and longest wait between attempts to connect to a fleet manager."""


class RecorderSettings(Section):
    """The append-only log of every message and tick."""

    enabled: bool = True
    """Whether the log is written. Without it there is no replay, and a restart begins with an empty floor."""
    segment_bytes: Count = 64 * 1024 * 1024
    """Size of a segment before it is packed, after which the next one begins."""
    total_bytes: Count = 4 * 1024 * 1024 * 1024
    """Largest size of the log as it is stored, older segments packed. The oldest are removed first."""
    keep_days: Annotated[float, Field(gt=0, le=36_500)] = 30.0
    """Segments without a new line for this long are removed."""


class Reading(Section):
    """How messages are read. The standard leaves these points open."""

    horizon_s: Annotated[float, Field(ge=1, le=120, allow_inf_nan=False)] = 10.0
    """How far ahead a path is used (standard 5.3.3)."""
    destination_horizon_s: Seconds = 900.0
    """How far ahead destinations are used (standard 5.2.3)."""
    default_envelope_m: Envelope = (1.0, 1.0, 0.0)
    """Envelope of a robot that has not identified itself, if its vendor has no default."""
    largest_body_m: Annotated[float, Field(gt=0, le=MOST_BODY_M)] = 30.0
    """Largest side of a body with its load, and of a trailer. A larger size is in another unit, or counts as this."""
    quiet_after_s: Seconds = 30.0
    """A robot without a message for this long is quiet (standard 5.4)."""
    silent_after_s: Seconds = 60.0
    """A robot without a message for this long is silent."""
    forget_after_s: Seconds = 86400.0
    """A robot without a message for this long is removed. Until then it is an obstacle."""
    max_robots_per_vendor: Count = 20000
    """Most robots of one vendor, for senders that invent UUIDs. Further robots are refused."""
    clock_tolerance_s: Seconds = 0.25
    """Errors of a sender's clock below this are ignored: its messages count as delayed."""
    lost_doubt_m: Metres = 1.0
    """Largest error of the position of a robot that reports that it is lost."""
    blocking_errors: tuple[str, ...] = ("stuck", "safety stop", "estop", "e-stop", "emergency stop")
    """A robot with an error code that contains one of these is an obstacle. Case is ignored."""
    lost_errors: tuple[str, ...] = ("lost",)
    """A robot with an error code that contains one of these is lost. Case is ignored."""
