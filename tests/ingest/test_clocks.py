from math import floor
from random import Random

import pytest

from ingest.clocks import WINDOW, SenderClock, vendor_offset

NOW_S = 1_790_000_000.0
TOLERANCE_S = 0.25
YEAR_S = 365.25 * 86400.0


def drive(
    clock: SenderClock, ahead_s: float, messages: int, start_s: float = NOW_S, coarse: bool = False
) -> list[float]:
    """Errors of the event time of messages sent once a second by a clock `ahead_s` fast, 30 to 200 ms under way.

    With `coarse` stamps of whole seconds they are sent at any moment of each second.
    """
    random = Random(5)
    errors = []
    for i in range(messages):
        true_s = start_s + i * 1.0003 + coarse * random.uniform(0.0, 0.9)
        stamp_s = floor(true_s + ahead_s) if coarse else round(true_s + ahead_s, 3)
        arrival_s = true_s + random.uniform(0.03, 0.2)
        event_s = clock.event_time(stamp_s, arrival_s, 1.0 if coarse else 0.001)
        assert event_s <= arrival_s
        errors.append(event_s - true_s)
    return errors


def test_a_right_clock_is_left_alone_and_its_messages_are_late() -> None:
    clock = SenderClock(TOLERANCE_S)
    assert max(map(abs, drive(clock, 0.0, 60))) < 2e-3
    assert clock.offset_s == 0.0
    assert 0.03 <= clock.delay_s <= 0.2


@pytest.mark.parametrize("ahead_s", [3.0, -3.0, 3600.0, -17 * YEAR_S], ids=["fast", "slow", "an hour", "17 years"])
def test_a_wrong_clock_is_corrected_from_the_first_message_on(ahead_s: float) -> None:
    clock = SenderClock(TOLERANCE_S)
    errors = drive(clock, ahead_s, 60)
    assert max(map(abs, errors)) <= 0.2
    assert max(map(abs, errors[WINDOW:])) < 0.06
    assert clock.offset_s == pytest.approx(-ahead_s, abs=0.06)


def send(clock: SenderClock, stamp_s: float, arrival_s: float, resolution_s: float = 0.001) -> float:
    """The event time of one message."""
    return clock.event_time(stamp_s, arrival_s, resolution_s)


@pytest.mark.parametrize("coarse", [False, True])
@pytest.mark.parametrize("step_s", [3600.0, 4.0, -4.0, -3600.0, -17 * YEAR_S])
def test_a_step_of_the_clock_is_followed_within_a_few_messages(step_s: float, coarse: bool) -> None:
    clock = SenderClock(TOLERANCE_S)
    drive(clock, 0.0, 40, coarse=coarse)
    errors = drive(clock, step_s, 40, start_s=NOW_S + 41, coarse=coarse)
    at_first = 0 if step_s > 0 else 3
    assert max(map(abs, errors[at_first:])) <= 0.2
    assert -1.2 * coarse - 0.1 <= -step_s - clock.offset_s <= 0.1


def test_a_small_step_back_is_followed_within_the_window() -> None:
    clock = SenderClock(TOLERANCE_S)
    drive(clock, 0.0, 40)
    assert max(map(abs, drive(clock, -0.8, 2 * WINDOW, start_s=NOW_S + 41)[WINDOW:])) <= 0.2


@pytest.mark.parametrize("astray_s", [-5000.0, 5000.0])
def test_one_stray_stamp_is_no_step(astray_s: float) -> None:
    clock = SenderClock(TOLERANCE_S)
    drive(clock, 0.0, 40)
    assert send(clock, NOW_S + 41.0 + astray_s, NOW_S + 41.0) == NOW_S + 41.0 + min(astray_s, 0.0)
    drive(clock, 0.0, 2, start_s=NOW_S + 42)
    assert clock.offset_s == 0.0


def test_two_senders_under_one_name_do_not_pull_the_clock_to_and_fro() -> None:
    clock = SenderClock(TOLERANCE_S)
    drive(clock, 0.0, 40)
    for i in range(20):
        send(clock, NOW_S + 41 + i - 900.0, NOW_S + 41 + i)
        assert clock.offset_s == 0.0
        send(clock, NOW_S + 41.5 + i, NOW_S + 41.6 + i)


def test_stamps_at_random_teach_nothing() -> None:
    clock, random = SenderClock(TOLERANCE_S), Random(2)
    drive(clock, 3.0, 40)
    for i in range(200):
        send(clock, random.uniform(0.0, 4e9), NOW_S + 41.0 + i)
    assert clock.offset_s == pytest.approx(-3.0, abs=0.1)


@pytest.mark.parametrize("ahead_s", [0.0, 3.0])
@pytest.mark.parametrize("resolution_s", [0.001, 1.0])
def test_messages_held_up_for_a_while_keep_the_times_they_were_sent_at(resolution_s: float, ahead_s: float) -> None:
    clock, outage_s = SenderClock(TOLERANCE_S), 20
    drive(clock, ahead_s, 40, coarse=resolution_s == 1.0)
    end_s = NOW_S + 50 + outage_s
    for i in range(outage_s):
        true_s = NOW_S + 50 + i
        event_s = send(clock, true_s + ahead_s, end_s, resolution_s)
        assert true_s - 0.1 <= event_s <= true_s + 0.2 + resolution_s
    assert clock.delay_s == pytest.approx(1.0, abs=0.3)


def test_what_is_sent_often_and_held_up_ends_with_the_newest() -> None:
    clock = SenderClock(TOLERANCE_S)
    drive(clock, 0.0, 40)
    end_s = NOW_S + 60
    events = [send(clock, end_s - 10 + i / 10, end_s) for i in range(100)]
    assert events == pytest.approx([end_s - 10 + i / 10 for i in range(100)], abs=0.1)
    assert max(map(abs, drive(clock, 0.0, 20, start_s=end_s + 1))) <= 0.2


def test_a_slow_drift_is_followed() -> None:
    clock = SenderClock(TOLERANCE_S)
    for i in range(20_000):
        clock.event_time(NOW_S + i * (1 + 50e-6), NOW_S + i + 0.05, 0.001)
    assert clock.offset_s == pytest.approx(-1.0 + 0.05, abs=0.01)


@pytest.mark.parametrize("ahead_s", [0.0, 3.0])
def test_whole_second_stamps_are_placed_by_their_arrival(ahead_s: float) -> None:
    assert max(map(abs, drive(SenderClock(TOLERANCE_S), ahead_s, 60, coarse=True))) <= 0.2


def test_the_part_of_a_second_that_a_stamp_leaves_out_is_no_step_and_hides_none() -> None:
    clock = SenderClock(TOLERANCE_S)
    parts_s = [0.05, 1.15, 1.15, 1.15, 1.15] * 8
    for i, part_s in enumerate(parts_s):
        send(clock, NOW_S + i, NOW_S + i + part_s, 1.0)
        assert clock.offset_s == 0.0
    for i, part_s in enumerate([0.05, 1.15] * 3):
        send(clock, NOW_S + i - 3600.0, NOW_S + i + part_s, 1.0)
    assert clock.offset_s == pytest.approx(3600.05)


def test_a_vendors_offset_is_that_of_most_of_its_robots() -> None:
    clocks = [SenderClock(TOLERANCE_S) for _ in range(3)]
    for clock, ahead_s in zip(clocks, (3.0, 3.0, 900.0), strict=True):
        drive(clock, ahead_s, 40)
    assert vendor_offset(clocks) == pytest.approx(-3.0, abs=0.1)
    assert vendor_offset([]) == 0.0
