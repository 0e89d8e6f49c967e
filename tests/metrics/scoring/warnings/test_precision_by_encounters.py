from math import inf

import pytest

from metrics.scoring.warnings.precision_by_encounters import Alert, score
from metrics.truth.encounters import EncounterFinder, RecordedEncounter
from tests.metrics.truth.made_motion import driven, reported

PAIR = ("a", "b")


def encounter(start_s: float, end_s: float, foreseeable: bool = True) -> RecordedEncounter:
    return RecordedEncounter(PAIR, start_s, end_s, foreseeable)


def alert(
    raised_s: float, cleared_s: float, predicted_s: float = 0.0, left_s: float = inf, heeded: bool = False
) -> Alert:
    return Alert(PAIR, ("Alder", "Corvid"), raised_s, cleared_s, predicted_s, left_s, heeded=heeded)


def test_without_encounters_and_alerts_there_are_no_shares() -> None:
    figures = score([], [], 0.3)
    assert (figures["encounters"], figures["alerts"]) == (0, 0)
    assert figures["recall"] is figures["precision"] is figures["lead_time_s"] is None


def test_an_encounter_predicted_in_time_is_recalled() -> None:
    figures = score([encounter(20, 22)], [alert(14.2, 24, predicted_s=20.5)], 0.3)
    assert (figures["recall"], figures["recall_any"], figures["precision"]) == (1.0, 1.0, 1.0)
    assert figures["lead_time_s"]["median"] == 5.0
    assert figures["start_error_s"] == 0.5


def test_an_encounter_without_an_alert_is_a_recall_of_zero() -> None:
    figures = score([encounter(20, 22)], [], 0.3)
    assert (figures["recall"], figures["recall_any"]) == (0.0, 0.0)


def test_an_alert_that_was_cleared_too_early_counts_only_for_recall_any() -> None:
    figures = score([encounter(20, 22)], [alert(11, 15)], 0.3)
    assert (figures["recall"], figures["recall_any"], figures["precision"]) == (0.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("raised_s", "cleared_s", "recall", "recall_any", "precision", "lead_s"),
    [
        (19.1, 22.0, 0.0, 0.0, None, None),  # its first whole second is in the encounter
        (18.2, 18.9, 0.0, 0.0, 1.0, None),  # stood at no whole second
        (16.2, 17.3, 0.0, 1.0, 1.0, None),  # at 17 s, more than two before
        (17.2, 18.3, 1.0, 1.0, 1.0, 1.9),
        (18.9, 24.0, 1.0, 1.0, 1.0, 0.9),
    ],
)
def test_recall_uses_the_same_whole_seconds_as_precision(
    raised_s: float, cleared_s: float, recall: float, recall_any: float, precision: float | None, lead_s: float | None
) -> None:
    figures = score([encounter(19.9, 22)], [alert(raised_s, cleared_s)], 0.3)
    assert (figures["recall"], figures["recall_any"], figures["precision"]) == (recall, recall_any, precision)
    lead = figures["lead_time_s"]
    assert (lead and lead["median"]) == (lead_s and pytest.approx(lead_s))


def test_no_lead_time_is_negative() -> None:
    tenths = [start / 10 for start in range(200, 220)]
    for start_s in tenths:
        for raised_s in (number / 10 + 0.05 for number in range(170, 220)):
            lead = score([encounter(start_s, 24)], [alert(raised_s, 23)], 0.3)["lead_time_s"]
            assert lead is None or lead["median"] > 0


def test_between_two_encounters_an_alert_counts_from_where_the_first_ended() -> None:
    figures = score([encounter(10, 14.5, foreseeable=False), encounter(20, 22)], [alert(12.5, 24)], 0.3)
    assert (figures["recall"], figures["precision"], figures["lead_time_s"]["median"]) == (1.0, 1.0, 5.0)
    within = score([encounter(10, 18.6, foreseeable=False), encounter(20, 22)], [alert(17.2, 18.4)], 0.3)
    assert (within["recall"], within["alerts"]) == (0.0, 0)


