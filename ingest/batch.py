"""Batches: the data that goes from the receiver to the engine, as numpy arrays.

A `Batch` holds every robot that changed since the last one, with its forecast as timed poses in the frame of its floor.
Nothing else goes from the vendors' sockets to the engine.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from math import nan
from operator import attrgetter
from typing import Any, NamedTuple, Self

import msgspec
import numpy as np
from numpy.typing import NDArray

from deconflict_client.participant_kinds import ParticipantKind
from ingest.shapes import Shape, Shapes, joined_shapes, shapes_of_json

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Pair = tuple[str, str]
"""The UUIDs of two robots, in ascending order."""


class FloorPoint(NamedTuple):
    """A point in the frame of a floor."""

    datum: str
    """The floor's id."""
    x_m: float
    y_m: float


class Amounts(NamedTuple):
    """Amounts that a robot reports of itself with a status; nan if it does not report one.

    A new field needs no change but here and in the language that reads it (`languages/massrobotics/amounts.py`).
    """

    battery_pct: float = nan
    """Level of the battery."""
    run_time_left_s: float = nan
    """How much longer the battery lasts."""
    load_used_pct: float = nan
    """Share of the load that the robot can carry."""


NO_AMOUNTS = Amounts()
AMOUNTS = np.dtype([(name, np.float64) for name in Amounts._fields])
"""One robot's `Amounts` in an array."""


class Basis(IntEnum):
    """What a forecast is derived from."""

    STATIONARY = 0
    PATH = 1
    VELOCITY = 2
    DESTINATION = 3
    ORDER = 4


@dataclass(frozen=True, slots=True, eq=False)
class Forecasts:
    """Timed poses of n robots, k knots in all; knots of robot i are rows `start[i]:start[i + 1]`.

    Between two knots x, y and yaw are linear in time, yaw along the shorter arc. A robot is absent before its first
    knot, and stands at its last knot after that. A robot is on a knot's floor from that knot to the next one. If the
    next knot is on another floor, the robot stands at the first knot's pose until then. Floor -1 means a frame that is
    compared with nothing.
    """

    start: Ints
    """(n + 1,) first knot of each robot, and k at the end."""
    t_s: Floats
    """(k,) seconds since the epoch, increasing within a robot."""
    x_m: Floats
    """(k,) envelope centre in the floor's frame."""
    y_m: Floats
    """(k,)"""
    yaw_rad: Floats
    """(k,) anticlockwise from x."""
    floor: Ints
    """(k,) index into the batch's floors."""
    length_m: Floats
    """(n,) envelope along the heading; of a shape, the rectangle that holds it."""
    width_m: Floats
    """(n,) envelope across the heading."""
    bottom_m: Floats
    """(n,) height range of the robot: -inf and inf if the height is unknown."""
    top_m: Floats
    """(n,)"""
    shapes: Shapes | None = None
    """(n,) of each robot its `Shape`, None for a rectangle; None if all are rectangles."""

    def __len__(self) -> int:
        return len(self.start) - 1

    @classmethod
    def empty(cls) -> Self:
        floats, ints = np.empty(0), np.empty(0, np.int64)
        return cls(np.zeros(1, np.int64), floats, floats, floats, floats, ints, floats, floats, floats, floats)

    def take(self, rows: Sequence[int] | Ints) -> Self:
        """The forecasts of `rows`, in that order."""
        rows = np.asarray(rows, np.int64)
        start, knots = _rows_of_parts(self.start, rows)
        by_knot = {name: getattr(self, name)[knots] for name in _BY_KNOT}
        by_robot = {name: getattr(self, name)[rows] for name in _BY_ROBOT}
        return type(self)(start=start, **by_knot, **by_robot, shapes=None if self.shapes is None else self.shapes[rows])

    def single(self, row: int) -> Self:
        """The forecast of one robot, as views."""
        first, end = self.start[row], self.start[row + 1]
        by_knot = [getattr(self, name)[first:end] for name in _BY_KNOT]
        by_robot = [getattr(self, name)[row : row + 1] for name in _BY_ROBOT]
        alone = type(self)(np.array([0, end - first]), *by_knot, *by_robot)
        return alone if self.shapes is None else replace(alone, shapes=self.shapes[row : row + 1])

    @classmethod
    def joined(cls, parts: Iterable[Self]) -> Self:
        """All the robots of `parts`, in order."""
        all_parts = list(parts)
        if len(all_parts) < 2:
            return all_parts[0] if all_parts else cls.empty()
        start, *columns = zip(*map(_FORECASTS, all_parts), strict=True)
        joint = cls(_joined_starts(start), *map(np.concatenate, columns))
        shapes = joined_shapes([(part.shapes, len(part)) for part in all_parts])
        return joint if shapes is None else replace(joint, shapes=shapes)

    def shape(self, row: int) -> Shape | None:
        """The shape of a robot; None for a rectangle."""
        return None if self.shapes is None else self.shapes[row]


