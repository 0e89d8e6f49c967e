from random import Random

import pytest

from ingest.measures.outages import QUIET_S, OutageLog, backoff_s


class Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def test_one_outage_is_logged_once_however_often_it_fails() -> None:
    outages = OutageLog(Clock())
    assert [outages.failed() for _ in range(3)] == ["", None, None]
    assert outages.worked()
    assert not outages.worked(), "its end is logged once"


def test_of_one_that_comes_and_goes_the_others_are_counted() -> None:
    clock = Clock()
    outages = OutageLog(clock)
    logged = []
    for clock.now_s in (0.0, 10.0, 20.0, QUIET_S + 1):
        logged.append((outages.failed(), outages.worked()))
    assert logged == [
        ("", True),
        (None, False),
        (None, False),
        (", after 2 more outages since it was last logged", True),
    ]


def test_an_outage_that_was_only_counted_is_logged_if_it_lasts() -> None:
    clock = Clock()
    outages = OutageLog(clock)
    outages.failed()
    outages.worked()
    clock.now_s = 10.0
    assert outages.failed() is None
    clock.now_s = QUIET_S + 1
    assert outages.failed() == ""
    assert outages.worked()


def test_the_outage_of_one_that_worked_for_long_is_logged() -> None:
    outages = OutageLog(Clock())
    outages.failed()
    outages.worked()
    assert outages.failed(was_steady=True) == ""


def test_waits_double_from_the_first_to_the_longest() -> None:
    random, longest = Random(1), []
    for failures in (0, 1, 2, 3, 7, 5000):
        waits = [backoff_s((0.5, 30.0), failures, random) for _ in range(300)]
        assert min(waits) >= max(waits) / 2.1
        longest.append(max(waits))
    assert longest == pytest.approx([0.5, 0.5, 1.0, 2.0, 30.0, 30.0], rel=0.02)
