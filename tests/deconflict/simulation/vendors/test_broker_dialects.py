"""What the simulated vendors send to a broker: valid by the published schemas, and read back as it is meant."""

import asyncio
import json
from collections import defaultdict
from functools import cache, partial
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from aiomqtt import Client
from jsonschema import Draft202012Validator

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site_file import load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import layout_for
from deconflict.simulation.participants import VendorName, participants
from deconflict.simulation.robot_state import RobotState, robot_states
from deconflict.simulation.scripted_annex import split
from deconflict.simulation.vendors.broker_sender import ON_BROKERS, BrokerSender
from deconflict.simulation.vendors.senders import RobotFloor, simulate, warehouse
from deconflict.simulation.vendors.vda_dialect import TopicMessage
from ingest.batch import Basis
from ingest.fleet.fleet import Fleet
from ingest.languages.front_ends import language_of_topic
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.deconflict.operator.outlets.made_outlets import broker, needs_mosquitto
from tests.deconflict.roles.made_service import free_ports
from tests.helpers.patience import PATIENCE_S

SCHEMAS = Path(__file__).parents[3] / "helpers" / "vda5050_schemas"
NOW_S = 1_790_000_000.0
SECONDS = 90


@cache
def validator(version: str, kind: str) -> Draft202012Validator:
    folder = "3.0" if version.startswith("3") else version
    return Draft202012Validator(json.loads((SCHEMAS / folder / f"{kind}.schema.json").read_text()))


class Floor:
    """The demo's floor, whose vendors on brokers report once a second to a fleet."""

    def __init__(self) -> None:
        members, _ = split(participants(24))
        self.world = World(layout_for(24), members, np.random.default_rng(1))
        self.fleet: Fleet = fleet_of(load(demo_site()), Measures())
        self.sent: dict[str, list[TopicMessage]] = defaultdict(list)
        """By vendor."""
        self.robots: dict[str, RobotState] = {}
        """By name, at the last report."""
        self._speakers = {
            row: ON_BROKERS[member.make.vendor]()
            for row, member in enumerate(members)
            if member.make.vendor in ON_BROKERS
        }

    def run(self) -> None:
        rows = np.array(list(self._speakers), np.int64)
        for second in range(SECONDS):
            for _ in range(10):
                self.world.step(0.1)
            for row, robot in zip(rows.tolist(), robot_states(self.world, rows), strict=True):
                self.robots[robot.member.name] = robot
                for message in self._speakers[row].messages(robot, NOW_S + second, introduce=second == 0):
                    self.sent[robot.member.make.vendor.value].append(message)
                    self._receive(message, NOW_S + second)

    def _receive(self, message: TopicMessage, now_s: float) -> None:
        language = language_of_topic(message.topic)
        assert language is not None
        connection = Connection(1, "broker", language=language, topic=message.topic)
        assert self.fleet.receive(message.raw, now_s, connection) is None, message


@pytest.fixture(scope="module")
def floor() -> Floor:
    made = Floor()
    made.run()
    return made


def test_every_message_of_vda_5050_is_valid_by_the_schema_of_its_version(floor: Floor) -> None:
    versions: dict[str, set[str]] = defaultdict(set)
    for message in floor.sent[VendorName.BASALT]:
        document: dict[str, Any] = json.loads(message.raw)
        kind = message.topic.rpartition("/")[2]
        errors = [error.message for error in validator(document["version"], kind).iter_errors(document)]
        assert not errors, (message.topic, errors)
        versions[document["version"]].add(kind)
    kinds = {"connection", "factsheet", "order", "state"}
    assert versions == {"2.0.0": kinds, "2.1.0": kinds, "3.0.0": kinds}


def test_robots_are_where_they_are_and_forecast_by_their_orders_and_trajectories(floor: Floor) -> None:
    bases: dict[str, set[Basis]] = defaultdict(set)
    for robot in floor.fleet.robots.values():
        assert robot.seen is not None
        assert robot.forecast is not None
        number = int(robot.name.rpartition("-")[2].split()[-1])
        truth = floor.robots[f"{robot.vendor}-{number:02}"]
        assert hypot(robot.seen.x_m - truth.x_m, robot.seen.y_m - truth.y_m) < 0.1
        bases[robot.vendor].add(robot.forecast.basis)
    assert Basis.ORDER in bases["Basalt"]
    assert Basis.PATH in bases["Alder"]


def test_the_messages_break_no_rule_but_those_of_their_context(floor: Floor) -> None:
    broken = {rule for _, rule in floor.fleet.measures.values["deconflict_deviations_total"]}
    assert broken <= {"path-contradicts-motion", "heading-contradicts-motion", "turn-rate-contradicts-motion"}


@needs_mosquitto
async def test_simulated_vendors_report_to_a_real_broker() -> None:
    stop, heard = asyncio.Event(), set[str]()
    async with broker() as port, asyncio.timeout(PATIENCE_S), Client("127.0.0.1", port) as client:
        await client.subscribe("#")
        url = f"ws://127.0.0.1:{free_ports(1)[0]}"
        on_broker = partial(BrokerSender, host="127.0.0.1", port=port)
        floor = RobotFloor(*warehouse(8, 1))
        simulating = asyncio.create_task(simulate(url, floor, None, on_broker=on_broker, stop=stop))
        async for message in client.messages:
            heard.add(message.topic.value.rpartition("/")[2])
            if heard >= {"factsheet", "state", "identity", "odometry"}:
                break
        stop.set()
        sent = await simulating
    assert sent["Basalt"] > 0
    assert sent["Alder"] > 0
    assert sent["Corvid"] == 0, "nobody listens at its address"
