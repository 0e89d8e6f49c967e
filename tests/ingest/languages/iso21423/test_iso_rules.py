import json
from dataclasses import dataclass
from typing import Any

import pytest

from ingest.languages.iso21423.iso_rules import RULES
from ingest.languages.model import Rejection
from ingest.languages.timestamps import write
from tests.helpers.iso_saying import at, identity, iso, odometry, points, states, trajectory
from tests.ingest.languages.iso21423.made_iso import IsoListener, T

HUGE = [{"x": 0.0, "y": 0.0}, {"x": 900.0, "y": 0.0}, {"x": 0.0, "y": 1.0}]
BOW_TIE = [{"x": x, "y": y} for x, y in ((0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 1.0))]
NOWHERE = {"locationPoint": {"x": 0.0, "y": 0.0}, "orientation": {"yaw": 0.0}}
POINT = {"timestamp": "2026-09-21T14:13:24Z", "locationPoint": at(1.0, 0.0)}


@dataclass(frozen=True, slots=True)
class IsoVector:
    """A message, its resource, and the rules that it breaks."""

    resource: str
    raw: bytes
    findings: tuple[str, ...] = ()
    rejected: str | None = None


def changed(**keys: Any) -> bytes:
    """An odometry with keys replaced."""
    return json.dumps(json.loads(odometry(T)) | keys).encode()


def stamped(text: str, findings: tuple[str, ...], rejected: str | None = None) -> IsoVector:
    return IsoVector("odometry", changed(timestamp=text), findings, rejected)


