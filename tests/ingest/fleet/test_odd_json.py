"""Messages that are accepted although they are no JSON by the letter: the log must be readable all the same."""

import json
from pathlib import Path
from typing import Any

import pytest

from ingest.port.connection import Connection
from ingest.recording.log_reader import Received
from tests.helpers import iso_saying, saying, vda_saying
from tests.ingest.fleet.made_fleet import LINE, NOW_S, documents, fleet
from tests.ingest.recording.made_logs import read, recorder

SENT = (
    (LINE, saying.identity("A-1", NOW_S), saying.status("A-1", NOW_S + 1, 1.0, 2.0, batteryPercentage=-77)),
    (vda_saying.line("state"), vda_saying.state(NOW_S), vda_saying.state(NOW_S + 1, velocity={"vx": -77})),
    (iso_saying.line("odometry"), iso_saying.odometry(NOW_S), iso_saying.odometry(NOW_S + 1, speed=-77)),
)
ODD = ("nan", "NaN", "-nan(ind)", "-inf", "Infinity", "1.#IND", "+0.5", ".5", "1.", "01", "1,", "True", "None", "0x1")


@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("is_read", [True, False])
@pytest.mark.parametrize(("connection", "first", "raw"), SENT, ids=["massrobotics", "vda5050", "iso21423"])
def test_what_is_accepted_comes_back_from_the_log(  # type: ignore[no-untyped-def]
    tmp_path: Path, connection, first: bytes, raw: bytes, is_read: bool, odd: str
) -> None:
    of, sent = fleet(), raw.replace(b"-77", odd.encode()) if is_read else raw[:-1] + f', "other": {odd}}}'.encode()
    writer, _ = recorder(tmp_path)
    for at_s, message in ((NOW_S, first), (NOW_S + 1, sent), (NOW_S + 2, sent + b"\0")):
        rule = of.receive(message, at_s, connection)
        writer.received(message, at_s, connection, rule, deviates=of.newest_deviates)
    writer.close()
    events, unreadable = read(tmp_path)
    assert unreadable == 0
    assert [event.raw for event in events if isinstance(event, Received)] == [first, sent, sent + b"\0"]


POINT = {"x": 3.0, "y": 4.0}
ON_HALL = POINT | {"angle": saying.angle(0.5), "planarDatum": saying.HALL}
MASSROBOTICS = json.loads(saying.status("A-1", NOW_S, location=None))
VDA = json.loads(vda_saying.state(NOW_S, agvPosition=None))
ISO = json.loads(iso_saying.iso(NOW_S))
VDA_PLACE, ISO_PLACE = vda_saying.position(3.0, 4.0, 0.5), iso_saying.at(3.0, 4.0)
NAMES = ("position", "pose", "currentPosition", "robot_pose")
ELSEWHERE: list[tuple[Connection, dict[str, Any]]] = [
    *((LINE, MASSROBOTICS | {name: ON_HALL}) for name in NAMES),
    *((vda_saying.line("state"), VDA | {name: VDA_PLACE}) for name in NAMES),
    (vda_saying.line("state"), VDA | VDA_PLACE | {"position": "dock 5"}),
    *((iso_saying.line("odometry"), ISO | {"pose": {name: ISO_PLACE}}) for name in ("position", "location")),
    *((iso_saying.line("odometry"), ISO | {name: ISO_PLACE}) for name in ("position", "location")),
]


@pytest.mark.parametrize(("connection", "sent"), ELSEWHERE)
def test_a_robot_is_placed_by_whatever_key_says_where_it_is(connection: Connection, sent: dict[str, Any]) -> None:
    of = fleet()
    assert of.receive(json.dumps(sent).encode(), NOW_S, connection) is None
    (shown,) = documents(of)
    assert {"key-spelling", "nested-otherwise"} & shown["deviations"].keys()
    (robot,) = of.robots.values()
    assert robot.seen is not None
    assert (robot.seen.x_m, robot.seen.y_m) == (3.0, 4.0)


def test_an_identity_that_says_where_its_robot_is_stays_an_identity() -> None:
    of = fleet()
    sent = json.loads(saying.identity("A-1", NOW_S)) | {"position": POINT, "robotModel": None}
    assert of.receive(json.dumps(sent).encode(), NOW_S, LINE) is None
    assert documents(of)[0]["identified"]
