"""Which robots are still present, by their reports."""

import pytest

from deconflict.foresight.presence.live_robots import LiveRobot
from deconflict.foresight.presence.presence import Presence
from deconflict.foresight.presence.probably_left import LastingSilence
from deconflict.runtime.learned_state import learned_of, packed, unpacked
from tests.deconflict.foresight.presence.made_watch import DOOR_M, LINE, NOW_S, Watch, leave
from tests.helpers.saying import LOFT, identity, robot


@pytest.mark.parametrize(("every_s", "reports", "grace_s"), [(1, 5, 5.0), (10, 5, 30.0), (1, 2, 30.0)])
def test_the_probability_of_presence_falls_only_after_the_grace_time(
    every_s: int, reports: int, grace_s: float
) -> None:
    watch = Watch()
    for number in range(reports):
        watch.say("A", float(number), speed_mps=1.0 / every_s)
        watch.tick()
        watch.wait(every_s if number < reports - 1 else grace_s - 0.1)
    assert watch.there("A") == 1.0
    assert watch.presence.silent_s(robot("A"), NOW_S + watch.now_s) is None
    watch.wait(0.25)
    assert watch.presence.silent_s(robot("A"), NOW_S + watch.now_s) == pytest.approx(grace_s, abs=0.3)
    assert watch.there("A") == pytest.approx(0.9, abs=0.01)
    values = []
    for _ in range(6):
        watch.wait(grace_s)
        values.append(watch.there("A"))
    assert values == sorted(values, reverse=True)
    assert 0.5 < values[-1] < values[0] < 0.9


def test_a_robot_that_reports_again_is_present() -> None:
    watch = Watch()
    watch.drive("A", 0.0)
    watch.wait(20.0)
    assert watch.there("A") < 0.9
    watch.say("A", 20.0, speed_mps=1.0)
    assert watch.tick().there == {robot("A"): 1.0}
    assert watch.there("A") == 1.0
    watch.wait(4.9)
    assert watch.there("A") == 1.0
    watch.wait(20.0)
    assert watch.there("A") < 1.0


@pytest.mark.parametrize("state", ["charging", "disabled", "offline"])
def test_a_robot_that_does_not_leave_by_its_state_stays(state: str) -> None:
    watch = Watch()
    watch.stand("A", 0.0, operationalState=state)
    watch.wait(3600.0)
    assert watch.there("A") == 1.0
    assert watch.presence.silent_s(robot("A"), NOW_S + watch.now_s) == pytest.approx(3600.0)


def test_a_robot_that_is_stuck_stays() -> None:
    watch = Watch()
    watch.drive("A", 0.0, 0.0, 0.0, operationalState="navigating", errorCodes=["stuck"])
    watch.wait(3600.0)
    assert watch.there("A") == 1.0


def test_at_an_exit_a_silent_robot_has_left_and_elsewhere_a_standing_one_is_present() -> None:
    watch = Watch()
    leave(watch, 10)
    assert watch.now_s < 90
    watch.drive("next", DOOR_M - 6.0, seconds=6)
    watch.stand("breaks down", 4.0, 9.0)
    watch.wait(6.0)
    assert watch.there("next") < 0.2
    watch.wait(54.0)
    assert watch.there("breaks down") > 0.9
    (exit_,) = watch.presence.exits(NOW_S + watch.now_s)
    assert [exit_.x_m, exit_.y_m] == pytest.approx([DOOR_M, 0.5], abs=0.5)
    assert 8 <= exit_.robots <= 11


def test_robots_with_short_radio_losses_stay_present() -> None:
    watch = Watch()
    for number in range(12):
        watch.drive(f"R{number}", 3.0 * number, seconds=3)
        watch.wait(10.0 + 4.0 * number)
        watch.say(f"R{number}", 3.0 * number + min(3.0 + watch.now_s, 13.0), operationalState="idle")
        watch.tick()
    watch.drive("A", 5.0)
    watch.wait(40.0)
    assert watch.there("A") > 0.85


def test_a_robot_that_returns_elsewhere_was_not_in_its_place() -> None:
    watch = Watch()
    watch.drive("A", 0.0, seconds=3)
    watch.wait(30.0)
    watch.say("A", 60.0, 30.0)
    watch.drive("B", 0.0, 9.0, seconds=3)
    watch.wait(7.0)
    watch.say("B", 10.0, 9.0)
    watch.stand("C", 0.0, 20.0)
    watch.wait(30.0)
    watch.say("C", 0.0, 20.0, datum=LOFT)
    watch.tick()
    assert watch.outcomes() == {"elsewhere": 2, "there": 1}


