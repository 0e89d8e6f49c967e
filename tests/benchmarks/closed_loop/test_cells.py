"""Floors of cells: what robots do of what they are asked, and that advice wins time."""

from dataclasses import replace

import numpy as np

from benchmarks.closed_loop.cells.__main__ import Run, driven
from benchmarks.closed_loop.cells.kinds import floor_of
from benchmarks.closed_loop.cells.proof import Proof, driven_m, lines
from benchmarks.closed_loop.cells.world import CellWorld, Compliance
from benchmarks.planned_floors.floors.driving.driving import NO_WAIT
from deconflict.adviser import Request
from deconflict.adviser.asked import Verb


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


def next_cell(world: CellWorld, row: int) -> tuple[int, tuple[float, float]]:
    """A cell that a robot will soon come to: the number of its visit, and its middle."""
    ways, visit = world.traffic.fleets.visits.ways, int(world.traffic.driving["visit"][row]) + 2
    return visit, (float(ways["x_m"][row, visit]), float(ways["y_m"][row, visit]))


def test_the_same_seed_gives_the_same_floor() -> None:
    runs = [driven(Run("scattered", 2, "this", seconds=125.0))[0] for _ in range(2)]
    assert runs[0] == runs[1]


def test_a_robot_waits_before_the_cell_until_it_is_told_otherwise() -> None:
    world = small_world()
    row = 3
    visit, at = next_cell(world, row)
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


def test_what_a_request_saves_is_tried_on_copies_that_leave_the_world_as_it_is() -> None:
    world = small_world()
    world.traffic._made_of = replace(world.traffic._made_of, stalls_per_s=0.015)
    request = ask(world, 3, "wait_before", next_cell(world, 3)[1])
    before = world.traffic.driving.copy()
    ways_m = [driven_m(world, draw, None) for draw in (1, 1, 2)]
    assert ways_m[0] == ways_m[1] != ways_m[2], "a draw of later stalls is the same each time"
    assert driven_m(world, 1, request) != ways_m[0], "it reaches the copy, although what was under way does not"
    assert (world.traffic.driving == before).all()
    assert world.traffic.sample == 0


def test_the_last_line_says_how_many_save_time_and_how_much_was_stated() -> None:
    found = [Proof("go_around", 10.0, (1.0, 20.0), 8.0, 0.5), Proof("go_around", 6.0, (1.0, 9.0), -2.0, 0.5)]
    assert list(lines("hall", found))[-1] == (
        "hall: 2 requests, 50% save time, 50% inside the interval; 16 s stated, 6 s measured"
    )
