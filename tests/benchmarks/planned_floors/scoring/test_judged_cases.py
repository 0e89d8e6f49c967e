from dataclasses import replace

import numpy as np
import pytest

from benchmarks.planned_floors.logs.reports import Robot
from benchmarks.planned_floors.scoring.alerts import Alert, alerts_of_revisions, alerts_of_seconds
from benchmarks.planned_floors.scoring.all_figures import figures
from benchmarks.planned_floors.scoring.judged_cases import Cases, Judge, Sample, Verdict
from benchmarks.planned_floors.truth.floor_truth import FloorTruth, Stop
from benchmarks.planned_floors.truth.motion import Motion
from benchmarks.planned_floors.truth.outcomes import happenings
from tests.benchmarks.planned_floors.made_truth import START_S, VENDORS, A, B, C, every_second, line, motion_of, stop

APART = {A: (0.0, 0.0), B: (20.0, 0.0), C: (40.0, 0.0)}


def judged(
    alerts: list[Alert],
    stops: list[Stop],
    motion: Motion | None = None,
    robots: list[Robot] | None = None,
    samples: list[Sample] | None = None,
    after_s: float = 0.0,
) -> Cases:
    truth = FloorTruth(motion or motion_of(200.0, **APART), stops, [])
    reporting = robots or [every_second(robot, 200) for robot in truth.motion.robots]
    judge = Judge(truth, happenings(truth, 0.3, VENDORS), reporting, START_S + after_s)
    return judge.cases(sorted(alerts, key=lambda alert: alert.raised_s), samples or [])


def alert(raised_s: float, cleared_s: float, pair: tuple[str, str] = (A, B)) -> Alert:
    return Alert(pair, START_S + raised_s, START_S + cleared_s)


def verdicts(cases: Cases) -> list[Verdict]:
    return [Verdict(int(verdict)) for verdict in cases.verdicts[:, 0]]


@pytest.mark.parametrize(
    ("raised_s", "cleared_s", "expected"),
    [
        (93.0, 105.0, [1, 1, 1, 1, 1]),
        (97.0, 105.0, [1, 1, 0, 0, 1]),
        (99.0, 105.0, [1, 0, 0, 0, 1]),
        (93.0, 98.0, [0, 0, 0, 0, 1]),  # no longer standing at the onset
        (101.0, 105.0, [0, 0, 0, 0, 0]),  # too late
        (80.0, 89.0, [0, 0, 0, 0, 0]),
    ],
)
def test_a_warned_stop_has_an_alert_raised_before_and_open_at_the_onset(
    raised_s: float, cleared_s: float, expected: list[int]
) -> None:
    assert judged([alert(raised_s, cleared_s)], [stop(100.0)]).stops.tolist() == [expected]


def test_an_alert_of_another_pair_does_not_count() -> None:
    assert judged([alert(93.0, 105.0, (A, C))], [stop(100.0)]).stops.tolist() == [[0.0] * 5]


def test_a_pair_that_is_already_yielding_is_left_out() -> None:
    again = stop(112.0, B, A)
    assert len(judged([], [stop(100.0), again]).stops) == 1
    assert len(judged([], [stop(100.0), stop(121.0)]).stops) == 2


def test_slow_or_short_stops_are_not_fresh() -> None:
    assert len(judged([], [stop(100.0, v0_mps=0.2), stop(150.0, lasts_s=1.5)]).stops) == 0


def test_one_outcome_credits_one_alert() -> None:
    cases = judged([alert(90.0, 93.0), alert(95.0, 108.0)], [stop(100.0), stop(100.0, B, A)])
    assert verdicts(cases) == [Verdict.IN_VAIN, Verdict.TRUE]


def test_an_alert_that_is_credited_leaves_the_next_outcome_to_another() -> None:
    cases = judged([alert(90.0, 130.0), alert(110.0, 112.0)], [stop(100.0), stop(115.0)])
    assert verdicts(cases) == [Verdict.TRUE, Verdict.TRUE]


