"""One odd value costs itself. Drawn over all keys that are read, in each language."""

import json
from collections.abc import Callable
from math import isnan
from random import Random
from typing import Any

import msgspec
import pytest

from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.iso21423.iso_messages import RESOURCES
from ingest.languages.massrobotics.fast_decoder import struct_of
from ingest.languages.massrobotics.report_models import IdentityReport, StatusReport
from ingest.languages.model import Identity, Message, Rejection, Status, Update
from ingest.languages.tolerance.spelling import folded
from ingest.languages.tolerance.value_kinds import object_kind
from ingest.languages.vda5050.vda_messages import KINDS
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import HALL, identity, robot
from tests.helpers.vda_saying import edge, node, node_states
from tests.helpers.vectors import at, here, said
from tests.ingest.languages.tolerance.made_oddities import Drawn, Place, drawn, respelt

DRAWS = 1500
T = 1_790_000_000.0
OF_THE_MOTION = {"state", "known_state", "path", "destinations", "path_basis", "is_blocked", "reports_within_s"}
"""What a state of VDA 5050 says all together: no key of them alone."""
NOT_COMPARED = {"findings", "oddities", "stamp_s", "stamp_resolution_s"}


def plain(value: Any) -> Any:
    """A part of a message that can be compared, nan included."""
    if isinstance(value, msgspec.Struct):
        return tuple(plain(getattr(value, name)) for name in value.__struct_fields__)
    if isinstance(value, tuple | list):
        return tuple(map(plain, value))
    return "nan" if isinstance(value, float) and isnan(value) else value


def differing(message: Status | Identity, other: Status | Identity) -> set[str]:
    names = set(type(message).__struct_fields__) - NOT_COMPARED
    return {name for name in names if plain(getattr(message, name)) != plain(getattr(other, name))}


def is_named(message: Message, odd: Drawn) -> bool:
    """Whether a deviation names the place of the value, what is in it, or what it is in."""
    return any(
        oddity.path.startswith(odd.path) or odd.path.startswith(oddity.path) or oddity.path.startswith(odd.path[:59])
        for oddity in message.oddities
    )


def check(message: Message, odd: Drawn, usual: Message, depends: set[str]) -> None:
    """The message is accepted, its deviation named, and all that does not depend on the value is as usual."""
    shown = f"{odd.path} = {odd.value!r}: {message}"
    assert not isinstance(message, Rejection), shown
    assert type(message) is type(usual), shown
    assert message.findings, shown
    assert is_named(message, odd), shown
    if isinstance(message, Status | Identity) and isinstance(usual, Status | Identity):
        changed = differing(message, usual)
        assert changed <= (set() if odd.is_plain else depends), f"{changed} changed by {shown}"
        if isinstance(message, Status) and isinstance(usual, Status):
            assert (message.x, message.y) == (usual.x, usual.y), shown


MASSROBOTICS_STATUS = json.loads(
    said(
        uuid=robot("A-1"),
        location=here(z=0.5, planarDatum=HALL),
        velocity={"linear": 0.5, "angular": {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}},
        batteryPercentage=81.5,
        remainingRunTime=3.0,
        loadPercentageStillAvailable=40.0,
        errorCodes=["E1"],
        operationalState="navigating",
        destinations=[at(1_700_000_060.0, z=0.0)],
        path=[at(1_700_000_001.0, planarDatumUUID=HALL), at(1_700_000_002.0, 3.5)],
    )
)
MASSROBOTICS_IDENTITY = json.loads(
    identity("A-1", T, cargoMaxVolume={"x": 1.0, "y": 0.8, "z": 1.0}, cargoMaxWeight="400", maxRunTime=8.0)
)
OF_STATUS: dict[str, set[str]] = {
    "timestamp": {"path", "destinations"},
    "operationalState": {"state", "known_state"},
    "location": {"z", "yaw_rad", "datum"},
    "velocity": {"linear_mps", "turn_rad_per_s"},
    "errorCodes": {"error_codes"},
    "destinations": {"destinations"},
    "path": {"path"},
    "batteryPercentage": {"amounts"},
    "remainingRunTime": {"amounts"},
    "loadPercentageStillAvailable": {"amounts"},
}
OF_IDENTITY = {
    "manufacturerName": {"manufacturer"},
    "robotModel": {"model"},
    "robotSerialNumber": {"serial"},
    "baseRobotEnvelope": {"envelope_m"},
    "maxSpeed": {"max_speed_mps"},
    "cargoMaxVolume": {"figures"},
}


