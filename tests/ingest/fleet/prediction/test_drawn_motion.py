"""Whatever robots report of their motion, they have a forecast that starts where they are and goes forward in time."""

from math import isfinite, pi
from random import Random
from typing import Any

import numpy as np
import pytest

from ingest.fleet.fleet import Fleet
from ingest.fleet.robot import Robot
from ingest.settings import Datum
from tests.helpers.saying import HALL, LOFT, angle, points, status
from tests.helpers.vda_saying import MAP, factsheet, line, node, order, position, under_way
from tests.ingest.fleet.made_fleet import LINE, NOW_S, fleet

REPORTS, ROBOTS = 40, 60
STATES = ("navigating", "navigating", "idle", "waitingExternalEvent", "manualOverride", "offline", "humming")


def near(random: Random, x: float, y: float) -> tuple[float, float, float]:
    """A place near another, or that one, and a heading."""
    spread_m = random.choice((0.0, 0.0, 0.05, 1.0, 5.0, 300.0))
    return x + random.uniform(-spread_m, spread_m), y + random.uniform(-spread_m, spread_m), random.uniform(-pi, pi)


def drawn_points(random: Random, t_s: float, x: float, y: float, most: int) -> list[dict[str, Any]]:
    step_s = random.choice((1.0, 1.0, 0.0, -3.0, 20.0))
    made = points(*((t_s + step_s * row, *near(random, x, y)) for row in range(1, random.randint(0, most) + 1)))
    for point in made:
        if random.random() < 0.3:
            point.pop("angle", None)
        if random.random() < 0.1:
            point["planarDatumUUID"] = random.choice((LOFT, HALL, "other"))
    return made


def in_massrobotics(of: Fleet, random: Random) -> None:
    t_s, x, y = NOW_S, 0.0, 0.0
    for _ in range(REPORTS):
        t_s += random.choice((1.0, 1.0, 1.0, 0.1, 4.0, 20.0, 60.0))
        x, y, yaw_rad = near(random, x, y)
        here: dict[str, Any] = {"x": x, "y": y, "planarDatum": random.choice((HALL, HALL, HALL, LOFT))}
        if random.random() < 0.6:
            here["angle"] = angle(yaw_rad)
        keys: dict[str, Any] = {"location": here, "operationalState": random.choice(STATES)}
        keys["path"] = drawn_points(random, t_s, x, y, 4)
        keys["destinations"] = drawn_points(random, t_s, x, y, 2)
        keys["velocity"] = random.choice((None, {"linear": random.choice((0.0, 0.01, 0.5, -0.5, 3.0))}))
        if keys["velocity"] and random.random() < 0.5:
            keys["velocity"]["angular"] = angle(random.choice((0.0, 0.02, 0.4, -1.0)))
        keys["errorCodes"] = random.choice(([], [], ["stuck"]))
        assert of.receive(status("R", t_s, **keys), t_s + 0.1, LINE) is None
        check(next(iter(of.robots.values())))


def in_vda_5050(of: Fleet, random: Random) -> None:
    t_s, x, y, number = NOW_S, 0.0, 0.0, 0
    nodes = [node(0, 0.0)]
    of.receive(factsheet(t_s), t_s, line("factsheet"))
    for report in range(REPORTS):
        t_s += random.choice((1.0, 1.0, 0.1, 10.0, 60.0))
        if report % 5 == 0:
            for _ in range(random.randint(0, 3)):
                number += 1
                to_x, to_y, theta = near(random, x, y)
                place = {"x": to_x, "y": to_y, "mapId": MAP}
                if random.random() < 0.5:
                    place["theta"] = theta
                nodes.append(node(number, to_x, released=random.random() < 0.7, nodePosition=place))
            of.receive(order(t_s, nodes, orderUpdateId=report), t_s, line("order"))
        x, y, theta = near(random, x, y)
        moving = {"vx": random.choice((0.0, 0.05, 0.5, -0.4)), "omega": random.choice((0.0, 0.3, -0.8))}
        keys = {"velocity": random.choice((None, moving)), "driving": random.choice((True, False, None))}
        place_now = position(x, y, random.choice((theta, None)))
        raw = under_way(t_s, x, y, nodes[random.randint(1, max(len(nodes) - 1, 1)) :], agvPosition=place_now, **keys)
        assert of.receive(raw, t_s, line("state")) is None
        check(next(iter(of.robots.values())))


def check(robot: Robot) -> None:
    made, seen = robot.forecast, robot.seen
    assert made is not None
    assert seen is not None
    knots = np.array(made.knots)
    assert np.isfinite(knots[:, :3]).all()
    assert (np.diff(knots[:, 0]) > 0.0).all()
    assert knots[0, 0] == seen.t_s
    assert len(made.floors) == len(knots)
    assert len(knots) == 1 or np.isfinite(knots[1:, 3]).all() or not np.diff(knots[:, 1:3], axis=0).any()
    assert seen.linear_mps is None or isfinite(seen.linear_mps)


@pytest.mark.parametrize("says", [in_massrobotics, in_vda_5050])
def test_whatever_robots_report_of_their_motion_they_have_a_forecast(says: Any) -> None:
    for seed in range(ROBOTS):
        says(fleet(datums=(Datum(id=MAP, name="Hall"), Datum(id=HALL, name="Other hall"))), Random(seed))
