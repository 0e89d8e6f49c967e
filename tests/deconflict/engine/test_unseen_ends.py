"""Conflicts that end while nobody looks: in a silence of robots, in an outage, while no engine runs.

Two robots cross at the same place again and again, by the clock: what is over is over, and the next is another one.
"""

from collections import defaultdict
from collections.abc import Callable
from math import pi

import pytest

from deconflict.engine.engine import Engine
from deconflict_client.advisory import AdvisoryState, ConflictAdvisory
from tests.deconflict.engine.made_engine import NOW_S, SITE, Course, Floor

EVERY_S, HALF_M, END_S = 20.0, 10.0, 88.0
"""They cross at half of this time, and then each time it has passed; they turn at so many metres from there."""


def shuttle(yaw: float) -> Course:
    def course(t: float) -> tuple[float, float, float]:
        way_m, back = t % EVERY_S - HALF_M, int(t // EVERY_S) % 2
        along_m = -way_m if back else way_m
        return (along_m, 0.0, yaw + pi * back) if yaw == 0.0 else (0.0, along_m, yaw + pi * back)

    return course


def both_silent(floor: Floor) -> None:
    floor.silent_from_s = dict.fromkeys(floor.courses, 0.0)


def one_silent(floor: Floor) -> None:
    floor.silent_from_s = {"A-1": 0.0}


def restarted(floor: Floor) -> None:
    both_silent(floor)
    floor.engine = Engine(SITE, floor.engine.open(), {})


def seen(_: Floor) -> None:
    """Nothing is amiss."""


def crossings(advisories: list[ConflictAdvisory]) -> dict[str, set[int]]:
    """By id, the numbers of the crossings that its revisions are on."""
    found = defaultdict(set)
    for each in advisories:
        if each.state is not AdvisoryState.CLEARED:
            found[each.id].add(round((each.predicted_at.timestamp() - NOW_S - HALF_M) / EVERY_S))
    return found


@pytest.mark.parametrize(("from_s", "silent_s"), [(8.0, 7.0), (7.0, 16.0), (9.0, 28.0)])
@pytest.mark.parametrize("fault", [seen, both_silent, one_silent, restarted])
def test_no_advisory_is_on_two_conflicts(fault: Callable[[Floor], None], from_s: float, silent_s: float) -> None:
    floor = Floor({"A-1": shuttle(0.0), "B-1": shuttle(pi / 2)})
    floor.run(EVERY_S + from_s)
    fault(floor)
    floor.run(EVERY_S + from_s + silent_s, EVERY_S + from_s)
    floor.silent_from_s = {}
    floor.run(END_S, EVERY_S + from_s + silent_s)
    found = crossings(floor.advisories)
    assert [numbers for numbers in found.values() if len(numbers) > 1] == []
    assert {3} in found.values(), "warned again, once they are heard"