def without_uuid(document: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in document.items() if key != "uuid"}


@pytest.mark.parametrize(
    ("document", "model", "depends", "but"),
    [
        (MASSROBOTICS_STATUS, StatusReport, OF_STATUS, (("uuid",), ("location", "x"), ("location", "y"))),
        (
            MASSROBOTICS_IDENTITY,
            IdentityReport,
            OF_IDENTITY,
            (("uuid",), ("baseRobotEnvelope", "x"), ("baseRobotEnvelope", "y")),
        ),
    ],
    ids=["status", "identity"],
)
def test_one_odd_value_of_massrobotics_costs_itself(
    document: dict[str, Any], model: Any, depends: dict[str, set[str]], but: tuple[Place, ...]
) -> None:
    random, kind = Random(1), object_kind(struct_of(model))
    front_end = FRONT_ENDS["massrobotics"]
    usual, _ = front_end.read(json.dumps(document).encode(), "", None, None)
    assert usual.findings == ()
    for _ in range(DRAWS):
        odd = drawn(random, document, kind, but)
        raw = json.dumps(odd.document).encode()
        message, _ = front_end.read(raw, "", None, None)
        check(message, odd, usual, depends.get(str(odd.place[0]), set()))
        json.dumps(front_end.document(raw), allow_nan=False)


NODES = [node(0, 0.0), node(1, 4.0, actions=[{"actionId": "7", "blockingType": "HARD"}]), node(2, 10.0, released=False)]
CURVE = {"degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0], "controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 4.0, "y": 0.0}]}
ORDER = json.loads(
    vda_saying.order(
        T - 1,
        NODES,
        [edge(0, maxSpeed=1.0, orientation=0.0, orientationType="TANGENTIAL", trajectory=CURVE), edge(1, maxSpeed=0.5)],
    )
)
STATE = json.loads(
    vda_saying.under_way(
        T,
        1.0,
        0.0,
        NODES[1:],
        agvPosition=vda_saying.position(1.0, deviationRange=0.2, mapId="3"),
        velocity={"vx": 0.5, "vy": 0.0, "omega": 0.0},
        edgeStates=[{"edgeId": "e0", "sequenceId": 1, "released": True, "trajectory": CURVE}],
        loads=[
            {
                "boundingBoxReference": {"x": 0.0, "y": 0.0, "z": 0.2, "theta": 0.0},
                "loadDimensions": {"length": 1.2, "width": 0.8, "height": 0.2},
            }
        ],
        paused=False,
        newBaseRequest=False,
        actionStates=[{"actionId": "7", "actionType": "pick", "actionStatus": "WAITING"}],
        errors=[{"errorType": "low", "errorLevel": "WARNING"}],
        nodeStates=[{**each, "nodePosition": {"x": 4.0, "y": 0.0, "mapId": "3"}} for each in node_states(NODES[1:2])],
    )
)
STATE_3 = json.loads(
    vda_saying.state_3(
        T,
        1.0,
        zoneRequests=[{"requestStatus": "GRANTED"}],
        edgeRequests=[{"requestStatus": "GRANTED"}],
        intermediatePath={"polyline": [{"x": 2.0, "y": 0.0, "eta": "2026-09-21T14:13:24Z", "theta": 0.0}]},
        plannedPath={"trajectory": CURVE},
        velocity={"vx": 0.5},
        driving=True,
    )
)
FACTSHEET = json.loads(
    vda_saying.factsheet(
        T - 2,
        agvGeometry={
            "envelopes2d": [{"polygonPoints": [{"x": x, "y": y} for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))]}]
        },
    )
)
OF_STATE: dict[str, set[str]] = {
    "agvPosition": {"yaw_rad", "datum", "is_lost", "deviation_m", *OF_THE_MOTION},
    "mobileRobotPosition": {"yaw_rad", "datum", "is_lost", "deviation_m", *OF_THE_MOTION},
    "velocity": {"linear_mps", "turn_rad_per_s", *OF_THE_MOTION},
    "loads": {"loads", "amounts"},
    "batteryState": {"amounts", *OF_THE_MOTION},
    "powerSupply": {"amounts", *OF_THE_MOTION},
    "errors": {"error_codes", "is_blocked"},
}
OF_FACTSHEET = {
    "typeSpecification": {"model"},
    "physicalParameters": {"envelope_m", "max_speed_mps", "figures"},
    "agvGeometry": {"envelope_m", "outline", "offset_m", "figures"},
}
POSITION_2: tuple[Place, ...] = (("agvPosition", "x"), ("agvPosition", "y"))
POSITION_3: tuple[Place, ...] = (("mobileRobotPosition", "x"), ("mobileRobotPosition", "y"))
SIZE: tuple[Place, ...] = (("physicalParameters", "length"), ("physicalParameters", "width"))


