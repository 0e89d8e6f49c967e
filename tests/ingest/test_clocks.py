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
    """Errors of the event time of messages sent once a second by a clock `ahead_s` fast, 30 to 200 ms under way."""
    random = Random(5)
    errors = []
    for i in range(messages):
        true_s = start_s + i * 1.0003
        stamp_s = floor(true_s + ahead_s) if coarse else round(true_s + ahead_s, 3)
        arrival_s = true_s + random.uniform(0.03, 0.2)
        clock.update(stamp_s, arrival_s, 1.0 if coarse else 0.001)
        event_s = clock.event_s(stamp_s, arrival_s)
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


@pytest.mark.parametrize("step_s", [3600.0, -3600.0])
def test_a_step_of_the_clock_is_followed_within_a_few_messages(step_s: float) -> None:
    clock = SenderClock(TOLERANCE_S)
    drive(clock, 0.0, 40)
    errors = drive(clock, step_s, 40, start_s=NOW_S + 41)
    assert max(map(abs, errors)) <= 0.2
    assert clock.offset_s == pytest.approx(-step_s, abs=0.1)


def test_one_stray_stamp_is_no_step() -> None:
    clock = SenderClock(TOLERANCE_S)
    drive(clock, 0.0, 40)
    clock.update(NOW_S - 5000.0, NOW_S + 41.0, 0.001)
    assert clock.event_s(NOW_S - 5000.0, NOW_S + 41.0) == NOW_S + 41.0
    drive(clock, 0.0, 2, start_s=NOW_S + 42)
    assert clock.offset_s == 0.0


def test_a_slow_drift_is_followed() -> None:
    clock = SenderClock(TOLERANCE_S)
    for i in range(20_000):
        clock.update(NOW_S + i * (1 + 50e-6), NOW_S + i + 0.05, 0.001)
    assert clock.offset_s == pytest.approx(-1.0 + 0.05, abs=0.01)


@pytest.mark.parametrize("ahead_s", [0.0, 3.0])
def test_whole_second_stamps_are_placed_by_their_arrival(ahead_s: float) -> None:
    assert max(map(abs, drive(SenderClock(TOLERANCE_S), ahead_s, 60, coarse=True))) <= 0.2


def test_a_vendors_offset_is_that_of_most_of_its_robots() -> None:
    clocks = [SenderClock(TOLERANCE_S) for _ in range(3)]
    for clock, ahead_s in zip(clocks, (3.0, 3.0, 900.0), strict=True):
        drive(clock, ahead_s, 40)
    assert vendor_offset(clocks) == pytest.approx(-3.0, abs=0.1)
    assert vendor_offset([]) == 0.0
