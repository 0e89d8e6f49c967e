"""Who was gone, and who met the silent robots that were there."""

import gc
from typing import Any
from weakref import ref

import pytest

from metrics.truth.absences import Absences
from tests.deconflict.foresight.presence.made_watch import NOW_S, Watch
from tests.helpers.saying import LOFT, robot

SIZE = {"x": 1.0, "y": 0.6, "z": 0.4}
PAIR = (min(robot("silent"), robot("other")), max(robot("silent"), robot("other")))


class Scored(Watch):
    """The same floor, of which it is kept who was gone."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.absences = Absences([0.3, 0.5])

    def tick(self, everything: bool = False) -> None:  # type: ignore[override]
        self.absences.add_batch(self.fleet.next_batch(NOW_S + self.now_s, everything))

    def is_gone(self, name: str, at_s: float) -> bool:
        return self.absences.is_gone(robot(name), NOW_S + at_s)


def test_a_robot_that_never_reports_again_is_gone_from_the_end_of_its_grace_period() -> None:
    floor = Scored()
    floor.drive("A", 0.0, seconds=9)
    floor.say("B", 50.0)
    floor.tick()
    floor.wait(60.0)
    floor.absences.finish()
    assert [floor.is_gone("A", at_s) for at_s in (9.0, 13.9, 14.1, 60.0)] == [False, False, True, True]
    assert [floor.is_gone("B", at_s) for at_s in (38.9, 39.1)] == [False, True]
    assert not floor.is_gone("nobody", 60.0)


def test_a_robot_that_reports_from_another_place_was_gone_in_between() -> None:
    floor = Scored()
    elsewhere: tuple[tuple[str, float, dict[str, Any]], ...] = (
        ("far", 40.0, {}),
        ("near", 9.8, {}),
        ("floor", 9.0, {"datum": LOFT}),
    )
    for name, x_m, datum in elsewhere:
        start_s = floor.now_s
        floor.drive(name, 0.0, seconds=9, path_s=1)
        floor.wait(20.0)
        floor.say(name, x_m, **datum)
        floor.tick()
        spans = [floor.is_gone(name, start_s + at_s) for at_s in (13.0, 15.0, 28.0, 30.0)]
        assert spans == [False, name != "near", name != "near", False]


def with_meeting(back_m: float = 10.0) -> Scored:
    """A robot stands at 10 m and falls silent for half a minute, while another one passes it at 0.2 m."""
    floor = Scored()
    for name in ("silent", "other"):
        floor.identify(name, baseRobotEnvelope=SIZE)
    floor.stand("silent", 10.0)
    floor.wait(10.0)
    floor.drive("other", 0.0, 0.8, seconds=20)
    floor.say("silent", back_m, operationalState="idle")
    floor.tick()
    floor.absences.finish()
    return floor


def test_an_encounter_counts_with_a_silent_robot_that_stood_there_throughout() -> None:
    met_s = NOW_S + 15.0 + 9.0 - 0.25
    floor = with_meeting()
    document = floor.absences.figures(0.3, [(PAIR, met_s - 4.0, met_s + 3.0)], 2.0)
    assert (document["silent_there"], document["meetings"], document["told_of"], document["told_of_share"]) == (
        1,
        1,
        1,
        1.0,
    )
    assert (document["raised"], document["about_gone"]) == (1, 0)
    late = floor.absences.figures(0.3, [(PAIR, met_s + 0.5, met_s + 3.0)], 2.0)
    over = floor.absences.figures(0.5, [(PAIR, met_s - 9.0, met_s - 3.0)], 2.0)
    assert (late["told_of"], over["told_of"], over["told_of_share"]) == (0, 0, 0.0)


@pytest.mark.parametrize("back_m", [11.0, 25.0])
def test_a_robot_that_moved_while_silent_has_no_known_encounter(back_m: float) -> None:
    document = with_meeting(back_m).absences.figures(0.3, [], 2.0)
    assert (document["silent_there"], document["meetings"], document["told_of_share"]) == (int(back_m < 20), 0, None)


def test_an_advisory_is_about_a_gone_robot_if_it_was_raised_while_that_was_gone() -> None:
    floor = Scored()
    floor.drive("silent", 0.0, seconds=9)
    floor.drive("other", 20.0, seconds=30)
    floor.absences.finish()
    alerts = [(PAIR, NOW_S + at_s, NOW_S + at_s + 20.0) for at_s in (8.0, 13.0, 15.0, 30.0)]
    document = floor.absences.figures(0.3, alerts, 2.0)
    assert (document["raised"], document["about_gone"], document["about_gone_share"]) == (4, 2, 0.5)
    assert floor.absences.figures(0.3, [], 2.0)["about_gone_share"] is None


def test_the_last_report_of_a_silent_robot_keeps_no_other_robot_in_memory() -> None:
    floor = Scored()
    for name in ("silent", "other"):
        floor.say(name, 0.0)
    batch = floor.fleet.next_batch(NOW_S, everything=False)
    floor.absences.add_batch(batch)
    whole = ref(batch.forecasts.length_m)
    del batch
    for floor.now_s in range(1, 60):
        floor.say("other", float(floor.now_s))
        floor.tick()
    gc.collect()
    assert whole() is None
