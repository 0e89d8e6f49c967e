"""Messages of each language as a conforming robot sends them, for trials of each of their keys.

They stand for nobody's messages; what is read of them is what the code reads. A key that the code reads and no sample
has is added to the first sample of its kind.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from ingest.languages import timestamps
from ingest.languages.iso21423.iso_messages import RESOURCES
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from ingest.languages.vda5050.vda_messages import KINDS

Document = dict[str, Any]
FLOOR = "0d6f4f0e-9d0c-4a6f-8a55-0c9f5f4a1b01"
ROBOT = "91403a21-7534-4467-99a6-79c46a130fe8"
TIMES = ("timestamp", "eta")
"""Keys whose value in a sample is the number of seconds after its message."""


class Sample(NamedTuple):
    """One kind of message of one language."""

    kind: str
    """As its topic or its schema calls it."""
    document: Document
    before: tuple[str, ...] = ()
    """Kinds of which the first sample is sent before it."""
    after: tuple[str, ...] = ()
    """The same after it: what it says shows in these."""
    title: str = ""


class SampleLanguage(NamedTuple):
    """The samples of a language, and how they are sent."""

    topic: Callable[[str], str]
    """The topic of a kind; "" if the language has none."""
    model: Callable[[str], Any]
    """The type that the code reads a kind into."""
    samples: tuple[Sample, ...]


_TURN = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def _massrobotics_point(ahead_s: float) -> Document:
    return {"timestamp": ahead_s, "x": ahead_s, "y": 0.0, "angle": _TURN, "planarDatumUUID": FLOOR}


MASSROBOTICS_SAMPLES = (
    Sample(
        "identityReport",
        {
            "uuid": ROBOT,
            "timestamp": 0.0,
            "manufacturerName": "Alder",
            "robotModel": "A1",
            "robotSerialNumber": "A-1",
            "baseRobotEnvelope": {"x": 1.2, "y": 0.8, "z": 0.4},
            "maxSpeed": 2.0,
        },
        after=("statusReport",),
    ),
    Sample(
        "statusReport",
        {
            "uuid": ROBOT,
            "timestamp": 0.0,
            "operationalState": "navigating",
            "location": {"x": 0.0, "y": 0.0, "z": 0.0, "angle": _TURN, "planarDatum": FLOOR},
            "velocity": {"linear": 1.0, "angular": _TURN},
            "batteryPercentage": 80.0,
            "errorCodes": ["low tyre"],
            "destinations": [_massrobotics_point(20.0)],
            "path": [_massrobotics_point(5.0), _massrobotics_point(10.0)],
        },
        before=("identityReport",),
    ),
)

_VDA_HEADER = {
    "headerId": 1,
    "timestamp": 0.0,
    "version": "2.1.0",
    "manufacturer": "KIT",
    "serialNumber": "0001",
}
_VDA_POSITION = {"x": 1.0, "y": 0.0, "theta": 0.0, "mapId": FLOOR, "positionInitialized": True}
_VDA_STATE = {
    **_VDA_HEADER,
    "orderId": "o1",
    "orderUpdateId": 0,
    "lastNodeId": "n0",
    "lastNodeSequenceId": 0,
    "nodeStates": [{"nodeId": "n1", "sequenceId": 2, "released": True}],
    "edgeStates": [{"edgeId": "e0", "sequenceId": 1, "released": True}],
    "agvPosition": _VDA_POSITION,
    "velocity": {"vx": 1.0, "vy": 0.0, "omega": 0.0},
    "driving": True,
    "paused": False,
    "loads": [],
    "actionStates": [],
    "batteryState": {"batteryCharge": 80.0, "charging": False},
    "operatingMode": "AUTOMATIC",
    "errors": [],
    "safetyState": {"eStop": "NONE", "fieldViolation": False},
}
_VDA_STATE_3 = {
    **{key: value for key, value in _VDA_STATE.items() if key not in ("agvPosition", "batteryState", "safetyState")},
    "version": "3.0.0",
    "mobileRobotPosition": {"x": 1.0, "y": 0.0, "theta": 0.0, "mapId": FLOOR, "localized": True},
    "powerSupply": {"stateOfCharge": 80.0, "charging": False},
    "safetyState": {"activeEmergencyStop": "NONE", "fieldViolation": False},
    "intermediatePath": {
        "polyline": [
            {"x": 1.0, "y": 0.0, "theta": 0.0, "eta": 0.0},
            {"x": 3.0, "y": 0.0, "theta": 0.0, "eta": 2.0},
        ]
    },
}


def _node(number: int) -> Document:
    place = {"x": 10.0 * number, "y": 0.0, "theta": 0.0, "mapId": FLOOR}
    return {"nodeId": f"n{number}", "sequenceId": 2 * number, "released": True, "nodePosition": place, "actions": []}


_EDGE = {
    "edgeId": "e0",
    "sequenceId": 1,
    "released": True,
    "startNodeId": "n0",
    "endNodeId": "n1",
    "maxSpeed": 0.5,
    "actions": [],
}
VDA_SAMPLES = (
    Sample(
        "factsheet",
        {
            **_VDA_HEADER,
            "typeSpecification": {"seriesName": "Carrier", "agvKinematic": "DIFF"},
            "physicalParameters": {"length": 1.2, "width": 0.8, "heightMax": 1.5, "speedMax": 1.0},
        },
        after=("state",),
    ),
    Sample("connection", {**_VDA_HEADER, "connectionState": "ONLINE"}, before=("factsheet", "state")),
    Sample(
        "order",
        {**_VDA_HEADER, "orderId": "o1", "orderUpdateId": 0, "nodes": [_node(0), _node(1)], "edges": [_EDGE]},
        before=("factsheet",),
        after=("state",),
    ),
    Sample("state", _VDA_STATE, before=("factsheet", "order"), title="state (2.x)"),
    Sample("state", _VDA_STATE_3, before=("factsheet",), title="state (3.0)"),
    Sample(
        "visualization",
        {**_VDA_HEADER, "agvPosition": _VDA_POSITION | {"x": 2.0}, "velocity": {"vx": 1.0, "vy": 0.0, "omega": 0.0}},
        before=("factsheet", "order", "state"),
    ),
)

_ISO_SQUARE = [{"x": 0.6, "y": 0.4}, {"x": -0.6, "y": 0.4}, {"x": -0.6, "y": -0.4}, {"x": 0.6, "y": -0.4}]


def _iso_point(ahead_s: float) -> Document:
    return {"timestamp": ahead_s, "locationPoint": {"ccsId": FLOOR, "x": ahead_s, "y": 0.0, "z": 0.0}}


ISO_SAMPLES = (
    Sample(
        "identity",
        {
            "timestamp": 0.0,
            "manufacturerName": "Acme",
            "details": {
                "imrModel": "TUG",
                "imrSerialNumber": "42",
                "imrFootprint": _ISO_SQUARE,
                "imrHeight": 1.9,
                "ratedSpeed": 1.8,
            },
        },
        after=("odometry",),
    ),
    Sample(
        "footprint",
        {"timestamp": 0.0, "footprint": _ISO_SQUARE[:3], "height": 1.0},
        before=("identity",),
        after=("odometry",),
    ),
    Sample(
        "odometry",
        {
            "timestamp": 0.0,
            "pose": {
                "locationPoint": {"ccsId": FLOOR, "x": 0.0, "y": 0.0, "z": 0.0},
                "orientation": {"yaw": 0.0, "pitch": 0.0, "roll": 0.0},
            },
            "velocity": {"linear": 1.0, "angular": 0.0},
        },
        before=("identity",),
    ),
    Sample(
        "localTrajectory",
        {"timestamp": 0.0, "localTrajectory": [_iso_point(2.0), _iso_point(4.0)]},
        before=("identity", "odometry"),
    ),
    Sample(
        "globalPlan",
        {"timestamp": 0.0, "globalPlan": [_iso_point(10.0), _iso_point(20.0)]},
        before=("identity", "odometry"),
    ),
    Sample(
        "globalPath",
        {
            "timestamp": 0.0,
            "globalPath": {
                "degree": 1,
                "controlPoints": [
                    {"locationPoint": {"ccsId": FLOOR, "x": x, "y": 0.0, "z": 0.0}, "weight": 1.0} for x in (0.0, 20.0)
                ],
                "knots": [0.0, 0.0, 1.0, 1.0],
            },
        },
        before=("identity", "odometry"),
    ),
    Sample(
        "status", {"timestamp": 0.0, "states": ["MODE_AUTOMATIC", "MOTION_DRIVING"]}, before=("identity", "odometry")
    ),
    Sample("batteryStatus", {"timestamp": 0.0, "batterySoc": 0.8}, before=("identity", "odometry")),
)

SAMPLE_LANGUAGES = {
    "massrobotics": SampleLanguage(
        lambda _: "",
        {"identityReport": IdentityReport, "statusReport": StatusReport}.__getitem__,
        MASSROBOTICS_SAMPLES,
    ),
    "vda5050": SampleLanguage("uagv/v2/KIT/0001/{}".format, KINDS.__getitem__, VDA_SAMPLES),
    "iso21423": SampleLanguage(f"/ISO_21423/v1/IMR/{ROBOT}/{{}}".format, RESOURCES.__getitem__, ISO_SAMPLES),
}


def stamped(document: Any, at_s: float) -> Any:
    """A message of that time, with its times as text."""
    if isinstance(document, list):
        return [stamped(value, at_s) for value in document]
    if not isinstance(document, dict):
        return document
    return {
        key: timestamps.write(at_s + value) if key in TIMES and type(value) is float else stamped(value, at_s)
        for key, value in document.items()
    }
