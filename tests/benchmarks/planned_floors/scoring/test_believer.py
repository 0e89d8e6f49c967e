from math import pi

from benchmarks.planned_floors.scoring.believer import believed_alerts
from tests.benchmarks.planned_floors.made_truth import START_S, A, B, report, reporting


def test_paths_that_meet_are_an_alert_of_consecutive_seconds() -> None:
    east = reporting(A, [report(t_s, t_s - 20.0, to_x_m=t_s - 10.0) for t_s in range(31)])
    west = reporting(B, [report(t_s, 20.0 - t_s, to_x_m=10.0 - t_s, yaw_rad=pi) for t_s in range(31)])
    [alert] = believed_alerts([east, west], 0.3)
    assert alert.pair == (A, B)
    # Bodies are 0.3 m apart at 19.35 s, which is seen within 10 s before; then they are within the clearance.
    assert (alert.raised_s - START_S, alert.cleared_s - START_S) == (10.0, 20.0)


def test_a_robot_without_a_path_is_extrapolated_straight() -> None:
    standing = reporting(A, [report(t_s, 0.0) for t_s in range(6)])
    coming = reporting(B, [report(t_s, t_s - 12.0, speed_mps=1.0) for t_s in range(6)])
    [alert] = believed_alerts([standing, coming], 0.3)
    assert alert.raised_s - START_S == 1.0


def test_a_robot_that_is_silent_for_long_is_removed() -> None:
    standing = reporting(A, [report(t_s, 0.0) for t_s in range(31)])
    # Its path ends 0.1 m before the other, so that only silence ends the alert.
    last = reporting(B, [report(t_s, -5.0, to_x_m=-1.1) for t_s in range(3)])
    [alert] = believed_alerts([standing, last], 0.3)
    assert (alert.raised_s - START_S, alert.cleared_s - START_S) == (0.0, 8.0)


def test_lanes_with_more_than_the_clearance_between_them_are_no_alert() -> None:
    east = reporting(A, [report(t_s, t_s - 20.0, to_x_m=t_s - 10.0) for t_s in range(31)])
    west = reporting(B, [report(t_s, 20.0 - t_s, 1.0, to_x_m=10.0 - t_s, yaw_rad=pi) for t_s in range(31)])
    assert believed_alerts([east, west], 0.3) == []
    assert believed_alerts([east, west], 0.5)
