"""The judge of a running service looks at no more pairs than a floor can hold."""

from math import inf

import numpy as np
import pytest

from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict_client.advisory import moment
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from metrics.scoring.warnings import warning_judge
from metrics.scoring.warnings.warning_judge import WarningJudge
from tests.helpers.made_advisories import cleared, made
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


@pytest.mark.parametrize(("doubted_s", "outcome"), [(None, "in_vain"), (2, "not_judged")])
def test_a_warning_of_a_doubted_robot_is_not_judged(doubted_s: int | None, outcome: str) -> None:
    fleet, measures, names = fleet_of(Site(), Measures()), Measures(), ("A-1", "B-1")
    judge, pair = WarningJudge(0.3, 0.2, measures), tuple(sorted(map(robot, names)))
    raised = made(1, robots=pair, raised_at=moment(NOW_S + 1), updated_at=moment(NOW_S + 1))
    ended = cleared(1, robots=pair, raised_at=moment(NOW_S + 1), updated_at=moment(NOW_S + 4))
    for second in range(60):
        now_s = NOW_S + second
        for number, name in enumerate(names):
            fleet.receive(status(name, now_s, 20.0 * number, 0.0), now_s, Connection(1))
        revisions = {1: [raised], 4: [ended]}.get(second, [])
        doubted = pair[:1] if second == doubted_s else ()
        batch = fleet.next_batch(now_s)
        judge.add(now_s, batch, np.full((len(batch), 10, 3), np.nan), revisions, (), doubted)
    judged = measures.values["deconflict_warnings_judged_total"]
    assert {labels: count for labels, count in judged.items() if count} == {(outcome,): 1}
