from math import inf, isnan, pi

import pytest

from ingest.languages.model import NO_PATH, Identity, Update
from ingest.languages.tolerance.heard import STEPPED_BACK
from tests.helpers.iso_saying import CCS, identity, iso, odometry, points, states, trajectory
from tests.ingest.languages.iso21423.made_iso import IsoListener, T

HERE = ("odometry", odometry(T))
TRIANGLE = [{"x": 1.0, "y": 0.0}, {"x": -0.5, "y": 0.5}, {"x": -0.5, "y": -0.5}]


@pytest.mark.parametrize(
    ("names", "speed", "expected"),
    [
        (("MODE_AUTO",), 0.0, "navigating"),
        (("MODE_AUTO", "IDLE"), 0.0, "idle"),
        (("MODE_AUTO", "PARKED"), 0.5, "navigating"),
        (("MODE_AUTO", "CHARGING", "IDLE"), 0.0, "charging"),
        (("MODE_AUTO", "PAUSED"), 0.0, "waitingExternalEvent"),
        (("MODE_AUTO", "WAIT_FOR_RESET"), 0.0, "waitingHumanEvent"),
        (("MODE_SEMIAUTO", "DOCKING"), 0.1, "navigating"),
        (("MODE_TELEOP",), 0.5, "manualOverride"),
        (("MODE_MAINTENANCE",), 0.0, "disabled"),
        (("MODE_MAINTENANCE",), 0.5, "manualOverride"),
        (("OFFLINE",), 0.0, "offline"),
        ((), 0.5, "navigating"),
        ((), 0.0, "idle"),
    ],
)
def test_the_state_is_the_nearest_of_the_states_that_all_languages_share(
    names: tuple[str, ...], speed: float, expected: str
) -> None:
    listener = IsoListener()
    assert (
        listener.status_after(("status", states(T, *names)), ("odometry", odometry(T, speed=speed))).state == expected
    )


@pytest.mark.parametrize("name", ["STOP_CATEGORY_0", "STOP_CATEGORY_2", "BLOCKED", "DANCING"])
def test_a_stopped_robot_is_blocked_also_in_manual_mode(name: str) -> None:
    assert IsoListener().status_after(HERE, ("status", states(T, "MODE_MANUAL", name))).is_blocked
    assert not IsoListener().status_after(HERE, ("status", states(T, "MODE_AUTO", "STOPPED"))).is_blocked


def test_a_robot_that_moves_is_not_blocked_whatever_it_says() -> None:
    moving = ("odometry", odometry(T + 1, 1.0, 2.0, 0.0, -0.2))
    for name in ("BLOCKED", "DANCING", "MODE_DANCING"):
        assert not IsoListener().status_after(HERE, ("status", states(T, "MODE_AUTO", name)), moving).is_blocked


@pytest.mark.parametrize("key", ["states", "operatingStates", "operating_states", "STATES"])
def test_states_are_read_under_both_names_and_in_any_spelling(key: str) -> None:
    said_of = iso(T, **{key: ["mode-auto", "Stop Category 1"]})
    assert IsoListener().status_after(HERE, ("status", said_of)).is_blocked


def test_a_last_will_needs_no_time() -> None:
    raw = b'{"states": ["LOST_CONNECTION"]}'
    assert set(IsoListener().hears("disconnection", raw).findings) == {"stamp-unreadable"}


def test_pose_motion_battery_and_doubt() -> None:
    status = IsoListener().status_after(
        ("batteryStatus", iso(T, batterySoc=0.25)),
        ("status", states(T, "MODE_AUTO", "LOST")),
        ("odometry", odometry(T, 1.0, 2.0, pi / 2, 0.7)),
    )
    assert (status.x, status.y, status.yaw_rad, status.datum) == (1.0, 2.0, pi / 2, CCS)
    assert (status.linear_mps, status.amounts.battery_pct, status.is_lost) == (0.7, 25.0, True)


