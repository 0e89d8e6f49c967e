"""How long others stand because of a refusal."""

from collections.abc import Collection, Mapping

import pytest

from deconflict.foresight.losses.loss import LossKind
from deconflict.foresight.losses.refusal import AdviceRefusal, HeldUp, stood_on

SINCE_S = 1_790_000_000.0


def counted(
    looks: Mapping[float, Collection[str]], begun_s: Mapping[str, float] | None = None
) -> tuple[list[float], float]:
    """How long each other stood, and when it was over. `looks` has by second who stood for the robot."""

    def begun_at(second: float) -> dict[str, float]:
        return {robot: SINCE_S + at_s for robot, at_s in (begun_s or {}).items() if at_s <= second}

    others = [HeldUp(robot, "Birch", LossKind.DEADLOCK, "", 0.0, 0.0) for robot in ("b", "c")]
    refusal, is_over, second = AdviceRefusal("a", "Alder", False, SINCE_S, SINCE_S, tuple(others)), False, 0.0
    for second, standing in looks.items():
        refusal, is_over = stood_on(refusal, standing, begun_at(second), SINCE_S + second)
        if is_over:
            break
    assert is_over
    return [other.stood_s for other in refusal.others], second


@pytest.mark.parametrize(
    ("looks", "stood_s", "over_s"),
    [
        ({1: "bc", 2: "b", 3: ""}, [2, 1], 3),
        ({1: "bc", 2: "d"}, [1, 1], 2),
        ({20.0 * k: "b" for k in range(1, 9)}, [60, 0], 60),
        ({50: "b", 75: "b"}, [60, 0], 75),
    ],
    ids=["until nobody stands", "only those that stood then", "a minute", "a minute between looks"],
)
def test_others_are_counted_while_they_stand_for_a_minute_at_most(
    looks: Mapping[float, str], stood_s: list[float], over_s: float
) -> None:
    assert counted(looks) == (stood_s, over_s)


@pytest.mark.parametrize(("begun_s", "over_s"), [({"b": 2.0}, 2), ({"a": 2.0}, 2), ({"d": 2.0}, 9), ({"b": -1.0}, 9)])
def test_a_request_of_the_standoff_that_is_followed_ends_it(begun_s: dict[str, float], over_s: float) -> None:
    assert counted({1: "bc", 2: "bc", 9: ""}, begun_s) == ([2, 2], over_s)
