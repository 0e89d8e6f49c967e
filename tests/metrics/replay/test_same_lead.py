"""Robots are warned of as early in one language as in another, also where they drive slower than they may."""

import json
from collections.abc import Iterator
from math import cos, pi, sin
from pathlib import Path
from random import Random
from statistics import median

from deconflict.operator.blackbox.start_state import StartState
from deconflict.settings.site import Site
from ingest.languages.timestamps import write
from ingest.recording.log_reader import LogReader
from ingest.settings import Datum
from metrics.replay.engine_run import EngineRun
from metrics.replay.recorded_passes import PassReader
from tests.helpers.saying import HALL, identity, points, status
from tests.helpers.vda_saying import MAP, factsheet, node, order, topic, under_way

NOW_S = 1_790_000_000.0
SITE = Site(datums=(Datum(id=MAP, name="Hall"), Datum(id=HALL, name="Other hall")))
MEETS_S, SCENES = 18.0, 20
Way = tuple[float, float, float]
"""Speed and direction of a robot, and how far it may be late at the crossing."""


def ways(random: Random) -> list[Way]:
    """Two robots that cross, each at half of the 1.2 to 2 m/s that it may drive."""
    direction_rad = random.uniform(0.0, 2 * pi)
    return [
        (random.uniform(0.6, 1.0), direction_rad + turn_rad, random.uniform(0.0, 0.3))
        for turn_rad in (0.0, random.uniform(0.8, 2.0))
    ]


def place(way: Way, t_s: float) -> tuple[float, float]:
    mps, direction_rad, late_s = way
    along_m = mps * (t_s - MEETS_S - late_s)
    return along_m * cos(direction_rad), along_m * sin(direction_rad)


def in_massrobotics(driven: list[Way]) -> Iterator[tuple[float, str, bytes]]:
    for number in range(len(driven)):
        yield NOW_S, "", identity(f"R-{number}", NOW_S)
    for second in range(int(MEETS_S)):
        for number, way in enumerate(driven):
            x, y = place(way, second)
            ahead = points(*((NOW_S + second + i, *place(way, second + i), way[1]) for i in range(1, 11)))
            raw = status(f"R-{number}", NOW_S + second, x, y, way[1], velocity={"linear": way[0]}, path=ahead)
            yield NOW_S + second + 0.05, "", raw


def in_vda_5050(driven: list[Way]) -> Iterator[tuple[float, str, bytes]]:
    size = {"length": 1.0, "width": 0.7, "heightMax": 0.3}
    nodes = [[node(0, *place(way, 0.0)), node(1, *place(way, 2 * MEETS_S))] for way in driven]
    for number, way in enumerate(driven):
        serial, parameters = f"{number}", size | {"speedMax": 2 * way[0]}
        yield NOW_S, topic("factsheet", serial), factsheet(NOW_S, serialNumber=serial, physicalParameters=parameters)
        yield NOW_S, topic("order", serial), order(NOW_S, nodes[number], serialNumber=serial)
    for second in range(int(MEETS_S)):
        for number, way in enumerate(driven):
            x, y = place(way, second)
            keys = {"serialNumber": f"{number}", "theta": way[1], "velocity": {"vx": way[0], "omega": 0.0}}
            raw = under_way(NOW_S + second, x, y, nodes[number][1:], **keys)
            yield NOW_S + second + 0.05, topic("state", f"{number}"), raw


def lead_s(log: Path, messages: Iterator[tuple[float, str, bytes]]) -> float:
    """How long before the crossing the service warns; 0 if it does not."""
    lines = []
    for t_s, on_topic, raw in messages:
        document = json.loads(raw)
        sent = {"topic": on_topic, "payload": document, "time": write(t_s)}
        lines.append(sent if on_topic else {"received": write(t_s), "message": document})
    log.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    reader, engine = PassReader(SITE), EngineRun(SITE, SITE.conflict.clearance_m, StartState())
    for each in reader.passes_of(LogReader().read([log])):
        if any(advisory.kind == "conflict" for advisory in engine.advance(each).advisories):
            return NOW_S + MEETS_S - each.now_s
    return 0.0


def test_crossings_at_half_the_limit_are_warned_of_as_early_as_by_paths(tmp_path: Path) -> None:
    leads_s: tuple[list[float], list[float]] = ([], [])
    for seed in range(SCENES):
        driven = ways(Random(seed))
        for found, messages in zip(leads_s, (in_massrobotics(driven), in_vda_5050(driven)), strict=True):
            found.append(lead_s(tmp_path / "log.jsonl", messages))
    paths_s, orders_s = map(median, leads_s)
    assert paths_s > 7.0
    assert abs(paths_s - orders_s) <= 1.0


def turning_beside_one_that_stands() -> Iterator[tuple[float, str, bytes]]:
    """From 12 s on a robot of 3 x 1 m turns on the spot by a quarter, at 0.3 rad/s; another one stands beside it."""
    size = {"x": 3.0, "y": 1.0, "z": 0.3}
    yield NOW_S, "", identity("R-1", NOW_S, baseRobotEnvelope=size)
    yield NOW_S, "", identity("R-2", NOW_S, baseRobotEnvelope={"x": 0.6, "y": 0.6, "z": 0.3})

    def yaw_rad(t_s: float) -> float:
        return min(max(0.3 * (t_s - 12.0), 0.0), pi / 2)

    for second in range(int(MEETS_S)):
        ahead = points(*((NOW_S + second + i, 0.0, 0.0, yaw_rad(second + i)) for i in range(1, 11)))
        still = {"linear": 0.0}
        turns = status("R-1", NOW_S + second, 0.0, 0.0, yaw_rad(second), velocity=still, path=ahead)
        yield NOW_S + second + 0.05, "", turns
        stands = status("R-2", NOW_S + second, 0.0, 1.3, velocity=still, operationalState="idle")
        yield NOW_S + second + 0.05, "", stands


def test_a_turn_on_the_spot_beside_a_robot_that_stands_is_warned_of(tmp_path: Path) -> None:
    assert lead_s(tmp_path / "log.jsonl", turning_beside_one_that_stands()) > 7.0