def test_a_trajectory_is_the_path_and_a_plan_the_destinations() -> None:
    ahead = trajectory(T, (T + 1, 1.0, 0.0), (T + 2, 2.0, 0.0))
    plan = iso(T, globalPlan=points((T + 60, 50.0, 0.0)))
    status = IsoListener().status_after(HERE, ("localTrajectory", ahead), ("globalPlan", plan))
    assert [row[:3] for row in status.path.poses] == [(T + 1, 1.0, 0.0), (T + 2, 2.0, 0.0)]
    assert isnan(status.path.poses[0][3])
    assert status.path.datums == (CCS, CCS)
    assert status.destinations.poses[0][:3] == (T + 60, 50.0, 0.0)


@pytest.mark.parametrize(
    ("s", "x", "speed_mps", "is_followed", "is_counted"),
    [
        (2.0, 0.0, 0.0, True, False),
        (4.0, 4.9, 1.0, True, False),
        (8.5, 8.0, 1.0, True, False),
        (4.0, 2.9, 1.0, False, True),
        (4.0, 0.0, 0.0, False, True),
        (9.5, 9.5, 1.0, False, True),
        (60.0, 9.0, 0.0, False, False),
    ],
)
def test_a_trajectory_that_is_not_renewed_is_followed_while_it_goes_on_and_the_robot_is_on_it(
    s: float, x: float, speed_mps: float, is_followed: bool, is_counted: bool
) -> None:
    ahead = ("localTrajectory", trajectory(T, (T + 1, 1.0, 0.0), (T + 9, 9.0, 0.0)))
    status = IsoListener().status_after(ahead, ("odometry", odometry(T + s, x, speed=speed_mps)))
    assert ((status.path is not NO_PATH), ("path-outdated" in status.findings)) == (is_followed, is_counted)


@pytest.mark.parametrize(("sent", "charge_pct"), [(-0.1, 0.0), (1.0, 100.0), (15, 15.0), (100, 100.0), (101, 100.0)])
def test_a_battery_above_one_is_in_percent(sent: float, charge_pct: float) -> None:
    status = IsoListener().status_after(("batteryStatus", iso(T, batterySoc=sent)), HERE)
    assert status.amounts.battery_pct == charge_pct


def test_a_footprint_replaces_that_of_the_identity_until_it_is_empty() -> None:
    listener = IsoListener()
    first = listener.hears("identity", identity(T))
    assert isinstance(first, Identity)
    assert (first.manufacturer, first.model, first.serial) == ("Acme", "TUG", "42")
    assert (first.envelope_m, first.max_speed_mps, first.outline) == ((1.2, 0.8, 1.9), 1.8, None)
    loaded = listener.hears("footprint", iso(T + 1, footprint=TRIANGLE))
    assert isinstance(loaded, Identity)
    assert loaded.envelope_m == pytest.approx((1.5, 1.0, 1.9))
    assert loaded.outline is not None
    assert loaded.offset_m == (0.25, 0.0)
    empty = listener.hears("footprint", iso(T + 2, footprint=[]))
    assert isinstance(empty, Identity)
    assert empty.envelope_m == (1.2, 0.8, 1.9)


def test_a_footprint_before_the_identity_counts_with_it() -> None:
    listener = IsoListener()
    assert isinstance(listener.hears("footprint", iso(T, footprint=TRIANGLE)), Update)
    read = listener.hears("identity", identity(T))
    assert isinstance(read, Identity)
    assert read.envelope_m[0] == 1.5


def test_older_messages_and_repeated_ones_change_nothing() -> None:
    listener = IsoListener()
    listener.hears("odometry", odometry(T, 5.0))
    before = listener.memory
    assert listener.hears("odometry", odometry(T, 5.0)).findings == ("message-repeated",)
    assert listener.hears("odometry", odometry(T - 1, 4.0)).findings == ("message-reordered",)
    assert before
    assert listener.memory
    assert (listener.memory.pose, listener.memory.plan) == (before.pose, before.plan)