def test_an_alert_is_true_where_the_outcome_follows_within_ten_seconds() -> None:
    assert verdicts(judged([alert(89.0, 91.0)], [stop(100.0)])) == [Verdict.TRUE]
    assert verdicts(judged([alert(86.0, 89.0)], [stop(100.0)])) == [Verdict.IN_VAIN]


def test_an_encounter_makes_an_alert_true_too() -> None:
    motion = motion_of(60.0, **{A: (0.0, 0.0), B: (20.0, 0.0)})
    line(motion, B, 20.0, 1.2, 0.0, 40.0)
    cases = judged([alert(30.0, 45.0)], [], motion)
    assert verdicts(cases) == [Verdict.TRUE]
    assert cases.encounters.tolist() == [[1.0] * 5]


def test_an_encounter_while_one_drives_around_is_not_natural() -> None:
    motion = motion_of(60.0, **{A: (0.0, 0.0), B: (20.0, 0.0)})
    line(motion, B, 20.0, 1.2, 0.0, 40.0)
    assert len(judged([], [stop(20.0, B, A, around_s=20.0)], motion).encounters) == 0
    assert len(judged([], [stop(20.0, B, A, around_s=5.0)], motion).encounters) == 1


def test_a_stop_and_the_encounter_that_follows_are_one_outcome() -> None:
    motion = motion_of(60.0, **{A: (0.0, 0.0), B: (20.0, 0.0)})
    line(motion, B, 20.0, 1.2, 0.0, 40.0)
    cases = judged([alert(30.0, 45.0)], [stop(38.0)], motion)
    assert (len(cases.stops), len(cases.encounters)) == (1, 1)
    assert cases.outcomes.tolist() == cases.stops.tolist()
    assert len(judged([], [stop(20.0)], motion).outcomes) == 2


def test_an_order_of_the_own_fleet_is_not_an_outcome() -> None:
    own = replace(stop(50.0), robot="x", by="y", same_vendor=True)
    motion = motion_of(100.0, x=(0.0, 0.0), y=(20.0, 0.0))
    truth = FloorTruth(motion, [own], [])
    happened = happenings(truth, 0.3, {"x": "Alder", "y": "Alder"})
    assert not happened.outcomes
    assert not happened.stops


def test_alerts_and_seconds_while_the_pair_gives_way_are_neither_true_nor_in_vain() -> None:
    cases = judged([alert(101.0, 104.0), alert(98.0, 104.0)], [stop(100.0)])
    assert verdicts(cases) == [Verdict.TRUE, Verdict.IN_PROGRESS]
    assert cases.seconds.tolist() == [[2, 0, 0, 4], [0, 0, 0, 3]]


def test_unknown_outcomes_are_counted_separately() -> None:
    motion = motion_of(200.0, **APART)
    motion.x_m[1500:, 1] = np.nan  # B is carried away after 150 s
    cases = judged([alert(145.0, 148.0), alert(120.0, 130.0), alert(195.0, 198.0, (A, C))], [], motion)
    assert verdicts(cases) == [Verdict.IN_VAIN, Verdict.UNKNOWN, Verdict.UNKNOWN]


def test_alerts_about_gone_robots_are_distinguished_from_those_about_silent_ones() -> None:
    motion = motion_of(200.0, **APART)
    motion.x_m[1000:, 1] = np.nan
    robots = [every_second(A, 200), every_second(B, 95), every_second(C, 95)]
    cases = judged([alert(120.0, 125.0), alert(98.0, 99.0), alert(120.0, 125.0, (A, C))], [], motion, robots)
    assert cases.gone[:, 0].tolist() == [0, 1, 0]  # by time raised, then by pair


def test_encounters_with_silent_robots_are_scored_separately() -> None:
    robots = [every_second(A, 200), every_second(B, 95), every_second(C, 200)]
    cases = judged([alert(96.0, 110.0)], [stop(102.0), stop(150.0, A, C)], None, robots)
    assert cases.silent.tolist() == [[1, 1, 1, 1, 1]]


