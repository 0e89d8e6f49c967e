"""Which robots are named as those that move otherwise than they announce."""

from dataclasses import replace

import numpy as np

from deconflict.foresight.forecast_errors.self_contradiction import DoubtedRobots
from ingest.batch import Basis
from tests.deconflict.foresight.probability.made_stage import Stage, Walk
from tests.helpers.made_encounters import NOW_S

BASES = {"off": Basis.PATH, "order": Basis.ORDER, "flickers": Basis.PATH, "silent": Basis.VELOCITY, "foot": Basis.PATH}
NAMES = list(BASES)
ALL = np.arange(len(NAMES))
BATCH = replace(
    Stage({name: Walk((0.0, 10.0 * row), (1.0, 0.0)) for row, name in enumerate(NAMES)}).batch(0.0),
    basis=np.array([int(basis) for basis in BASES.values()]),
    participants=("robot", "driven", "robot", "robot", "person"),
)


def named_after(doubts: DoubtedRobots, t_s: float, contradict: set[str]) -> set[str]:
    """Who is named after all have reported."""
    doubts.note(ALL, replace(BATCH, now_s=NOW_S + t_s), np.array([name in contradict for name in NAMES]))
    return {NAMES[slot] for slot in doubts.named(NOW_S + t_s)}


def table() -> DoubtedRobots:
    doubts = DoubtedRobots()
    doubts.grow(len(NAMES))
    return doubts


def test_only_a_vehicle_with_a_path_that_stays_off_it_is_named() -> None:
    doubts, everybody = table(), set(NAMES)
    for t_s in range(0, 22, 2):
        named = named_after(doubts, t_s, everybody if t_s % 6 else everybody - {"flickers"})
        assert named == ({"off", "order"} if t_s >= 10 else set()), t_s
    assert named_after(doubts, 28, set()) == {"off", "order"}
    assert named_after(doubts, 36, {"off"}) == {"off", "order"}
    assert named_after(doubts, 51, set()) == {"off"}, "30 s after its last contradiction"
    assert named_after(doubts, 67, set()) == set()
    assert named_after(doubts, 68, {"off"}) == set(), "and 10 s on end before it is named again"


def test_a_robot_that_was_silent_for_long_or_announces_nothing_any_more_begins_anew() -> None:
    doubts = table()
    for t_s in (0, 5, 10):
        named = named_after(doubts, t_s, {"off", "order"})
    assert named == {"off", "order"}
    doubts.note(
        ALL[:1],
        replace(BATCH, now_s=NOW_S + 12, basis=np.array([int(Basis.VELOCITY)]), participants=("robot",)),
        np.array([True]),
    )
    assert {NAMES[slot] for slot in doubts.named(NOW_S + 12)} == {"order"}
    assert {NAMES[slot] for slot in doubts.named(NOW_S + 41)} == set()
    assert named_after(doubts, 60, {"off", "order"}) == set()


def test_another_robot_with_the_slot_is_not_named() -> None:
    doubts = table()
    for t_s in (0, 5, 10):
        named_after(doubts, t_s, {"off"})
    doubts.forget(ALL[:1])
    assert len(doubts.named(NOW_S + 10)) == 0