def test_a_vendor_whose_robots_fall_silent_all_at_once_has_lost_its_connection() -> None:
    watch = Watch()
    names = [f"R{number}" for number in range(6)]
    for second in range(5):
        watch.now_s = float(second)
        for number, name in enumerate(names):
            watch.say(name, 5.0 * number)
        watch.tick()
    watch.wait(120.0)
    assert [watch.there(name) for name in names] == [1.0] * 6
    for number, name in enumerate(names[:-1]):
        watch.say(name, 5.0 * number)
    watch.tick()
    watch.wait(2.0)
    assert watch.there(names[-1]) == 1.0
    for _ in range(16):
        watch.wait(1.0)
        for number, name in enumerate(names[:-1]):
            watch.say(name, 5.0 * number)
        watch.tick()
    assert watch.there(names[-1]) < 1.0
    assert watch.outcomes() == {}


def test_a_silent_robot_that_stood_despite_its_path_is_reported_as_stopped() -> None:
    watch = Watch()
    for name, speed_mps in (("waits", 1.0), ("parks", 0.0)):
        for _ in range(4):
            watch.say(name, 0.0, 5.0 * speed_mps, speed_mps)
            watch.tick()
            watch.wait(1.0)
    watch.drive("drives", 0.0, 20.0)
    watch.wait(10.0)
    assert [uuid for change in watch.changes for uuid in change.stopped] == [robot("waits")]
    assert {uuid for change in watch.changes for uuid in change.silent} == {
        robot(n) for n in ("waits", "parks", "drives")
    }


def test_what_is_learned_outlives_a_restart() -> None:
    watch = Watch()
    leave(watch, 10)
    watch.wait(30.0)
    after = Watch(learned=unpacked(packed(learned_of(watch.presence.learners))))
    after.drive("next", DOOR_M - 6.0, seconds=6)
    after.wait(5.25)
    assert after.there("next") < 0.25
    assert after.presence.exits(NOW_S)


def test_a_silence_that_began_before_the_engine_counts_from_the_last_report() -> None:
    watch = Watch()
    watch.drive("A", 0.0)
    watch.now_s = 900.0
    watch.presence = Presence(watch.live, watch.measures)
    watch.tick(everything=True)
    watch.wait(0.25)
    assert watch.presence.silent_s(robot("A"), NOW_S + watch.now_s) == pytest.approx(895.0, abs=0.5)
    assert watch.there("A") < 0.8


def test_a_robot_that_is_forgotten_is_no_longer_silent() -> None:
    watch = Watch()
    watch.drive("A", 0.0)
    watch.wait(20.0)
    watch.now_s += 86_400.0
    watch.tick()
    assert watch.gone == [robot("A")]
    assert watch.presence.silent_s(robot("A"), NOW_S + watch.now_s) is None


class Counting(Presence):
    """Counts how often silent robots are checked."""

    checks = 0

    def _check_silent(self, uuid: str, silence: LastingSilence, robot: LiveRobot, now_s: float) -> None:
        self.checks += 1
        super()._check_silent(uuid, silence, robot, now_s)


def test_silent_robots_are_checked_less_and_less_often() -> None:
    watch = Watch()
    watch.presence = counting = Counting(watch.live, watch.measures)
    for number in range(3):
        watch.say(f"R{number}", 10.0 * number, speed_mps=1.0)
    watch.tick()
    watch.wait(600.0)
    assert [watch.there(f"R{number}") < 0.9 for number in range(3)] == [True] * 3
    first, counting.checks = counting.checks, 0
    watch.wait(600.0)
    assert 0 < counting.checks < 3 * 5
    assert first < 3 * 30


def test_vendors_are_those_of_their_robots() -> None:
    watch = Watch()
    watch.fleet.receive(identity("A", NOW_S, manufacturerName="Corvid"), NOW_S, LINE)
    watch.drive("A", 0.0)
    watch.wait(10.0)
    watch.say("A", 5.0)
    watch.tick()
    assert watch.measures.values["deconflict_silences_total"] == {("Corvid", "there"): 1}
