"""Halls: walls, bodies that count, and what robots do of what they are asked."""

import copy
import json
from itertools import pairwise
from math import hypot

import pytest

from benchmarks.closed_loop.halls.believed import Believed
from benchmarks.closed_loop.halls.ground.bodies import WALL, first_hit
from benchmarks.closed_loop.halls.ground.floors import KINDS, Hall, hall_of
from benchmarks.closed_loop.halls.ground.roadmap import Street
from benchmarks.closed_loop.halls.motion.vendors import Compliance
from benchmarks.closed_loop.halls.runs import Run, advise, driven
from benchmarks.closed_loop.halls.world import HallWorld
from deconflict.adviser import Request
from deconflict.adviser.asked import Verb
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import DEFAULT
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.recording.log_reader import Received

FOR_EVER_S = 1e9


def quiet_world(habit: str = "for_ever") -> HallWorld:
    """Two aisles at x = 12 and 24 between main ways at y = 0 and 24; three robots that stand at work; no stalls."""
    mains = [Street((0.0, y), (36.0, y), wide=True) for y in (0.0, 24.0)]
    ends = [Street((x, 0.0), (x, 24.0), wide=True) for x in (0.0, 36.0)]
    aisles = [Street((x, 0.0), (x, 24.0), stations=(12.0,)) for x in (12.0, 24.0)]
    bays = [Street((x, y), (x, y + 3.3), stub=1) for x in (6.0, 18.0, 30.0) for y in (24.0,)]
    world = HallWorld(Hall("quiet", [*mains, *ends, *aisles, *bays], [], 3), 1, habit)
    for robot in world.robots:
        robot.dwells_until_s = robot.stalls_until_s = FOR_EVER_S
    return world


def put(world: HallWorld, row: int, places: list[tuple[float, float]], gone_m: float) -> None:
    """A robot on a way over nodes of the roadmap, which ends its errand; it will not stall."""
    robot, roadmap = world.robots[row], world._roadmap
    nodes = [
        min(range(len(roadmap.xy)), key=lambda k: hypot(roadmap.xy[k][0] - x, roadmap.xy[k][1] - y)) for x, y in places
    ]
    way = nodes[:1]
    for a, b in pairwise(nodes):
        way += roadmap.route(a, b)[1:]
    robot.goal = way[-1]
    world._acts[robot.planner].take_way(robot, way, gone_m)
    robot.x_m, robot.y_m = robot.way.at(gone_m)
    robot.yaw, robot.dwells_until_s = float(robot.way.yaw_rad[robot.leg]), 0.0
    world._ground.put(robot)
    calm(world)


def calm(world: HallWorld) -> None:
    """No robot that drives begins to stall."""
    for robot in world.robots:
        if robot.dwells_until_s < FOR_EVER_S:
            robot.stalls_until_s = -1.0


def drive(world: HallWorld, seconds: float) -> None:
    for _ in range(round(10 * seconds)):
        calm(world)
        world.step()


def asked(
    world: HallWorld, row: int, verb: Verb, at: tuple[float, float] | None, other: int, within_s: float = 60.0
) -> None:
    robot, for_whom = (world.robots[k].model.uuid for k in (row, other))
    world.ask(Request("r1", robot, verb, at, for_whom, (for_whom,), world.now_s + within_s))


def in_aisle(world: HallWorld) -> None:
    """Robots 0 and 1 face each other in the aisle at x = 12, half a metre apart."""
    put(world, 0, [(6.0, -0.8), (12.0, -0.8), (12.0, 12.0), (12.0, 23.2)], 6.0 + 8.0)
    put(world, 1, [(12.8, 24.8), (12.0, 24.8), (12.0, 12.0), (12.0, -0.8)], 0.0)
    world._acts[1].take_way(world.robots[1], world.robots[1].way.nodes, 24.8 - 8.8)
    world.robots[1].x_m, world.robots[1].y_m = world.robots[1].way.at(world.robots[1].gone_m)
    world._ground.put(world.robots[1])
    drive(world, 6.0)


