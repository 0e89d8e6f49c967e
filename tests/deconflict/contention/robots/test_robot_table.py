"""Robots as contention keeps them: what is written by kernels, a batch or many at once, against plain reckoning."""

from dataclasses import fields, replace
from math import cos, hypot, sin

import numpy as np
import pytest

from deconflict.contention.robots.bounding_boxes import ROUNDING_M
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.contention.robots.record_kernels import LEAST_M, STANDS_M, STANDS_S, WAY_M, collect_boxes
from deconflict.contention.robots.robot_table import RESTING, RobotTable
from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Basis, Batch
from ingest.settings import Model, Trailers, Vendor
from tests.deconflict.contention.scenes import LINE, NOW_S, Scene, Script, aisle, resource, site
from tests.helpers.saying import points, status

TRAILERS = Trailers(count=2, length_m=1.0, width_m=0.7, hitch_m=1.5)
DOCK, LANE = resource("d1", 20, 0), aisle("lane", 30, 50)


def script(rng: np.random.Generator, number: int, seconds: int) -> Script:
    """A robot that goes and halts, creeps on, and says now and then that it rests."""
    t_s, x_m, y_m = 0.0, float(rng.uniform(0, 40)), float(number % 3 - 1)
    knots = [(t_s, x_m, y_m)]
    while t_s < seconds:
        far_m = 0.3 if rng.random() < 0.3 else 9.0
        t_s, x_m = t_s + float(rng.uniform(2, 9)), x_m + float(rng.uniform(-far_m, far_m))
        halted_s = float(rng.choice([0.1, rng.uniform(3, 9)]))
        knots += [(t_s, x_m, y_m), (t_s + halted_s, x_m, y_m)]
        t_s += halted_s
    found = rng.choice(["navigating", "navigating", "waiting", "idle"], seconds).tolist()
    stops = [(float(seconds), 20.5, 0.0), (seconds + 9.0, 70.0, 0.0)][number % 3 :]
    return Script(knots, stops, lambda t: str(found[int(t)]))


def batches(seconds: int) -> list[Batch]:
    """Of robots in and out of a dock and a lane."""
    rng = np.random.default_rng(3)
    scene = Scene(site(DOCK, LANE), {f"r{number}": script(rng, number, seconds) for number in range(12)})
    found = []
    for t in range(seconds):
        for name, made_script in scene.robots.items():
            scene.fleet.receive(made_script.says(name, float(t)), NOW_S + t, LINE)
        found.append(scene.fleet.next_batch(NOW_S + t))
    return found


def known(robots: RobotTable) -> dict[str, list[str]]:
    """All that is told of each robot, and the way that it has left."""
    lines = {uuid: [repr(getattr(robot, each.name)) for each in fields(robot)] for uuid, robot in robots.items()}
    waiting = np.flatnonzero(robots.records["waits"]).tolist()
    left = zip(waiting, robots.paths(waiting), strict=True)
    return {uuid: list(texts) for uuid, texts in lines.items()} | {
        f"way of {robots.slots.uuids[slot]}": [way.wkt] for slot, way in left
    }


def test_joined_batches_leave_the_same_table_as_single_ones() -> None:
    made_batches, waited = batches(60), 0
    each, many = (RobotTable(PlaceGeometry([DOCK], [LANE]), RobotSlots()) for _ in range(2))
    for first in range(0, 60, 5):
        parts = [replace(part, now_s=NOW_S + first) for part in made_batches[first : first + 5]]
        left = [item for part in parts for item in each.update(part)]
        assert sorted(left) == sorted(many.update(Batch.joined(parts)))
        assert known(each) == known(many)
        waited += sum("way" in name for name in known(each))
    assert waited > 10


@pytest.mark.parametrize(("trailers", "there"), [(None, False), (TRAILERS, True)])
def test_a_lane_is_not_free_while_trailers_stand_in_it(trailers: Trailers | None, there: bool) -> None:
    """The robot itself stands 1.6 m beyond its end."""
    vendor = Vendor(name="Alder", models={"A1": Model(trailers=trailers)})
    scene = Scene(site(LANE, vendors=(vendor,)), {"A": Script([(0.0, 40.0, 0.0), (12.0, 52.0, 0.0)])})
    robots = RobotTable(PlaceGeometry([], [LANE]), RobotSlots())
    for t in range(20):
        scene.fleet.receive(scene.robots["A"].says("A", float(t)), NOW_S + t, LINE)
        robots.update(scene.fleet.next_batch(NOW_S + t))
    (view,) = robots.values()
    assert ("lane" in view.passages) == there


def test_which_robots_stand_and_since_when_follows_from_their_reports() -> None:
    robots = RobotTable(PlaceGeometry([DOCK], [LANE]), RobotSlots())
    stood: dict[str, tuple[float, float, float]] = {}
    stands = 0
    for batch in batches(60):
        robots.update(batch)
        first = batch.forecasts.start[:-1]
        poses = zip(batch.robots, batch.forecasts.x_m[first], batch.forecasts.y_m[first], batch.event_s, strict=True)
        for row, (uuid, x_m, y_m, event_s) in enumerate(poses):
            at_x_m, at_y_m, _ = stood.get(uuid, (np.inf, np.inf, 0.0))
            if hypot(x_m - at_x_m, y_m - at_y_m) > STANDS_M:
                stood[uuid] = x_m, y_m, event_s
            robot = robots[uuid]
            assert robot.goes == (batch.basis[row] != Basis.STATIONARY and robot.way_m > WAY_M)
            assert (robot.stood_s, robot.stands) == (
                stood[uuid][2],
                not robot.goes or event_s - stood[uuid][2] >= STANDS_S,
            )
            assert (robot.here == "d1") == (abs(robot.x_m - 20) <= 1 and abs(robot.y_m) <= 1)
            waits = robots.records["waits"][robots.slots.uuids.index(uuid)]
            assert not waits or not (robot.goes or robot.state in RESTING)
            stands += robot.stands
    assert stands > 100