def heard(language: str, messages: list[tuple[str, dict[str, Any]]], topic: Callable[[str], str]) -> list[Message]:
    """What the messages of one robot say, one after the other."""
    front_end, memory, said_of = FRONT_ENDS[language], None, []
    for kind, document in messages:
        message, memory = front_end.read(json.dumps(document).encode(), topic(kind), memory, None)
        said_of.append(message)
    return said_of


@pytest.mark.parametrize(
    ("kind", "document", "depends", "but"),
    [
        ("state", STATE, OF_STATE, POSITION_2),
        ("state", STATE_3, OF_STATE, POSITION_3),
        ("factsheet", FACTSHEET, OF_FACTSHEET, SIZE),
        ("order", ORDER, {}, ()),
    ],
    ids=["state", "state-3", "factsheet", "order"],
)
def test_one_odd_value_of_vda_5050_costs_itself(
    kind: str, document: dict[str, Any], depends: dict[str, set[str]], but: tuple[Place, ...]
) -> None:
    random, object_of = Random(2), object_kind(KINDS[kind])
    row = ("factsheet", "order", "state").index(kind)
    messages = [("factsheet", FACTSHEET), ("order", ORDER), ("state", document if kind == "state" else STATE)]
    usual = heard("vda5050", messages, vda_saying.topic)
    assert [message.findings for message in usual] == [()] * 3
    for _ in range(DRAWS):
        odd = drawn(random, document, object_of, but)
        messages[row] = kind, odd.document
        found = heard("vda5050", messages, vda_saying.topic)
        check(found[row], odd, usual[row], depends.get(str(odd.place[0]), OF_THE_MOTION if kind == "state" else set()))
        last, of_usual = found[-1], usual[-1]
        assert isinstance(last, Status)
        assert isinstance(of_usual, Status)
        changed = differing(last, of_usual)
        loses_nothing = odd.is_plain or odd.place[-1] == "sequenceId"
        assert changed <= (set() if loses_nothing else {*OF_THE_MOTION, *depends.get(str(odd.place[0]), set())})


ISO: dict[str, dict[str, Any]] = {
    "identity": json.loads(iso_saying.identity(T)),
    "footprint": json.loads(iso_saying.iso(T, footprint=iso_saying.SQUARE, height=1.0)),
    "status": json.loads(iso_saying.states(T, "MODE_AUTO", "FORWARD")),
    "batteryStatus": json.loads(iso_saying.iso(T, batterySoc=0.5)),
    "globalPlan": json.loads(iso_saying.iso(T, globalPlan=iso_saying.points((T + 60, 9.0, 0.0)))),
    "localTrajectory": json.loads(iso_saying.trajectory(T, (T + 1, 2.0, 0.0), (T + 2, 3.0, 0.0))),
    "odometry": json.loads(iso_saying.odometry(T, 1.0, 2.0, 0.1, 0.5)),
}
OF_ISO: dict[str, set[str]] = {
    "identity": set(),
    "footprint": set(),
    "status": {"state", "is_blocked", "is_lost"},
    "batteryStatus": {"amounts"},
    "globalPlan": {"destinations"},
    "localTrajectory": {"path", "state"},
    "odometry": {"yaw_rad", "datum", "linear_mps", "turn_rad_per_s", "state", "is_blocked", "path"},
}
OF_ISO_IDENTITY = {"manufacturer", "model", "serial", "envelope_m", "outline", "offset_m", "max_speed_mps"}


