"""The judge of a running service looks at no more pairs than a floor can hold."""

from math import inf

import numpy as np
import pytest

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from metrics.scoring.warnings import warning_judge
from metrics.scoring.warnings.warning_judge import WarningJudge
from tests.helpers.made_advisories import ROBOTS, cleared, made
from tests.helpers.saying import robot, status

NOW_S = 1_790_000_000.0


def judged_pairs(robots: int, doubted: int) -> int:
    """How many pairs are found to meet of so many robots in one place, of which some are doubted."""
    fleet, judge, names = fleet_of(Site(), Measures()), WarningJudge(0.3, 0.2, Measures()), range(robots)
    for second in range(12):
        now_s = NOW_S + second
        for number in names:
            fleet.receive(status(f"A-{number}", now_s, 0.01 * number, 0.0), now_s, Connection(1))
        batch, unknown_m = fleet.next_batch(now_s), np.full((robots, 10, 3), np.nan)
        judge.add(now_s, batch, unknown_m, (), (), {robot(f"A-{number}") for number in names[:doubted]})
    return len(judge._outcomes.pairs())


def test_pairs_are_judged_as_far_as_there_is_room_for_them() -> None:
    assert judged_pairs(20, doubted=0) == 20 * 19 / 2


def test_a_doubted_robot_meets_nobody() -> None:
    assert judged_pairs(40, doubted=38) == 1


def test_the_judge_begins_anew_if_more_are_near_than_there_is_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert judged_pairs(40, doubted=0) == 0
    monkeypatch.setattr(warning_judge, "MOST_NEAR", inf)
    assert judged_pairs(40, doubted=0) == 40 * 39 / 2


@pytest.mark.parametrize("doubted", [ROBOTS[:1], ()])
def test_a_warning_of_a_doubted_robot_is_not_judged(doubted: tuple[str, ...]) -> None:
    measures, nobody = Measures(), fleet_of(Site(), Measures()).next_batch(NOW_S)
    judge, unknown_m = WarningJudge(0.3, 0.2, measures), np.zeros((0, 10, 3))
    for number, revision in enumerate([made(1), made(1, 2), cleared(1, 3)]):
        judge.add(NOW_S + number, nobody, unknown_m, [revision], (), doubted)
    judged = measures.values["deconflict_warnings_judged_total"]
    assert judged["not_judged",] == len(doubted)
    assert (len(judge._alerts), judge._left_out) == (1 - len(doubted), set())
