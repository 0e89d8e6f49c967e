"""Captures of a broker: two robots whose orders cross."""

import json
from pathlib import Path

import pytest

from deconflict.settings.site import Site
from deconflict_client.advisory import AnyAdvisory
from ingest.languages.timestamps import write
from ingest.recording.log_reader import Event, LogReader, Received
from ingest.settings import Datum
from metrics.replay.conformance_counts import conform, page
from metrics.replay.replay import replay
from tests.helpers.vda_saying import MAP, factsheet, node, order, topic, under_way

NOW_S = 1_790_000_000.0
SITE = Site(datums=(Datum(id=MAP, name="Hall"),))


def capture_of_a_crossing(path: Path) -> Path:
    """Two robots drive at 1 m/s and cross at 12 s. Only their orders say where."""
    lines = []

    def say(kind: str, serial: str, t_s: float, raw: bytes) -> None:
        payload = json.loads(raw) | {"serialNumber": serial}
        time = write(t_s) if kind == "state" else t_s
        lines.append({"time": time, "topic": topic(kind, serial), "payload": payload})

    ways = {"1": [node(0, -12.0), node(1, 12.0)], "2": [node(0, 0.0, -12.0), node(1, 0.0, 12.0)]}
    for serial, nodes in ways.items():
        say("factsheet", serial, NOW_S, factsheet(NOW_S))
        say("order", serial, NOW_S, order(NOW_S, nodes))
    for second in range(25):
        t_s, along = NOW_S + second, second - 12.0
        for serial, (x, y, theta) in {"1": (along, 0.0, 0.0), "2": (0.0, along, 1.5708)}.items():
            raw = under_way(t_s, x, y, ways[serial][1:], theta=theta, velocity={"vx": 1.0})
            say("state", serial, t_s + 0.05, raw)
    lines[-1]["payload"] = json.dumps(lines[-1]["payload"])  # some tools write the payload as text
    path.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    return path


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return capture_of_a_crossing(tmp_path / "capture.jsonl")


def events(log: Path) -> list[Event]:
    return list(LogReader().read([log]))


def test_a_capture_has_the_message_and_the_topic_of_each_line(capture: Path) -> None:
    messages = [event for event in events(capture) if isinstance(event, Received)]
    assert len(messages) == 54
    assert {message.connection.language for message in messages} == {"vda5050"}
    assert messages[0].connection.topic == topic("factsheet", "1")
    assert messages[0].arrival_s == NOW_S
    assert all(json.loads(message.raw)["serialNumber"] in message.connection.topic for message in messages)


def test_topics_of_no_language_are_counted_as_unreadable(tmp_path: Path) -> None:
    log = tmp_path / "capture.jsonl"
    log.write_text('{"time": 1790000000, "topic": "hall/temperature", "payload": 21.5}\n')
    reader = LogReader()
    assert not list(reader.read([log]))
    assert reader.unreadable == 1


def test_the_conflict_of_two_orders_is_predicted_before_the_robots_meet(capture: Path) -> None:
    reader, published = LogReader(), list[AnyAdvisory]()
    result = replay(
        reader, reader.read([capture]), SITE, [0.3], on_advisory=lambda _, revision: published.append(revision)
    )
    (figures,) = result["scores"]
    assert (figures["encounters"], figures["recall"], figures["precision"]) == (1, 1.0, 1.0)
    assert figures["lead_time_s"]["median"] > 6
    assert {revision.state for revision in published} >= {"raised", "cleared"}


def test_conform_names_the_standard_of_a_vendor(capture: Path) -> None:
    reader = LogReader()
    result = conform(reader, reader.read([capture]), SITE)
    (vendor,) = result["conformance"]
    assert (vendor["vendor"], vendor["languages"]) == ("KIT", ["vda5050"])
    assert "KIT (VDA 5050, versions 2.0, 2.1 and 3.0): 54 accepted, 0 rejected" in page(result)