@pytest.mark.parametrize("kind", KINDS)
def test_no_body_enters_a_wall(kind: str) -> None:
    world, adviser = HallWorld(hall_of(kind, 3), 3, "mixed"), Believed()
    for _ in range(50):
        advise(world, adviser)
        for _ in range(10):
            world.step()
            for robot in world.robots:
                body = robot.x_m, robot.y_m, robot.yaw, robot.long_m, robot.wide_m
                assert first_hit(world._ground.bodies[robot.row :][:1], world._ground.walls, 0, *body) != WALL, robot


def test_a_body_in_a_wall_is_seen() -> None:
    world = quiet_world()
    assert first_hit(world._ground.bodies[:1], world._ground.walls, 0, 14.0, 12.0, 0.0, 0.5, 0.3) == WALL


def test_robots_that_face_each_other_in_an_aisle_stand() -> None:
    world = quiet_world()
    in_aisle(world)
    assert [world.robots[row].blocker for row in (0, 1)] == [1, 0]
    assert world.robots[0].speed_mps == 0.0
    gap_m = abs(world.robots[1].y_m - world.robots[0].y_m) - world.robots[0].long_m - world.robots[1].long_m
    assert 0.1 < gap_m < 1.0


def test_going_around_is_declined_in_an_aisle() -> None:
    world = quiet_world()
    in_aisle(world)
    asked(world, 0, "go_around", None, 1)
    drive(world, 1.0)
    assert world.answers() == [("r1", "declined", "no room")]


def test_going_around_is_done_on_a_main_way() -> None:
    world = quiet_world()
    put(world, 0, [(0.8, -0.8), (35.2, -0.8)], 14.0)
    put(world, 1, [(0.8, -0.8), (35.2, -0.8)], 18.0)
    world.robots[1].dwells_until_s = FOR_EVER_S
    drive(world, 8.0)
    assert world.robots[0].blocker == 1
    asked(world, 0, "go_around", None, 1)
    drive(world, 25.0)
    assert [answer for _, answer, _ in world.answers()] == ["accepted", "done"]
    assert world.robots[0].x_m > world.robots[1].x_m + 1.0
    assert world.robots[0].y_m == pytest.approx(-0.8)


def test_backing_out_is_done_to_a_place_and_lasts_until_the_other_has_passed() -> None:
    world = quiet_world()
    in_aisle(world)
    place = (9.0, -0.8)
    asked(world, 0, "back_out", place, 1)
    reached = []
    for _ in range(60):
        drive(world, 1.0)
        reached.append(hypot(world.robots[0].x_m - place[0], world.robots[0].y_m - place[1]))
        answers = world.answers()
        if any(answer == "done" for _, answer, _ in answers):
            break
    assert answers == [("r1", "done", "")]
    assert min(reached) < 0.3
    assert hypot(world.robots[1].x_m - 12.0, world.robots[1].y_m + 0.8) > 1.5
    assert world.robots[1].y_m < 0.0


def test_stepping_aside_is_done_to_a_bay_and_the_errand_goes_on() -> None:
    world = quiet_world()
    put(world, 0, [(35.2, 24.8), (0.8, 24.8)], 26.0)
    bay = 6.0, 27.3
    robot = world.robots[0]
    asked(world, 0, "step_aside", bay, 1, within_s=20.0)
    robot.dwells_until_s = 0.3
    away_m: list[float] = []
    for _ in range(40):
        drive(world, 1.0)
        away_m.append(hypot(robot.x_m - bay[0], robot.y_m - bay[1]))
    assert [answer for _, answer, _ in world.answers()] == ["accepted", "done"]
    assert min(away_m) < 0.1
    assert robot.errands == 1


