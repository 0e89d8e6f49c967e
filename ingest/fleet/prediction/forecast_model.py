"""What a forecast is made from and what it is made of."""

from collections.abc import Sequence
from math import copysign, inf, nan, pi
from typing import Protocol

import msgspec
import numpy as np
from msgspec.structs import replace

from ingest.batch import Basis, Floats
from ingest.frames.assumed_motion import SPINS_RADPS
from ingest.frames.frame_registry import Frame
from ingest.settings import Envelope, Model, Reading
from ingest.shapes import Shape, ShapePart, Trailer
from ingest.sizes.size_limit import Rectangle
from ingest.sizes.stated_bodies import StatedBody
from ingest.sizes.stated_loads import LoadBox

Knot = tuple[float, float, float, float]
"""t_s, x_m, y_m, yaw_rad"""
Route = tuple[Sequence[Knot], tuple[int, ...]]
"""Knots of the location (k,), and the floor of each (k,)."""
NO_STOPS: Floats = np.empty((0, 4))


class FrameOf(Protocol):
    """Frame and floor index of a datum that a vendor names. "" is the robot's own datum."""

    def __call__(self, datum: str) -> tuple[Frame, int]: ...


class RobotBody(msgspec.Struct, frozen=True, gc=False):
    """A robot's envelope with its present load."""

    envelope_m: Envelope
    """Length, width and height."""
    offset_m: tuple[float, float] = (0.0, 0.0)
    """Its centre relative to the reported location: along the heading, and to its left."""
    max_speed_mps: float | None = None
    """None if the robot has not stated it."""
    shape: Shape | None = None
    """Around the centre of the envelope; None for a rectangle."""
    lift_m: float = 0.0
    """From the reported height to the bottom of the envelope."""

    @property
    def rectangle(self) -> Rectangle:
        """The envelope about the reported location."""
        return Rectangle.about(self.offset_m, *self.envelope_m[:2])


class ForecastContext(msgspec.Struct, frozen=True):
    """How the messages of a robot are read. Robots of one kind share it."""

    body: RobotBody
    frame_of: FrameOf
    reading: Reading


class Sighting(msgspec.Struct, frozen=True, gc=False):
    """Where a robot was: its location, not the envelope centre, in the floor's frame."""

    t_s: float
    """Time of the pose, by the service's clock."""
    floor: int
    """Index of the floor."""
    x_m: float
    y_m: float
    yaw_rad: float
    """nan if the heading is unknown."""
    linear_mps: float | None = None
    """Speed along the heading, or in the direction of `sideways_rad`, negative backwards; None if neither sent nor
    observed."""
    turn_radps: float = 0.0
    """Turn rate, anticlockwise positive; nan if it was not sent, until it is compared with the sighting before."""
    clock_offset_s: float = 0.0
    """The robot's stamps plus this are service time."""
    interval_s: float = 0.0
    """Time since the sighting before; 0 if that shows nothing of the motion."""
    is_driving: bool = False
    """Whether it drives by this and the sighting before."""
    stated_share: float = 1.0
    """Its speed, as stated, as a share of that of the move since the sighting before; 1 if they are near each other."""
    same_place_s: float = 0.0
    """For how long it was at one place, while it said that it drives."""
    place_every_s: float = 0.0
    """For how long it was so at most before it was seen to have driven on."""
    is_overruled: bool = False
    """Whether its speed was observed, since that was stated otherwise twice."""
    state: str = ""
    """The operational state that it stated."""
    standing_s: float = 0.0
    """For how long it has neither driven nor moved, in one state, as far as was seen."""
    moves_anyway: bool = False
    """Whether it drives and has moved since the sighting before, which has the same state."""
    sideways_rad: float = 0.0
    """From the heading to the direction in which it drives; 0 for a robot that drives along its heading."""
    drift_rad: float = 0.0
    """From the direction of its speed, as sent, to that of the move since the sighting before; 0 if they agree."""
    turned_rad: float = 0.0
    """How far it turned since the sighting before, if that is near in time."""
    unturned_rad: float = 0.0
    """How far its turn rates would have turned it beyond its headings, in the sightings up to this that lag behind."""
    posed_s: float = nan
    """When a pose came first that it sends again while it may drive; nan for one that came once."""
    repeated_s: float = nan
    """When that came last."""

    @property
    def is_turning(self) -> bool:
        """Whether it turns by its turn rate and by its headings, so that it is not just coming to rest."""
        turned_rad = copysign(self.turned_rad, self.turned_rad * self.turn_radps)
        return abs(self.turn_radps) > SPINS_RADPS and turned_rad > SPINS_RADPS * self.interval_s

    @property
    def way_rad(self) -> float:
        """The direction of its speed, unless that is negative."""
        return self.yaw_rad + self.sideways_rad

    @property
    def direction_rad(self) -> float:
        """In which it drives; nan if its heading is unknown."""
        return self.way_rad + (pi if self.linear_mps and self.linear_mps < 0.0 else 0.0)