WAY = {"degree": 2, "controlPoints": [{"locationPoint": at(x, 0.0)} for x in (0.0, 5.0, 9.0)]}
VECTORS = (
    IsoVector("odometry", odometry(T)),
    IsoVector("identity", identity(T)),
    IsoVector("footprint", iso(T, footprint=[{"x": 1.0, "y": 0.0}, {"x": 0.0, "y": 1.0}, {"x": -1.0, "y": 0.0}])),
    IsoVector("status", states(T, "MODE_AUTO", "FORWARD")),
    IsoVector("globalPath", iso(T), ("key-absent",)),
    IsoVector("globalPath", iso(T, globalPath=WAY)),
    IsoVector("globalPath", iso(T, globalPath=WAY | {"degree": 5}), ("trajectory-unreadable",)),
    IsoVector("globalPath", iso(T, globalPath=WAY | {"knots": [0, 1]}), ("trajectory-odd",)),
    IsoVector("disconnection", iso(T, states=["LOST_CONNECTION"])),
    IsoVector("request", iso(T), rejected="topic-unknown"),
    IsoVector("odometry", b"\xff\xfe", rejected="not-utf8"),
    IsoVector("status", states(T, "MODE_AUTO", "X").replace(b'"X"', b'"\xff"'), ("text-not-utf8", "word-unknown")),
    IsoVector("odometry", b"{", rejected="not-json"),
    IsoVector("odometry", b'{"a":' * 100_000, rejected="too-deep"),
    IsoVector("odometry", b"[]", rejected="not-object"),
    IsoVector("odometry", b'{"timestamp": [', rejected="not-json"),
    IsoVector("odometry", iso(T), ("key-absent",), "position-absurd"),
    IsoVector("odometry", odometry(T, 2e7), (), "position-absurd"),
    IsoVector("identity", identity(T, imrFootprint=[]), ("envelope-not-positive",)),
    IsoVector("identity", identity(T, imrHeight=190.0)),
    IsoVector("identity", identity(T, imrFootprint=HUGE)),
    IsoVector("identity", identity(T, imrFootprint=BOW_TIE), ("outline-not-usable",)),
    IsoVector("status", iso(T), ("key-absent", "mode-missing")),
    IsoVector("batteryStatus", iso(T, batterySoc="0.5"), ("number-as-text",)),
    IsoVector("batteryStatus", iso(T, batterySoc="0,5"), ("number-as-text",)),
    IsoVector("odometry", iso(T, odometry=json.loads(odometry(T))), ("nested-otherwise",)),
    IsoVector("odometry", changed(pose=at(0.0, 0.0, yaw=0.0)), ("nested-otherwise",)),
    IsoVector("odometry", iso(T, **at(0.0, 0.0), yaw=0.0, linear=0.5, angular=0.0), ("nested-otherwise",)),
    IsoVector("localTrajectory", iso(T, localTrajectory=[at(0.0, 0.0, timestamp=write(T))]), ("nested-otherwise",)),
    IsoVector("odometry", changed(velocity="fast"), ("value-unreadable", "key-absent")),
    stamped("soon", ("stamp-unreadable",)),
    stamped("1960-01-01T00:00:00Z", ("stamp-absurd",)),
    stamped("2026-09-21T14:13:20.000", ("stamp-no-offset",)),
    stamped("2026-09-21T14:13:20+00", ("stamp-offset-no-colon",)),
    stamped("2026-09-21T15:13:20+01:00", ("stamp-not-utc",)),
    stamped("2026-09-21T14:13:20,500Z", ("stamp-spelling",)),
    stamped("1790000000", ("stamp-epoch",)),
    IsoVector("identity", identity(T, ratedSpeed=0.0), ("speed-limit-not-positive",)),
    IsoVector("batteryStatus", iso(T, batterySoc=15), ("battery-out-of-range",)),
    IsoVector("batteryStatus", iso(T, batterySoc=1.2), ("battery-out-of-range",)),
    IsoVector("odometry", odometry(T, speed=101.0), ("speed-absurd",)),
    IsoVector("odometry", odometry(T, yaw=None), ("null-value", "heading-missing")),
    IsoVector("odometry", odometry(T) + b"\0", ("json-spelling",)),
    IsoVector("odometry", b"\xef\xbb\xbf" + odometry(T), ("byte-order-mark",)),
    IsoVector(
        "odometry", changed(pose={"location_point": at(0.0, 0.0), "orientation": {"yaw": 0.0}}), ("key-spelling",)
    ),
    IsoVector(
        "odometry", changed(pose=[{"locationPoint": at(0.0, 0.0), "orientation": {"yaw": 0.0}}]), ("single-not-list",)
    ),
    IsoVector(
        "odometry", changed(velocity=None, velocities={"linear": 0.0}), ("null-value", "key-unknown", "key-absent")
    ),
    IsoVector(
        "odometry",
        changed(pose={"locationPoint": at(0.0, 0.0, ccsId=3), "orientation": {"yaw": 0.0}}),
        ("text-as-number",),
    ),
    IsoVector("status", states(T, "mode-auto", "Blocked"), ("word-spelling",)),
    IsoVector("status", states(T, "MODE_AUTO", "DANCING"), ("word-unknown",)),
    IsoVector("status", iso(T, operatingStates=["MODE_AUTO", "BLOCKED"])),
    IsoVector("odometry", changed(pose=NOWHERE), ("map-missing",)),
    IsoVector("localTrajectory", iso(T, localTrajectory=[POINT | {"timestamp": "soon"}]), ("point-time-unreadable",)),
    IsoVector("localTrajectory", iso(T, localTrajectory=[POINT, "left"]), ("point-unreadable",)),
    IsoVector("localTrajectory", trajectory(T, (T + 1, 2e7, 0.0)), ("point-absurd",)),
    IsoVector("localTrajectory", trajectory(T, (T, 1.0, 0.0), (T, 2.0, 0.0)), ("path-times-equal",)),
    IsoVector("localTrajectory", trajectory(T, (T + 2, 1.0, 0.0), (T + 1, 2.0, 0.0)), ("path-unordered",)),
    IsoVector("globalPlan", iso(T, globalPlan=points((T + 60, 1.0, 0.0)))),
    IsoVector("odometry", json.dumps([1]).encode(), rejected="not-object"),
    IsoVector(
        "identity",
        json.dumps({"timestamp": {}, "details": 1, "manufacturerName": 1}).encode(),
        ("value-unreadable", "text-as-number", "key-absent", "stamp-unreadable", "envelope-not-positive"),
    ),
)


@pytest.mark.parametrize("vector", VECTORS, ids=lambda each: each.rejected or " ".join(each.findings) or each.resource)
def test_a_message_breaks_the_rules_of_its_vector(vector: IsoVector) -> None:
    message = IsoListener().hears(vector.resource, vector.raw)
    assert isinstance(message, Rejection) == bool(vector.rejected)
    if isinstance(message, Rejection):
        assert message.rule == vector.rejected
        assert message.reason
    assert sorted(message.findings) == sorted(vector.findings)


@pytest.mark.parametrize("code", [rule.code for rule in RULES.values() if rule.alone])
def test_a_rule_that_one_message_shows_has_a_vector(code: str) -> None:
    assert any(code == vector.rejected or code in vector.findings for vector in VECTORS)
