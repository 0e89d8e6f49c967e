import pytest

from deconflict.foresight.presence.report_intervals import ReportIntervals
from deconflict.sweep.robot_slots import RobotSlots
from tests.deconflict.foresight.presence.made_watch import NOW_S, Watch
from tests.helpers.saying import robot
from tests.helpers.vda_saying import line, position, state


def reported(every_s: float, reports: int) -> ReportIntervals:
    watch, intervals = Watch(), ReportIntervals(RobotSlots())
    for number in range(reports):
        watch.now_s = number * every_s
        watch.say("A", 0.0)
        intervals.add_batch(watch.fleet.next_batch(NOW_S + watch.now_s))
    return intervals


@pytest.mark.parametrize(
    ("every_s", "reports", "grace_s"),
    [
        (1.0, 1, 30.0),
        (1.0, 2, 30.0),  # how often it reports is not known before the third
        (1.0, 3, 5.0),
        (1.0, 20, 5.0),
        (4.0, 10, 12.0),
        (30.0, 3, 90.0),
    ],
)
def test_a_robot_is_silent_after_the_longer_of_five_seconds_and_three_of_its_usual_gaps(
    every_s: float, reports: int, grace_s: float
) -> None:
    assert reported(every_s, reports).grace_s(robot("A")) == pytest.approx(grace_s)


@pytest.mark.parametrize(("driving", "grace_s"), [(False, 35.0), (True, 5.0)])
def test_a_standing_robot_is_not_silent_before_its_language_wants_its_next_report(
    driving: bool, grace_s: float
) -> None:
    """A robot of VDA 5050 that stands sends its state each 30 s."""
    watch, intervals = Watch(), ReportIntervals(RobotSlots())
    for at_s in range(4):
        raw = state(NOW_S + at_s, driving=driving, agvPosition=position(0.0, 0.0, 0.0))
        watch.fleet.receive(raw, NOW_S + at_s, line("state"))
        intervals.add_batch(watch.fleet.next_batch(NOW_S + at_s))
    (uuid,) = watch.fleet.robots
    assert intervals.grace_s(uuid) == grace_s


def test_one_long_gap_does_not_change_what_is_usual() -> None:
    watch, intervals = Watch(), ReportIntervals(RobotSlots())
    for at_s in (0, 1, 2, 3, 60, 61, 62):
        watch.now_s = float(at_s)
        watch.say("A", 0.0)
        intervals.add_batch(watch.fleet.next_batch(NOW_S + at_s))
    assert intervals.grace_s(robot("A")) == 5.0


def test_several_reports_between_two_batches_count_as_several_gaps() -> None:
    watch, intervals = Watch(), ReportIntervals(RobotSlots())
    for at_s in range(40):
        watch.now_s = float(at_s)
        watch.say("A", 0.0)
        if at_s % 4 == 0:
            intervals.add_batch(watch.fleet.next_batch(NOW_S + at_s))
    assert intervals.grace_s(robot("A")) == 5.0


def test_a_robot_stood_that_has_not_moved_since_the_report_before() -> None:
    watch, intervals, moved = Watch(), ReportIntervals(RobotSlots()), []
    for second, x_m in enumerate((0.0, 1.0, 1.02, 1.03)):
        watch.now_s = float(second)
        watch.say("A", x_m)
        intervals.add_batch(watch.fleet.next_batch(NOW_S + second))
        moved.append(intervals.moved(robot("A")))
    assert moved == [None, True, False, False]


def test_a_repeated_batch_row_is_no_new_report() -> None:
    watch, intervals = Watch(), ReportIntervals(RobotSlots())
    watch.say("A", 0.0)
    first, new = intervals.add_batch(watch.fleet.next_batch(NOW_S))
    again, known = intervals.add_batch(watch.fleet.next_batch(NOW_S + 1.0, True))
    assert (len(first.rows), len(again.rows), new, known) == (1, 0, [0], [])


def test_the_slot_of_a_forgotten_robot_is_reused() -> None:
    watch, intervals = Watch(), ReportIntervals(RobotSlots())
    watch.say("A", 0.0)
    watch.say("B", 1.0)
    intervals.add_batch(watch.fleet.next_batch(NOW_S))
    intervals.forget(robot("A"))
    intervals.slots.release([robot("A")])
    watch.now_s = 1.0
    watch.say("C", 5.0)
    intervals.add_batch(watch.fleet.next_batch(NOW_S + 1.0))
    assert intervals.slots.by_uuid[robot("C")] != intervals.slots.by_uuid[robot("B")]
    assert [intervals.slots.uuids[intervals.slots.by_uuid[robot(name)]] for name in "BC"] == [robot("B"), robot("C")]
    assert intervals.grace_s(robot("C")) == 30.0
