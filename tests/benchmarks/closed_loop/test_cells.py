"""Floors of cells: what robots do of what they are asked, and that advice wins time."""

from dataclasses import replace

import numpy as np

from benchmarks.closed_loop.cells.__main__ import Run, driven
from benchmarks.closed_loop.cells.kinds import floor_of
from benchmarks.closed_loop.cells.world import CellWorld, Compliance
from benchmarks.planned_floors.floors.driving.driving import NO_WAIT
from deconflict.adviser import Request
from deconflict.adviser.request import Verb


def small_world(**compliance: object) -> CellWorld:
    floor = replace(floor_of("scattered", 1), seconds=60.0, stalls_per_s=0.0)
    return CellWorld(floor, Compliance(**compliance))  # type: ignore[arg-type]


def run(world: CellWorld, seconds: float) -> None:
    for _ in range(round(10 * seconds)):
        world.step()


def ask(world: CellWorld, row: int, verb: Verb, at: tuple[float, float] | None = None, other: int = 0) -> Request:
    uuids = [model.uuid for model in world.models]
    request = Request("1", uuids[row], verb, at, uuids[other], (), world.now_s + 10.0)
    world.ask(request)
    return request


def test_the_same_seed_gives_the_same_floor() -> None:
    runs = [driven(Run("scattered", 2, "this", seconds=125.0))[0] for _ in range(2)]
    assert runs[0] == runs[1]


def test_a_robot_waits_before_the_cell_until_it_is_told_otherwise() -> None:
    world = small_world()
    row = 3
    visits = world.traffic.fleets.visits
    visit = int(world.traffic.driving["visit"][row]) + 2
    at = float(visits.ways["x_m"][row, visit]), float(visits.ways["y_m"][row, visit])
    ask(world, row, "wait_before", at)
    run(world, 9.0)
    assert ("1", "accepted", "") in world.answers()
    assert world.traffic.driving["visit"][row] < visit
    run(world, 2.0)
    assert world.answers() == [("1", "done", "")]
    assert world.traffic.driving["waits_before"][row] == NO_WAIT


def test_a_robot_drives_around_and_declines_what_it_cannot_do() -> None:
    world = small_world()
    ask(world, 0, "go_around", other=1)
    ask(world, 2, "back_out")
    run(world, 2.0)
    assert [answer[1:] for answer in world.answers()] == [("accepted", ""), ("declined", "cannot")]
    assert world.traffic.driving["aside_m"][0] < -0.1


def test_robots_that_do_not_follow_do_not_answer() -> None:
    world = small_world(share=0.0)
    ask(world, 0, "go_around", other=1)
    run(world, 2.0)
    assert world.answers() == []
    assert not np.any(world.traffic.driving["aside_m"])


def test_advice_wins_time_on_a_blind_floor() -> None:
    none, with_advice = (driven(Run("scattered", 1, adviser, seconds=200.0))[0] for adviser in ("none", "this"))
    assert with_advice.mps > 1.2 * none.mps