class Forecast(msgspec.Struct, frozen=True, gc=False, eq=False):
    """Where the centre of one envelope will be."""

    basis: Basis
    knots: tuple[Knot, ...] | Floats
    """(k,) of `Knot`; (k, 4) if the fast path made them."""
    floors: tuple[int, ...]
    """(k,) floor index of each knot."""
    length_m: float
    """Of the envelope, along the heading."""
    width_m: float
    """Of the envelope, across the heading."""
    bottom_m: float
    """Lowest height of the envelope, -inf if unknown."""
    top_m: float
    """Highest height of the envelope, inf if unknown."""
    shape: Shape | None = None
    """None for a rectangle."""
    findings: tuple[str, ...] = ()
    """Deviations of the path that it was made from."""


def robot_body(model: Model, reported: RobotBody, loaded: bool, load: LoadBox | None) -> RobotBody:
    """The body that the site states for the model and the load, else the reported one with the reported load."""
    body = _body_without_trailers(model, reported, loaded, load)
    if not model.trailers:
        return body
    (ahead_m, left_m), pulled = body.offset_m, model.trailers
    trailer = Trailer(pulled.length_m, pulled.width_m, pulled.hitch_m)
    parts = body.shape.parts if body.shape else ()
    return replace(body, shape=Shape(parts, (-ahead_m, -left_m), (trailer,) * pulled.count))


def _body_without_trailers(model: Model, reported: RobotBody, loaded: bool, load: LoadBox | None) -> RobotBody:
    if outline := _stated_outline(model, loaded):
        return _shaped_body(outline, (model.envelope_m or reported.envelope_m)[2], load, reported.max_speed_mps)
    if loaded and model.loaded_envelope_m:
        offset_m = model.loaded_offset_m or model.offset_m
        return RobotBody(model.loaded_envelope_m, offset_m, reported.max_speed_mps)
    offset_m = model.offset_m if "offset_m" in model.model_fields_set else reported.offset_m
    if model.envelope_m:
        body = RobotBody(model.envelope_m, offset_m, reported.max_speed_mps)
    else:
        body = replace(reported, offset_m=offset_m)
    return with_load(body, load) if load else body


def _stated_outline(model: Model, loaded: bool) -> Shape | None:
    """The shape that the site states, with its load, from the reported location; None for a rectangle."""
    if model.parts:
        return Shape(tuple(part.shape_part() for part in model.parts if loaded or not part.load))
    part = None if loaded and model.loaded_envelope_m else model.round_part()
    return Shape((part,)) if part else None


def reported_body(stated: StatedBody, max_speed_mps: float | None) -> RobotBody:
    """The body by what a robot says of itself."""
    if stated.outline:
        return _shaped_body(stated.outline, stated.envelope_m[2], None, max_speed_mps)
    return RobotBody(stated.envelope_m, stated.offset_m, max_speed_mps)


def with_load(body: RobotBody, load: LoadBox) -> RobotBody:
    """The body with the rectangle about its own envelope and the load. A height that is not known stays so."""
    if body.shape:
        return _shaped_body(body.shape.moved(*body.offset_m), body.envelope_m[2], load, body.max_speed_mps)
    (length_m, width_m, height_m), (x_m, y_m) = body.envelope_m, body.offset_m
    back_m, front_m = min(x_m - length_m / 2, load.back_m), max(x_m + length_m / 2, load.front_m)
    right_m, left_m = min(y_m - width_m / 2, load.right_m), max(y_m + width_m / 2, load.left_m)
    envelope_m = front_m - back_m, left_m - right_m, max(height_m, load.top_m) if height_m else 0.0
    return RobotBody(envelope_m, ((front_m + back_m) / 2, (left_m + right_m) / 2), body.max_speed_mps)


def _load_part(load: LoadBox, outline: Shape) -> ShapePart:
    """A load as a part of a shape; as high as the robot if the other parts are."""
    corners = ((load.front_m, load.left_m), (load.back_m, load.left_m), (load.back_m, load.right_m))
    bottom_m, top_m = outline.heights_m
    if bottom_m > -inf:
        top_m = max(load.top_m, bottom_m)
    return ShapePart((*corners, (load.front_m, load.right_m)), 0.0, bottom_m, top_m)


def _shaped_body(outline: Shape, height_m: float, load: LoadBox | None, max_speed_mps: float | None) -> RobotBody:
    """The body of a shape that is drawn from the reported location. Its envelope is the rectangle around it."""
    if load:
        height_m = max(height_m, load.top_m) if height_m else 0.0
        outline = Shape((*outline.parts, _load_part(load, outline)))
    lift_m, top_m = outline.heights_m
    west, south, east, north = outline.bounds_m
    centre = round((west + east) / 2, 9), round((south + north) / 2, 9)
    shape = outline.moved(-centre[0], -centre[1])
    if lift_m == -inf:
        return RobotBody((east - west, north - south, height_m), centre, max_speed_mps, shape)
    return RobotBody((east - west, north - south, top_m - lift_m), centre, max_speed_mps, shape.raised(-lift_m), lift_m)