def test_collected_boxes_hold_the_robots_that_stand_and_the_paths() -> None:
    robots = RobotTable(PlaceGeometry([DOCK], [LANE]), RobotSlots())
    for batch in batches(30):
        robots.update(batch)
    ends_m, standing_m, going_m, ends, standing, going = collect_boxes(robots.records, robots.stops, ROUNDING_M)
    uuid = robots.slots.uuids.__getitem__
    found = [
        (robot.uuid, number)
        for robot in robots.values()
        for number, stop in enumerate(robot.stops)
        if not stop.resource
    ]
    assert sorted((uuid(slot), number) for slot, number in ends.tolist()) == sorted(found)
    assert {uuid(slot) for slot in standing.tolist()} == {robot.uuid for robot in robots.values() if robot.stands}
    assert {uuid(slot) for slot in going.tolist()} >= {robot.uuid for robot in robots.values() if robot.goes}
    for box_m, (slot, number) in zip(ends_m.tolist(), ends.tolist(), strict=True):
        stop = robots[uuid(slot)].stops[number]
        assert box_m == [stop.x_m, stop.y_m] * 2
    for box_m, slot in zip(standing_m, standing.tolist(), strict=True):
        view = robots[uuid(slot)]
        by_m = hypot(view.length_m, view.width_m) / 2 + ROUNDING_M
        np.testing.assert_allclose(box_m, [view.x_m - by_m, view.y_m - by_m, view.x_m + by_m, view.y_m + by_m])
    for box_m, slot, way in zip(going_m, going.tolist(), robots.paths(going.tolist()), strict=True):
        by_m = robots[uuid(slot)].width_m / 2 + LEAST_M
        west, south, east, north = way.bounds
        assert (box_m[:2] < [west - by_m, south - by_m]).all()
        assert (box_m[2:] > [east + by_m, north + by_m]).all()


@pytest.mark.parametrize("mps", [0.5, 1.5, 4.0])
@pytest.mark.parametrize("bend_rad", [0.0, 1.5, 3.0])
def test_a_robot_that_stops_short_of_where_it_was_believed_waits_on_its_way_from_there(
    mps: float, bend_rad: float
) -> None:
    ends = (6 * mps + 94 * mps * cos(bend_rad), 94 * mps * sin(bend_rad))
    means, stops_m = [(0.0, 0.0, 0.0), (6.0, 6 * mps, 0.0), (100.0, *ends)], 4 * mps
    knots = [(0.0, 0.0, 0.0), (4.0, stops_m, 0.0), (100.0, stops_m, 0.0)]
    halts = Script(knots, means=means, state=lambda t: "navigating" if t < 5 else "waitingExternalEvent")
    scene, robots = Scene(site(), {"A": halts}), RobotTable(PlaceGeometry([], []), RobotSlots())
    for t in range(7):
        scene.fleet.receive(halts.says("A", float(t)), NOW_S + t, LINE)
        robots.update(scene.fleet.next_batch(NOW_S + t + 0.9))
    (waiting,) = np.flatnonzero(robots.records["waits"]).tolist()
    (way,) = robots.paths([waiting])
    assert way.coords[0] == pytest.approx((stops_m, 0.0))
    assert way.coords[-1] == pytest.approx((6 * mps + 8 * mps * cos(bend_rad), 8 * mps * sin(bend_rad)))
    boxes_m = collect_boxes(robots.records, robots.stops, 0.0)[2]
    assert boxes_m[0, 0] < stops_m, "the box of its way holds where it stands"


@pytest.mark.parametrize(("bound_m", "way_m"), [(4.0, 4.0), (60.0, 10.0)])
def test_a_process_that_starts_takes_a_robot_that_is_held_up_as_on_its_way_to_its_destination(
    bound_m: float, way_m: float
) -> None:
    scene, robots = Scene(site(), {"A": Script([(0.0, 0.0, 0.0)])}), RobotTable(PlaceGeometry([], []), RobotSlots())
    for t in range(8):
        there = points((NOW_S + t, bound_m, 0.0, 0.0))
        del there[0]["timestamp"]
        scene.fleet.receive(status("A", NOW_S + t, velocity={"linear": 0.0}, destinations=there), NOW_S + t, LINE)
    robots.update(scene.fleet.snapshot(NOW_S + 7.5))
    (waiting,) = np.flatnonzero(robots.records["waits"]).tolist()
    (way,) = robots.paths([waiting])
    assert (*way.coords[0], *way.coords[-1]) == pytest.approx((0.0, 0.0, way_m, 0.0))
    assert robots.records["held_up"][waiting]
