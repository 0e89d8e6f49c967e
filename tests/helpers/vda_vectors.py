"""One or more messages for each rule of VDA 5050 that a message by itself can break."""

import json
from dataclasses import dataclass
from math import nan
from typing import Any

from tests.helpers.vda_saying import (
    edge,
    factsheet,
    node,
    node_states,
    order,
    position,
    state,
    state_3,
    vda,
    visualization,
)

T = 1_790_000_000.0
ROUND = {"degree": 2, "controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 0.0}, {"x": 1.0, "y": 1.0}]}
WINDING = [edge(n, trajectory={"degree": 2, "controlPoints": [{"x": n, "y": 0.0}] * 480}) for n in range(26)]
LATER = "2026-09-21T14:13:24Z"
UNREADABLE = ("headerId", "orderUpdateId", "errors", "loads", "nodeStates", "actionStates")
SQUARE = [{"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 1.0}]
BOW_TIE = [{"x": x, "y": y} for x, y in ((0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 1.0))]


@dataclass(frozen=True, slots=True)
class VdaVector:
    """A message, the kind of its topic, and the rules that it breaks."""

    kind: str
    raw: bytes
    findings: tuple[str, ...] = ()
    rejected: str | None = None


def sized(**keys: Any) -> bytes:
    return factsheet(T, physicalParameters={"length": 1.2, "width": 0.8, "speedMax": 1.0} | keys)


def waypoint(eta: str, x: float = 1.0) -> dict[str, Any]:
    return {"x": x, "y": 0.0, "eta": eta}


def planned(*waypoints: dict[str, Any] | str) -> bytes:
    return state_3(T, intermediatePath={"polyline": list(waypoints)})


def changed(**keys: Any) -> bytes:
    """A state with keys replaced that its header or its schema has otherwise."""
    return json.dumps(json.loads(state(T)) | keys).encode()


VECTORS = (
    VdaVector("state", state(T)),
    VdaVector("state", state_3(T)),
    VdaVector("order", order(T, [node(0, 0.0), node(1, 1.0)])),
    VdaVector("factsheet", factsheet(T)),
    VdaVector("factsheet", factsheet(T, timestamp=None, headerId=None)),
    VdaVector("connection", vda(T, connectionState="ONLINE")),
    VdaVector("instantActions", vda(T), rejected="topic-unknown"),
    VdaVector("state", b"\xff\xfe", rejected="not-utf8"),
    VdaVector("state", state(T, errors=[{"errorType": "Stoerung"}]).replace(b"oe", b"\xf6"), ("text-not-utf8",)),
    VdaVector("state", b"{", rejected="not-json"),
    VdaVector("state", b'{"a":' * 100_000, rejected="too-deep"),
    VdaVector("state", b"[]", rejected="not-object"),
    VdaVector("state", changed(**dict.fromkeys(UNREADABLE, 1.5)), ("value-unreadable", "key-absent")),
    VdaVector("state", changed(batteryState={"batteryCharge": nan, "charging": False}), ("value-unreadable",)),
    VdaVector("state", b"\xef\xbb\xbf" + state(T), ("byte-order-mark",)),
    VdaVector("state", state(T) + b"\0", ("json-spelling",)),
    VdaVector("state", changed(loads=None), ("null-value",)),
    VdaVector("state", changed(orderId=7), ("text-as-number",)),
    VdaVector("state", changed(agvPosition=position(mapId=3)), ("text-as-number",)),
    VdaVector("state", changed(errors={"errorType": "x", "errorLevel": "WARNING"}), ("single-not-list",)),
    VdaVector("state", changed(agvPosition=[position()]), ("single-not-list",)),
    VdaVector("state", changed(agvPosition={"position": position()}), ("nested-otherwise",)),
    VdaVector("state", changed(agvPosition=None, **position()), ("nested-otherwise", "null-value")),
    VdaVector("state", changed(agvPosition=position(mapId=None, map_id="hall")), ("key-spelling",)),
    VdaVector("state", changed(agvPosition=position(mapId=None, mapsId="hall")), ("key-unknown", "map-missing")),
    VdaVector("state", changed(timestamp=1790000000), ("stamp-epoch",)),
    VdaVector(
        "state", changed(safetyState={"eStop": "none", "fieldViolation": "false"}), ("word-spelling", "number-as-text")
    ),
    VdaVector("state", changed(errors=[{"errorType": "x", "errorLevel": "Ghastly"}]), ("word-unknown",)),
    VdaVector("state", changed(timestamp="yesterday"), ("stamp-unreadable",)),
    VdaVector("state", changed(timestamp=None), ("null-value", "key-absent", "stamp-unreadable")),
    VdaVector("state", changed(timestamp="1960-01-01T00:00:00Z"), ("stamp-absurd",)),
    VdaVector("state", state(T, 2e7), rejected="position-absurd"),
    VdaVector("factsheet", sized(width=0.0), ("envelope-not-positive",)),
    VdaVector("factsheet", factsheet(T, physicalParameters=None), ("key-absent", "envelope-not-positive")),
    VdaVector("factsheet", sized(length=1200.0)),
    VdaVector("state", state(T, orderId=None), ("key-absent",)),
    VdaVector("state", changed(headerId="7"), ("number-as-text",)),
    VdaVector("state", changed(loads="none"), ("value-unreadable",)),
    VdaVector("state", changed(agvPosition=position() | {"x": "1e999"}), ("value-unreadable", "position-missing")),
    VdaVector("state", state(T, version="1.1"), ("version-unknown",)),
    VdaVector("state", state(T, serialNumber="0002"), ("robot-not-of-topic",)),
    VdaVector("state", changed(timestamp="2026-09-21T14:13:20.00"), ("stamp-no-offset",)),
    VdaVector("state", changed(timestamp="2026-09-21T14:13:20+00"), ("stamp-offset-no-colon",)),
    VdaVector("state", changed(timestamp="2026-09-21T15:13:20+01:00"), ("stamp-not-utc",)),
    VdaVector("state", changed(timestamp="2026-09-21 14:13:20Z"), ("stamp-spelling",)),
    VdaVector("state", changed(timestamp="1790000000"), ("stamp-epoch",)),
    VdaVector(
        "factsheet",
        factsheet(T, agvGeometry={"envelopes2d": [{"set": "a", "polygonPoints": SQUARE}]}),
        ("outline-unreadable",),
    ),
    VdaVector(
        "factsheet",
        factsheet(T, agvGeometry={"envelopes2d": [{"set": "a", "polygonPoints": BOW_TIE}]}),
        ("outline-not-usable",),
    ),
    VdaVector("factsheet", sized(speedMax=0.0), ("speed-limit-not-positive",)),
    VdaVector("state", state(T, operatingMode="DREAMING"), ("word-unknown",)),
    VdaVector("state", state(T, batteryState={"batteryCharge": 101.0, "charging": False}), ("battery-out-of-range",)),
    VdaVector("state", state(T, velocity={"vx": 101.0}), ("speed-absurd",)),
    VdaVector("state", state(T, agvPosition=None), ("position-missing",)),
    VdaVector("state", state(T, agvPosition=position(mapId=None)), ("map-missing",)),
    VdaVector("visualization", visualization(T, 0.0, 0.0), ()),
    VdaVector("state", state(T, theta=None), ("heading-missing",)),
    VdaVector("order", order(T, [node(number, 0.0) for number in range(3001)]), ("order-too-long",)),
    VdaVector("order", order(T, [node(0, 0.0), node(1, 1.0, sequenceId=0)]), ("sequence-ids-odd",)),
    VdaVector("order", order(T, [node(0, 0.0), node(1, 1.0)], [edge(7)]), ("edge-misfit",)),
    VdaVector(
        "order",
        order(T, [node(0, 0.0), node(1, 1.0)], [{"sequenceId": 1, "trajectory": {"controlPoints": []}}]),
        ("trajectory-unreadable",),
    ),
    VdaVector(
        "order",
        order(T, [node(0, 0.0), node(1, 1.0)], [edge(0, trajectory=ROUND | {"knotVector": [0.0, 1.0]})]),
        ("trajectory-odd",),
    ),
    VdaVector("order", order(T, [node(n, 0.0) for n in range(27)], WINDING), ("curves-too-many",)),
    VdaVector(
        "state",
        state(T, orderId="o1", driving=True, nodeStates=node_states([node(1, 0.0)])),
        ("order-unseen", "node-without-place"),
    ),
    VdaVector("state", planned(waypoint("soon"), waypoint(LATER)), ("point-time-unreadable",)),
    VdaVector("state", planned("left", waypoint(LATER)), ("point-unreadable",)),
    VdaVector("state", planned(waypoint(LATER, 2e7)), ("point-absurd",)),
    VdaVector("state", planned(waypoint("2026-09-21T14:13:20Z")), ("path-past",)),
    VdaVector("state", planned(waypoint(LATER), waypoint("2026-09-21T14:13:23Z")), ("path-unordered",)),
)