def _rows_of_parts(start: Ints, rows: Ints) -> tuple[Ints, Ints]:
    """Chosen parts of an array of which part i has the rows `start[i]` to `start[i + 1]`.

    `rows` are the numbers of the chosen parts. Returns where each begins once they are joined, and all their rows.
    """
    counts = np.diff(start)[rows]
    begins = np.concatenate([[0], np.cumsum(counts)])
    return begins, np.repeat(start[rows] - begins[:-1], counts) + np.arange(begins[-1])


def _joined_starts(starts: Sequence[Ints]) -> Ints:
    """The starts of several layouts that are joined one after the other."""
    moved, n = [starts[0]], starts[0][-1]
    for start in starts[1:]:
        moved.append(start[1:] + n)
        n += start[-1]
    return np.concatenate(moved)


_BY_KNOT = ("t_s", "x_m", "y_m", "yaw_rad", "floor")
_BY_ROBOT = ("length_m", "width_m", "bottom_m", "top_m")
_FORECASTS = attrgetter("start", *_BY_KNOT, *_BY_ROBOT)
_DESTINATIONS = attrgetter("start", "t_s", "x_m", "y_m", "floor")


@dataclass(frozen=True, slots=True, eq=False)
class Destinations:
    """The next stops of n robots with their times, m stops in all. Robot i has rows `start[i]:start[i + 1]`."""

    start: Ints
    """(n + 1,) first stop of each robot, and m at the end."""
    t_s: Floats
    """(m,) when the robot expects to be there, seconds since the epoch, not decreasing within a robot."""
    x_m: Floats
    """(m,) position of the robot's location in the floor's frame."""
    y_m: Floats
    """(m,)"""
    floor: Ints
    """(m,) index into the batch's floors; -1 for a frame that is compared with nothing."""

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The stops of all the robots of `parts`, in order."""
        start, *columns = zip(*map(_DESTINATIONS, parts), strict=True)
        return cls(_joined_starts(start), *map(np.concatenate, columns))

    def take(self, rows: Sequence[int] | Ints) -> Self:
        """The stops of `rows`, in that order."""
        start, stops = _rows_of_parts(self.start, np.asarray(rows, np.int64))
        return type(self)(start, self.t_s[stops], self.x_m[stops], self.y_m[stops], self.floor[stops])


class Claim(NamedTuple):
    """Robots of one vendor that another vendor reports. If both are the same: robots reported from two places."""

    owner: str
    claimant: str
    robots: tuple[str, ...]
    """The first few UUIDs, in the order in which they were claimed."""
    claimed: int
    """How many robots are claimed in all."""
    since_s: float
    """When the first such report arrived."""


@dataclass(frozen=True, slots=True, eq=False)
class Batch:
    """The robots that changed by the tick at `now_s`. All times are seconds since the epoch, service clock."""

    now_s: float
    floors: tuple[str, ...]
    """Floor ids by index. Only the batches of one sender since its start have one order; see `FloorNumbers`."""
    robots: tuple[str, ...]
    """(n,) UUIDs."""
    vendors: tuple[str, ...]
    """(n,)"""
    models: tuple[str, ...]
    """(n,) as the vendor names it; "" if the robot has not identified itself."""
    names: tuple[str, ...]
    """(n,) what a person calls the robot."""
    states: tuple[str, ...]
    """(n,) operational state as the standard spells it, or as the sender does if the standard does not have it."""
    statuses: Ints
    """(n,) how many statuses came since the robot was last in a batch; 0 if the robot is only repeated."""
    first_arrival_s: Floats
    """(n,) when the first of them arrived."""
    arrival_s: Floats
    """(n,) when the newest status arrived."""
    event_s: Floats
    """(n,) when the newest pose was true, by the sender's corrected clock."""
    basis: Ints
    """(n,) `Basis` of each forecast."""
    doubt_m: Floats
    """(n,) how far off the position may be as reported."""
    reports_within_s: Floats
    """(n,) the next status may come as late as this by the rules of the robot's language; 0 without such a rule."""
    amounts: NDArray[Any]
    """(n,) of `AMOUNTS`."""
    forecasts: Forecasts
    """n robots, in the same order."""
    destinations: Destinations
    """Of n robots, in the same order."""
    gone: tuple[str, ...]
    """UUIDs of robots that were forgotten."""
    claims: tuple[Claim, ...] = ()
    """The claims that stand at the tick."""
    participants: tuple[ParticipantKind, ...] = ()
    """(n,) what each stands for. If not given, robots."""
    sources: tuple[str, ...] = ()
    """(n,) who reports each robot, as `ingest.port.connection` says it. If not given, the vendors."""
    examined: Bools = field(default_factory=lambda: np.empty(0, np.bool_))
    """(n,) whether the robot is compared with others. If not given, all are."""
    off_floor: tuple[str, ...] = ()
    """Those of `gone` that a person took off the floor."""
    began_anew: tuple[str, ...] = ()
    """UUIDs of robots of this batch whose presence ended before their report: they were moved by hand, or came back."""
    came_s: Floats = field(default_factory=lambda: np.empty(0))
    """(n,) since when the robot is known without a break. If not given, since the tick."""

    def __post_init__(self) -> None:
        n = len(self.robots)
        texts, times_s = {"sources": self.vendors, "participants": ("robot",) * n}, np.full(n, self.now_s)
        missing = texts | {"examined": np.ones(n, np.bool_), "came_s": times_s}
        for name, values in missing.items() if n else ():
            if not len(getattr(self, name)):
                object.__setattr__(self, name, values)

    def __len__(self) -> int:
        return len(self.robots)

    def datums(self, floor: Ints) -> list[str]:
        """The ids of floors by index; "" for a frame that is compared with nothing."""
        return [self.floors[index] if index >= 0 else "" for index in floor.tolist()]

    def take(self, rows: Ints, gone: tuple[str, ...] = ()) -> Self:
        """The robots of `rows` (m,), in that order, and those that are gone."""
        chosen = rows.tolist()
        texts: dict[str, Any] = {name: tuple(getattr(self, name)[row] for row in chosen) for name in _ROBOT_TEXTS}
        arrays: dict[str, Any] = {name: getattr(self, name)[rows] for name in _ARRAYS}
        parts: dict[str, Any] = {part: getattr(self, part).take(rows) for part in _PARTS}
        ended = {"off_floor": gone, "began_anew": texts["robots"]}
        texts |= {name: tuple(filter(of.__contains__, getattr(self, name))) for name, of in ended.items()}
        return replace(self, gone=gone, **texts, **arrays, **parts)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """All the robots of one or more batches, as of the last one's tick. Its floors begin with all other lists."""
        if len(parts) == 1:
            return parts[0]
        texts: dict[str, Any] = {name: _concatenated(map(attrgetter(name), parts)) for name in (*_ROBOT_TEXTS, *_NAMED)}
        arrays: dict[str, Any] = {name: np.concatenate([*map(attrgetter(name), parts)]) for name in _ARRAYS}
        joint: dict[str, Any] = {
            part: kind.joined([getattr(batch, part) for batch in parts]) for part, kind in _PARTS.items()
        }
        return replace(parts[-1], **texts, **arrays, **joint)

    def to_bytes(self) -> bytes:
        """A line of JSON with the texts and the layout of the arrays, then the bytes of the arrays in that order."""
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        amounts = arrays.pop("amounts")
        arrays |= {name: amounts[name] for name in amounts.dtype.names}
        for part, kind in _PARTS.items():
            arrays |= {f"{part}.{column.name}": getattr(getattr(self, part), column.name) for column in fields(kind)}
        arrays["examined"] = arrays.pop("examined")  # last, so that those of eight bytes stay aligned
        head = {name: getattr(self, name) for name in _HEAD_KEYS}
        if (shapes := arrays.pop("forecasts.shapes")) is not None:
            head["shapes"] = shapes.tolist()
        head["layout"] = [(name, array.dtype.str, len(array)) for name, array in arrays.items()]
        body = [np.ascontiguousarray(array).tobytes() for array in arrays.values()]
        return b"".join([msgspec.json.encode(head), b"\n", *body])

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """The batch that `to_bytes` wrote. The arrays are read-only views of `data`."""
        head, _, body = data.partition(b"\n")
        document: dict[str, Any] = msgspec.json.decode(head)
        arrays, offset = dict[str, Any](), 0
        for name, kind, length in document.pop("layout"):
            arrays[name] = np.frombuffer(body, kind, length, offset)
            offset += arrays[name].nbytes
        arrays["forecasts.shapes"] = shapes_of_json(document.pop("shapes", None))
        parts: dict[str, Any] = {
            part: kind(**{column.name: arrays.pop(f"{part}.{column.name}") for column in fields(kind)})
            for part, kind in _PARTS.items()
        }
        amounts = np.full(len(arrays["event_s"]), np.nan, AMOUNTS)
        for name in Amounts._fields:
            if name in arrays:  # an earlier release may not have it
                amounts[name] = arrays.pop(name)
        arrays.setdefault("reports_within_s", np.zeros(len(amounts)))  # nor this
        now_s = document.pop("now_s")
        claims = tuple(
            Claim(owner, claimant, tuple(robots), *rest) for owner, claimant, robots, *rest in document.pop("claims")
        )
        texts: dict[str, Any] = {name: tuple(value) for name, value in document.items()}
        return cls(now_s=now_s, claims=claims, amounts=amounts, **parts, **arrays, **texts)


def _concatenated(parts: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    """All texts of `parts`. `itertools.chain` would be slower, since it passes each text on by itself."""
    texts: list[str] = []
    for part in parts:
        texts += part
    return tuple(texts)


_ROBOT_TEXTS = ("robots", "vendors", "models", "names", "states", "participants", "sources")
_NAMED = ("gone", "off_floor", "began_anew")
_HEAD_KEYS = ("now_s", "floors", *_ROBOT_TEXTS, *_NAMED, "claims")
_NUMBERS = ("statuses", "first_arrival_s", "arrival_s", "event_s", "basis", "doubt_m", "reports_within_s", "came_s")
_ARRAYS = (*_NUMBERS, "examined", "amounts")
_PARTS: dict[str, Any] = {"forecasts": Forecasts, "destinations": Destinations}