@pytest.mark.parametrize("back_s", [1.0, 5.0, 3600.0])
def test_a_robot_whose_clock_was_set_back_is_placed_after_a_few_messages(back_s: float) -> None:
    listener = IsoListener()
    listener.hears(*HERE)
    older = [listener.hears("odometry", odometry(T - back_s + s / 10, 6.0)) for s in range(STEPPED_BACK)]
    assert [message.findings for message in older] == [("message-reordered",)] * (STEPPED_BACK - 1) + [()]
    assert listener.status_after(("odometry", odometry(T - back_s + 1, 7.0))).x == 7.0


@pytest.mark.parametrize("late_s", [1.0, 5.0, 70.0])
def test_copies_that_come_late_by_another_way_change_nothing(late_s: float) -> None:
    listener = IsoListener()
    for s in range(20):
        assert listener.status_after(("odometry", odometry(T + s, float(s)))).x == s
        late = listener.hears("odometry", odometry(T + s - late_s - 0.5, float(s) - late_s))
        assert late.findings == ("message-reordered",)


def test_another_odometry_at_the_same_time_counts_from_its_arrival() -> None:
    listener = IsoListener()
    listener.hears("odometry", odometry(T, 5.0))
    raw = odometry(T, 6.0)
    moved = listener.status_after(("odometry", raw))
    assert (moved.x, moved.stamp_resolution_s, moved.findings) == (6.0, inf, ("stamp-unchanged",))
    assert listener.hears("odometry", raw).findings == ("message-repeated",)


def test_an_odometry_without_a_coordinate_system_is_in_that_of_the_robots_paths_or_in_the_last() -> None:
    def nameless(t_s: float) -> tuple[str, bytes]:
        return "odometry", odometry(t_s).replace(b'"ccsId": "hall"', b'"ccsId": " "')

    assert IsoListener().status_after(nameless(T)).datum == ""
    path = ("localTrajectory", trajectory(T, (T + 1, 1.0, 0.0)))
    read = IsoListener().status_after(path, nameless(T))
    assert (read.datum, read.findings, read.oddities[0].reading) == (CCS, ("map-missing",), CCS)
    assert IsoListener().status_after(HERE, nameless(T + 1)).datum == CCS


def test_outer_spaces_of_a_coordinate_system_do_not_count() -> None:
    spaced = odometry(T).replace(b'"ccsId": "hall"', b'"ccsId": " HALL "')
    assert IsoListener().status_after(("odometry", spaced)).datum == CCS


def test_a_path_that_is_over_does_not_bring_a_robot_without_a_coordinate_system_back_to_its_floor() -> None:
    def upstairs(t_s: float, ccs_id: str) -> tuple[str, bytes]:
        return "odometry", odometry(t_s).replace(b'"ccsId": "hall"', f'"ccsId": "{ccs_id}"'.encode())

    listener = IsoListener()
    listener.hears("localTrajectory", trajectory(T, (T + 1, 1.0, 0.0), (T + 2, 2.0, 0.0)))
    assert listener.status_after(upstairs(T, " ")).datum == CCS
    assert listener.status_after(upstairs(T + 60, "loft")).datum == "loft"
    assert listener.status_after(upstairs(T + 61, " ")).datum == "loft"


@pytest.mark.parametrize(("seconds", "datum"), [(1.5, CCS), (2.5, CCS), (3.5, "loft")])
def test_points_that_a_robot_without_a_coordinate_system_has_passed_do_not_say_where_it_is(
    seconds: float, datum: str
) -> None:
    listener, way = IsoListener(), points(*((T + s, 0.0, 0.0) for s in (1, 2, 3, 4)))
    for point in way[2:]:
        point["locationPoint"]["ccsId"] = "loft"
    listener.status_after(HERE, ("localTrajectory", iso(T, localTrajectory=way)))
    nameless = odometry(T + seconds).replace(b'"ccsId": "hall"', b'"ccsId": " "')
    assert listener.status_after(("odometry", nameless)).datum == datum