def test_each_of_many_encounters_of_a_pair_is_recalled_by_its_own_alerts() -> None:
    starts_s = range(20, 1500, 15)
    encounters = [encounter(start_s, start_s + 2) for start_s in starts_s]
    alerts = [alert(start_s - 4.5, start_s + 2.5, predicted_s=start_s + 0.5) for start_s in starts_s[::3]]
    later = [alert(start_s - 3.5, start_s - 0.5, predicted_s=start_s + 3) for start_s in starts_s[::3]]
    alerts += [*later, *(alert(start_s - 12, start_s - 11.5) for start_s in starts_s[1::3])]
    figures = score(encounters, alerts, 0.3)
    cases = figures["cases"]
    assert cases["recalled"] == cases["recalled_any"] == ("ynn" * len(starts_s))[: len(starts_s)]
    assert (figures["lead_time_s"]["median"], figures["start_error_s"]) == (4.0, 0.5)
    assert cases["came_true"].count("y") == 2 * len(starts_s[::3])
    assert cases["came_true"].count("n") == len(starts_s[1::3])


def test_an_alert_that_nothing_follows_is_a_nuisance() -> None:
    figures = score([encounter(40, 42)], [alert(10, 14), alert(35, 43)], 0.3)
    assert figures["precision"] == 0.5


def test_an_alert_within_an_encounter_is_not_scored() -> None:
    figures = score([encounter(20, 30)], [alert(21, 25)], 0.3)
    assert (figures["alerts"], figures["censored"]) == (0, 0)


def test_an_alert_within_an_encounter_that_ends_as_a_robot_leaves_is_not_scored() -> None:
    figures = score([encounter(20, 22)], [alert(21, inf, predicted_s=21, left_s=22)], 0.3)
    assert (figures["alerts"], figures["censored"], figures["precision"]) == (0, 0, None)


def test_an_alert_without_an_event_is_a_nuisance_if_the_robot_left_after_the_predicted_time() -> None:
    figures = score([], [alert(10, inf, predicted_s=12, left_s=14)], 0.3)
    assert (figures["alerts"], figures["precision"]) == (1, 0.0)


def test_an_alert_whose_robot_left_before_the_predicted_start_is_censored() -> None:
    figures = score([], [alert(10, inf, predicted_s=18, left_s=12)], 0.3)
    assert (figures["alerts"], figures["censored"], figures["precision"]) == (0, 1, None)


def test_an_alert_whose_advice_was_followed_is_counted_separately() -> None:
    figures = score([encounter(40, 42)], [alert(10, 14, heeded=True), alert(35, 43, heeded=True)], 0.3)
    assert (figures["alerts"], figures["heeded"], figures["censored"], figures["precision"]) == (1, 1, 0, 1.0)


def test_unforeseeable_encounters_do_not_lower_recall() -> None:
    figures = score([encounter(20, 22), encounter(50, 52, foreseeable=False)], [alert(15, 24)], 0.3)
    assert (figures["encounters"], figures["foreseeable"], figures["recall"]) == (2, 1, 1.0)


def test_an_encounter_of_the_recorded_motion_has_its_start_and_end() -> None:
    (recorded,) = driven((0, 11.0, -1.0), (20, -9.0, -1.0), until_s=25).encounters(0.3)
    assert recorded.start_s == pytest.approx(9.8, abs=0.11)
    assert recorded.end_s == pytest.approx(12.2, abs=0.11)
    assert recorded.foreseeable


def test_a_pair_that_begins_together_was_not_foreseeable() -> None:
    (recorded,) = driven((0, 1.1, 0.5), until_s=10).encounters(0.3)
    assert not recorded.foreseeable


def test_a_small_separation_continues_an_encounter_and_a_large_one_ends_it() -> None:
    little = driven((0, 1.2, 0.0), (5, 1.35, 0.0), (9, 1.2, 0.0), until_s=15)
    assert len(little.encounters(0.3)) == 1
    far = driven((0, 1.2, 0.0), (5, 3.0, 0.0), (9, 1.2, 0.0), until_s=15)
    assert len(far.encounters(0.3)) == 2


def test_a_gap_in_the_reports_is_not_joined() -> None:
    truth = EncounterFinder([0.3], 0.1)
    for t_s in (0.0, 1.0, 4.0, 5.0):
        reported(truth, t_s, ("a", 0, 0.0), ("b", 0, 1.1))
    truth.finish()
    assert [encounter.start_s for encounter in truth.encounters(0.3)] == [
        pytest.approx(0.1),
        pytest.approx(4.1, abs=0.11),
    ]


def test_robots_on_different_floors_do_not_meet() -> None:
    truth = EncounterFinder([0.3], 0.1)
    for t_s in map(float, range(6)):
        reported(truth, t_s, ("a", 0, 0.0), ("b", 1, 0.0))
    truth.finish()
    assert truth.encounters(0.3) == []
