"""A replay as an MCAP file for robot viewers: drawn envelopes and forecasts, and advisories as log messages.

Messages are JSON in Foxglove's schemas `foxglove.SceneUpdate` and `foxglove.Log`. The schemas in the file contain only
the fields that are used. Each floor is a frame.
"""

import json
from itertools import pairwise
from typing import IO, Any
from zlib import crc32

import numpy as np
import shapely
from mcap.writer import CompressionType, Writer

from deconflict.sweep.geometry.pose import pose_at
from deconflict.sweep.shapes.shape_encounters import PlacedPart, bodies, placed_parts
from deconflict_client.advisory import AnyAdvisory, Severity
from ingest.batch import Batch, Forecasts

Message = dict[str, Any]

SCENE, LOG = "foxglove.SceneUpdate", "foxglove.Log"
UNKNOWN_HEIGHT_M = 1.0
"""Drawn height of a robot with unknown height."""
LEVELS = {Severity.CAUTION: 2, Severity.WARNING: 3, Severity.CRITICAL: 4}
"""Severities as levels of a foxglove.Log: info, warning, error."""
COLOURS = ((0.12, 0.44, 0.70), (0.76, 0.25, 0.05), (0.18, 0.49, 0.20), (0.48, 0.25, 0.63), (0.54, 0.43, 0.0))