def test_waiting_is_kept_until_the_other_has_passed() -> None:
    world = quiet_world()
    put(world, 0, [(0.8, -0.8), (35.2, -0.8)], 2.0)
    put(world, 1, [(12.0, 12.0), (12.0, -0.8), (35.2, -0.8)], 2.0)
    world.robots[1].dwells_until_s = 20.0
    asked(world, 0, "wait_before", (12.0, -0.8), 1)
    drive(world, 19.0)
    assert world.robots[0].x_m < 12.0 - world.robots[0].long_m + 0.05
    assert world.answers() == [("r1", "accepted", "")]
    drive(world, 25.0)
    assert world.answers() == [("r1", "done", "")]
    assert world.robots[1].x_m > 13.0


def test_waiting_lapses() -> None:
    world = quiet_world()
    put(world, 0, [(0.8, -0.8), (35.2, -0.8)], 2.0)
    put(world, 1, [(12.0, 12.0), (12.0, -0.8), (35.2, -0.8)], 2.0)
    world.robots[1].dwells_until_s = FOR_EVER_S
    asked(world, 0, "wait_before", (12.0, -0.8), 1, within_s=15.0)
    drive(world, 14.8)
    assert world.robots[0].x_m < 12.0
    drive(world, 8.0)
    assert world.answers() == [("r1", "accepted", ""), ("r1", "done", "")]
    assert world.robots[0].x_m > 14.0


def test_another_way_leaves_out_the_stretch_and_is_declined_where_there_is_none() -> None:
    world = quiet_world()
    in_aisle(world)
    asked(world, 0, "other_way", (12.0, 9.5), 1)
    drive(world, 1.0)
    assert world.answers() == [("r1", "accepted", "")]
    drive(world, 40.0)
    assert hypot(world.robots[0].x_m - 12.0, world.robots[0].y_m - 6.0) > 8.0
    put(world, 2, [(18.0, 27.3), (18.0, 24.8), (24.8, 24.8)], 0.5)
    assert world._acts[2].other_way(world.robots[2], (18.0, 25.8)) == "no other way"


def test_robots_that_do_not_follow_decline_or_say_nothing() -> None:
    for declines, expected in ((True, [("r1", "declined", "busy")]), (False, [])):
        world = quiet_world()
        world._compliance = Compliance(declines=declines)
        world._obeys = [False] * 3
        asked(world, 0, "go_first", None, 1)
        drive(world, 1.0)
        assert world.answers() == expected


def test_the_same_seed_gives_the_same_figures_and_a_copy_may_be_drawn_anew() -> None:
    run = Run("open", "mixed", 2, "believed", minutes=0.5)
    assert driven(run) == driven(run)
    world = HallWorld(hall_of("open", 2), 2, "mixed")
    for _ in range(200):
        world.step()
    same, redrawn = copy.deepcopy(world), copy.deepcopy(world)
    redrawn.redraw(1)
    for each in (world, same, redrawn):
        for _ in range(200):
            each.step()
    places = [[(robot.x_m, robot.y_m) for robot in each.robots] for each in (world, same, redrawn)]
    assert places[0] == places[1]
    assert places[0] != places[2]


def test_reports_are_read_by_the_product() -> None:
    world, fleet = HallWorld(hall_of("doors", 1), 1, "wait_15s"), fleet_of(DEFAULT, Measures())
    vendors: dict[str, str] = {}
    for _ in range(5):
        for _ in range(10):
            world.step()
        for message in world.heard():
            vendor = vendors.setdefault(message["uuid"], message.get("manufacturerName", ""))
            received = Received(json.dumps(message).encode(), world.now_s, Connection(1, "test", f"/{vendor}", vendor))
            assert fleet.receive_recorded(received) is None
        batch = fleet.next_batch(world.now_s)
        assert not batch.gone
    assert len(vendors) == len(world.robots)
    assert set(vendors.values()) == {"Amber", "Birch", "Cedar"}