def test_silent_robots_that_stand_drive_on_or_are_gone_are_distinguished() -> None:
    motion = motion_of(200.0, **APART)
    line(motion, B, 20.0, 24.0, 96.0, 100.0)  # drives on, and stands from 100 s on
    motion.x_m[1500:, 2] = np.nan  # C stands until it is carried away after 150 s
    robots = [every_second(A, 200), every_second(B, 95), every_second(C, 95)]
    cases = judged([alert(118.0, 125.0, (A, C))], [stop(110.0), stop(120.0, A, C)], motion, robots)
    assert cases.silent.tolist() == [[0, 0, 0, 0, 0], [1, 1, 0, 0, 1]]
    assert cases.standing.tolist() == [[1, 1, 0, 0, 1]]
    found = figures(cases)
    assert found["silent standing told 2 s"]["value"] == 1.0
    # B and C from 101 s to 200 s, C there until 149 s
    assert found["silent seconds there"] == {"value": pytest.approx(149 / 200), "of": 200, "interval": None}
    assert found["silent seconds standing"]["value"] == pytest.approx(49 / 200)


def test_robots_that_pass_each_other_should_not_be_alerted() -> None:
    motion = motion_of(60.0, **{A: (0.0, 0.0), B: (20.0, 1.4)})
    line(motion, B, 20.0, -20.0, 0.0, 40.0)
    assert judged([alert(10.0, 12.0)], [], motion).passes.tolist() == [[1.0]]
    assert judged([alert(2.0, 4.0)], [], motion).passes.tolist() == [[0.0]]


def test_probabilities_are_compared_with_the_outcomes() -> None:
    samples = [((A, B), START_S + t_s, 0.9) for t_s in (80.0, 92.0, 98.0, 102.0)]
    cases = judged([], [stop(100.0)], samples=samples)
    assert cases.probabilities[:, :2].tolist() == [[0.9, 0], [0.9, 1], [0.9, 1]]
    assert len(set(cases.probabilities[:, 2].tolist())) == 1
    assert cases.two_s_ahead.tolist() == [[0.9]]


def test_what_happens_before_a_given_time_is_not_scored() -> None:
    cases = judged([alert(93.0, 105.0), alert(153.0, 160.0)], [stop(100.0), stop(155.0)], after_s=120.0)
    assert len(cases.stops) == len(cases.verdicts) == 1
    assert cases.minutes[:, 2].sum() == pytest.approx(3 * 80.1)


def test_alerts_and_their_minutes_count_all() -> None:
    found = figures(judged([alert(0.0, 60.0), alert(100.0, 160.0, (A, C))], []))
    robot_hours = 3 * 200.1 / 3600
    assert found["alerts per robot-hour"]["value"] == pytest.approx(2 / robot_hours)
    assert found["alert minutes per robot-hour"]["value"] == pytest.approx(2 / robot_hours)


def test_floors_are_joined_case_by_case() -> None:
    first, second = judged([alert(93.0, 105.0)], [stop(100.0)]), judged([], [stop(100.0)])
    assert figures(Cases.joined([first, second]))["stops told 2 s"]["value"] == 0.5


def test_pairs_of_joined_floors_are_in_groups_of_their_own() -> None:
    floors = [judged([], [], samples=[((A, B), START_S + 50.0, 0.9)]) for _ in range(2)]
    first, second = Cases.joined(floors).probabilities[:, 2]
    assert first != second


def test_consecutive_seconds_are_one_alert() -> None:
    assert alerts_of_seconds({(A, B): [5, 6, 7, 9]}) == [Alert((A, B), 5.0, 8.0), Alert((A, B), 9.0, 10.0)]


def test_an_advisory_is_open_from_raised_to_cleared() -> None:
    revisions = [
        {
            "kind": "conflict",
            "state": event,
            "updated_at": f"2026-09-21T14:13:2{second}.000000Z",
            "id": key,
            "robots": [B, A],
        }
        for event, second, key in (("raised", 0, "1"), ("updated", 2, "1"), ("cleared", 5, "1"), ("raised", 7, "2"))
    ]
    assert alerts_of_revisions(revisions, START_S + 30) == [
        Alert((A, B), START_S, START_S + 5),
        Alert((A, B), START_S + 7, START_S + 30),
    ]