class McapExport:
    """Writes one replay to a file."""

    def __init__(self, out: IO[bytes]) -> None:
        self._writer = Writer(out, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="amr-deconflict")
        self._scene = self._channel("/robots", SCENE, _SCENE_SCHEMA)
        self._log = self._channel("/advisories", LOG, _LOG_SCHEMA)

    def add_batch(self, now_s: float, batch: Batch) -> None:
        """Draw the robots of a batch. Each drawing replaces the robot's last one."""
        if len(batch) or batch.gone:
            entities = [_entity(batch, row) for row in range(len(batch)) if _floor(batch, row) >= 0]
            gone = [{"timestamp": _stamp(now_s), "type": 0, "id": uuid} for uuid in batch.gone]
            self._write(self._scene, now_s, {"deletions": gone, "entities": entities})

    def add_advisory(self, clearance_m: float, revision: AnyAdvisory) -> None:
        """Log one revision of an advisory of the engine with a clearance."""
        at_s = revision.updated_at.timestamp()
        message = f"{revision.state.value}: {revision.summary}"
        probability = getattr(revision, "probability", None)
        entry = {
            "timestamp": _stamp(at_s),
            "level": LEVELS[revision.severity],
            "message": message if probability is None else f"{message} (probability {probability:.2f})",
            "name": f"clearance {clearance_m:g} m",
            "file": revision.id,
            "line": 0,
        }
        self._write(self._log, at_s, entry)

    def finish(self) -> None:
        """Write the index. Without it viewers read the file slowly."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _channel(self, topic: str, name: str, schema: Message) -> int:
        data = json.dumps({"title": name, **schema}).encode()
        schema_id = self._writer.register_schema(name=name, encoding="jsonschema", data=data)
        return self._writer.register_channel(topic=topic, message_encoding="json", schema_id=schema_id)

    def _write(self, channel: int, at_s: float, message: Message) -> None:
        at_ns = round(at_s * 1e9)
        self._writer.add_message(channel, log_time=at_ns, publish_time=at_ns, data=json.dumps(message).encode())


def _floor(batch: Batch, row: int) -> int:
    return int(batch.forecasts.floor[batch.forecasts.start[row]])


def _entity(batch: Batch, row: int) -> Message:
    """One robot: its shape and trailers, its name, and its announced path on this floor."""
    forecast, colour = batch.forecasts.single(row), _colour(batch.vendors[row])
    is_height_known = np.isfinite(forecast.top_m[0])
    height_m = float(forecast.top_m[0] - forecast.bottom_m[0]) if is_height_known else UNKNOWN_HEIGHT_M
    x, y = float(forecast.x_m[0]), float(forecast.y_m[0])
    return {
        "timestamp": _stamp(float(batch.event_s[row])),
        "frame_id": batch.floors[_floor(batch, row)],
        "id": batch.robots[row],
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [
            {"key": "vendor", "value": batch.vendors[row]},
            {"key": "state", "value": batch.states[row]},
        ],
        "arrows": [],
        "spheres": [],
        "lines": _path_lines(forecast, colour),
        **_solids(forecast, height_m, colour),
        "texts": [_name(batch.names[row], _pose(x, y, height_m + 0.3, 0.0), colour)],
        "models": [],
    }


def _solids(forecast: Forecasts, height_m: float, colour: Message) -> dict[str, list[Message]]:
    """The robot and its trailers, `height_m` high: rectangles as cubes, circles as cylinders, polygons as triangles."""
    drawn: dict[str, list[Message]] = {"cubes": [], "cylinders": [], "triangles": []}
    for body in bodies(forecast):
        shape, pose, floor_m = body.shape(0), pose_at(body, float(body.t_s[0])), float(body.bottom_m[0])
        if shape is None or not shape.parts:
            size = _vector(float(body.length_m[0]), float(body.width_m[0]), height_m)
            place = _pose(pose.x_m, pose.y_m, height_m / 2, pose.yaw_rad)
            drawn["cubes"].append({"pose": place, "size": size, "color": colour})
            continue
        for part in placed_parts(body, pose):
            is_high = np.isfinite(part.top_m) and np.isfinite(floor_m)
            low_m, high_m = (part.bottom_m - floor_m, part.top_m - floor_m) if is_high else (0.0, height_m)
            kind = "cylinders" if part.radius_m else "triangles"
            draw = _cylinder if part.radius_m else _prism
            drawn[kind].append(draw(part, low_m, high_m, colour))
    return drawn


def _cylinder(part: PlacedPart, low_m: float, high_m: float, colour: Message) -> Message:
    place = _pose(part.core.x, part.core.y, (low_m + high_m) / 2, 0.0)
    size = _vector(2 * part.radius_m, 2 * part.radius_m, high_m - low_m)
    return {"pose": place, "size": size, "bottom_scale": 1.0, "top_scale": 1.0, "color": colour}


def _prism(part: PlacedPart, low_m: float, high_m: float, colour: Message) -> Message:
    """The sides and the upper side of a prism."""
    ring = list(part.core.exterior.coords)
    upper = shapely.constrained_delaunay_triangles(part.core).geoms
    points = [(x, y, high_m) for triangle in upper for x, y in list(triangle.exterior.coords)[:3]]
    for (ax, ay), (bx, by) in pairwise(ring):
        points += [(ax, ay, low_m), (bx, by, low_m), (ax, ay, high_m)]
        points += [(bx, by, low_m), (bx, by, high_m), (ax, ay, high_m)]
    corners = [_vector(*point) for point in points]
    return {"pose": _pose(0.0, 0.0, 0.0, 0.0), "points": corners, "color": colour, "colors": [], "indices": []}


def _path_lines(forecast: Forecasts, colour: Message) -> list[Message]:
    """The forecast (of one robot) on its present floor as a line; empty if it has a single point."""
    on_floor = forecast.floor == forecast.floor[0]
    xs, ys = forecast.x_m[on_floor].tolist(), forecast.y_m[on_floor].tolist()
    if len(xs) <= 1:
        return []
    return [
        {
            "type": 0,
            "pose": _pose(0.0, 0.0, 0.0, 0.0),
            "thickness": 0.05,
            "scale_invariant": False,
            "points": [_vector(x, y, 0.0) for x, y in zip(xs, ys, strict=True)],
            "color": colour,
            "colors": [],
            "indices": [],
        }
    ]


def _name(text: str, pose: Message, colour: Message) -> Message:
    return {
        "pose": pose,
        "billboard": True,
        "font_size": 0.3,
        "scale_invariant": False,
        "color": colour,
        "text": text,
    }


def _pose(x: float, y: float, z: float, yaw: float) -> Message:
    turn = {"x": 0.0, "y": 0.0, "z": float(np.sin(yaw / 2)), "w": float(np.cos(yaw / 2))}
    return {"position": _vector(x, y, z), "orientation": turn}


def _vector(x: float, y: float, z: float) -> Message:
    return {"x": round(x, 4), "y": round(y, 4), "z": round(z, 4)}


def _colour(vendor: str) -> Message:
    red, green, blue = COLOURS[crc32(vendor.encode()) % len(COLOURS)]
    return {"r": red, "g": green, "b": blue, "a": 0.8}


def _stamp(t_s: float) -> Message:
    sec, nsec = divmod(round(t_s * 1e9), 10**9)
    return {"sec": sec, "nsec": nsec}


def _object(**properties: Message) -> Message:
    return {"type": "object", "properties": properties}


def _list(of: Message) -> Message:
    return {"type": "array", "items": of}


_TEXT, _NUMBER, _WHOLE, _FLAG = ({"type": name} for name in ("string", "number", "integer", "boolean"))
_TIME = _object(sec=_WHOLE, nsec=_WHOLE)
_XYZ = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POSE = _object(position=_XYZ, orientation=_object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER))
_COLOUR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_LINE = _object(
    type=_WHOLE,
    pose=_POSE,
    thickness=_NUMBER,
    scale_invariant=_FLAG,
    points=_list(_XYZ),
    color=_COLOUR,
    colors=_list(_COLOUR),
    indices=_list(_WHOLE),
)
_TEXTS = _object(pose=_POSE, billboard=_FLAG, font_size=_NUMBER, scale_invariant=_FLAG, color=_COLOUR, text=_TEXT)
_SCENE_SCHEMA = _object(
    deletions=_list(_object(timestamp=_TIME, type=_WHOLE, id=_TEXT)),
    entities=_list(
        _object(
            timestamp=_TIME,
            frame_id=_TEXT,
            id=_TEXT,
            lifetime=_TIME,
            frame_locked=_FLAG,
            metadata=_list(_object(key=_TEXT, value=_TEXT)),
            cubes=_list(_object(pose=_POSE, size=_XYZ, color=_COLOUR)),
            lines=_list(_LINE),
            texts=_list(_TEXTS),
            cylinders=_list(_object(pose=_POSE, size=_XYZ, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOUR)),
            triangles=_list(
                _object(pose=_POSE, points=_list(_XYZ), color=_COLOUR, colors=_list(_COLOUR), indices=_list(_WHOLE))
            ),
            **{name: _list(_object()) for name in ("arrows", "spheres", "models")},
        )
    ),
)
_LOG_SCHEMA = _object(timestamp=_TIME, level=_WHOLE, message=_TEXT, name=_TEXT, file=_TEXT, line=_WHOLE)
