from ingest.measures.outages import QUIET_S, OutageLog


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
    outages.was_steady()
    assert outages.failed() == ""