@pytest.mark.parametrize("resource", ISO)
def test_one_odd_value_of_iso_21423_costs_itself(resource: str) -> None:
    random, object_of, row = Random(3), object_kind(RESOURCES[resource]), list(ISO).index(resource)
    point = ("pose", "locationPoint")
    but: dict[str, tuple[Place, ...]] = {
        "odometry": ((*point, "x"), (*point, "y")),
        "identity": (("details", "imrFootprint"),),
    }
    usual = heard("iso21423", list(ISO.items()), iso_saying.topic)
    assert [message.findings for message in usual] == [()] * len(ISO)
    for _ in range(DRAWS // 3):
        odd = drawn(random, ISO[resource], object_of, but.get(resource, ()))
        messages = [(kind, odd.document if kind == resource else ISO[kind]) for kind in ISO]
        found = heard("iso21423", messages, iso_saying.topic)
        check(found[row], odd, usual[row], OF_ISO_IDENTITY if row < 2 else OF_ISO[resource])
        last, of_usual = found[-1], usual[-1]
        assert isinstance(last, Status)
        assert isinstance(of_usual, Status)
        assert differing(last, of_usual) <= (set() if odd.is_plain else OF_ISO[resource])
        assert all(isinstance(message, Identity | Status | Update) for message in found)


def check_spelling(message: Message, odd: Drawn, usual: Message) -> None:
    """The key is read as the one that is meant, counted and named."""
    shown = f"{odd.path} as {odd.value!r}: {message}"
    assert "key-spelling" in message.findings, shown
    assert any(oddity.nearest == odd.place[-1] and oddity.path.endswith(odd.value) for oddity in message.oddities), (
        shown
    )
    if isinstance(usual, Status | Identity):
        assert isinstance(message, Status | Identity), shown
        assert differing(message, usual) == set(), shown


@pytest.mark.parametrize(
    ("document", "model"), [(MASSROBOTICS_STATUS, StatusReport), (MASSROBOTICS_IDENTITY, IdentityReport)]
)
def test_a_key_of_massrobotics_in_another_spelling_is_read(document: dict[str, Any], model: Any) -> None:
    random, kind, front_end = Random(4), object_kind(struct_of(model)), FRONT_ENDS["massrobotics"]
    usual, _ = front_end.read(json.dumps(document).encode(), "", None, None)
    for _ in range(DRAWS // 3):
        odd = respelt(random, document, kind)
        check_spelling(front_end.read(json.dumps(odd.document).encode(), "", None, None)[0], odd, usual)


@pytest.mark.parametrize(
    ("kind", "document"), [("state", STATE), ("state", STATE_3), ("factsheet", FACTSHEET), ("order", ORDER)]
)
def test_a_key_of_vda_5050_in_another_spelling_is_read_in_each_message(kind: str, document: dict[str, Any]) -> None:
    random, object_of = Random(5), object_kind(KINDS[kind])
    messages = [("factsheet", FACTSHEET), ("order", ORDER), ("state", STATE)]
    later: dict[str, Any] = {"timestamp": "2026-09-21T14:13:21Z", "headerid": 1_000_000}
    for _ in range(DRAWS // 5):
        odd = respelt(random, document, object_of)
        again = {key: later.get(folded(key), value) for key, value in odd.document.items()}
        usual_again = {key: later.get(folded(key), value) for key, value in document.items()}
        usual = heard("vda5050", [*messages, (kind, document), (kind, usual_again)][-2:], vda_saying.topic)
        found = heard("vda5050", [*messages, (kind, odd.document), (kind, again)][-2:], vda_saying.topic)
        for message, of_usual in zip(found, usual, strict=True):
            check_spelling(message, odd, of_usual)


@pytest.mark.parametrize("resource", ISO)
def test_a_key_of_iso_21423_in_another_spelling_is_read(resource: str) -> None:
    random, object_of, row = Random(6), object_kind(RESOURCES[resource]), list(ISO).index(resource)
    usual = heard("iso21423", list(ISO.items()), iso_saying.topic)
    for _ in range(DRAWS // 15):
        odd = respelt(random, ISO[resource], object_of)
        messages = [(kind, odd.document if kind == resource else ISO[kind]) for kind in ISO]
        check_spelling(heard("iso21423", messages, iso_saying.topic)[row], odd, usual[row])
