"""What refusing advice costs other robots, as it is booked."""

from contextlib import closing
from pathlib import Path

import pytest

from deconflict.adviser import advice_lifecycle
from deconflict.operator.ledger.loss_ledger import LedgerEntry, LossLedger, refusal_entries
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.roles.engine_role import EngineRole
from deconflict.settings.site import DEFAULT, LossSettings
from deconflict_client.advisory.robot_advice import RobotAdvice
from ingest.batch import Batch
from tests.deconflict.adviser.advised_floor import AdvisedFloor, Reply, forward
from tests.deconflict.adviser.floors import START_S, Robot, before_crossing, face_to_face


def moves_on(robot: Robot, _: RobotAdvice, since_s: float) -> None:
    """After 3 s, as if the other were not there."""
    if since_s >= 3.0:
        forward(robot, 1.0)


AROUND = Reply("accepted", moves=moves_on)


def booked(floor: AdvisedFloor) -> list[tuple[str, bool, float, dict[str, float]]]:
    """Of each refusal that is over: who refused, whether it cannot, when, and how long which others stood."""
    return [
        (
            floor.names[refusal.robot],
            refusal.is_unable,
            refusal.since_s - START_S,
            {floor.names[other.robot]: other.stood_s for other in refusal.others},
        )
        for refusal in floor.refusals
    ]


def first_refuses(reply: Reply, *behind: Robot) -> AdvisedFloor:
    """Two face each other. The first that is asked refuses, the other one obeys."""

    def answered(advice: RobotAdvice) -> Reply:
        return reply if advice.robot == floor.robots[0].uuid else AROUND

    floor = AdvisedFloor([*face_to_face(), *behind], answered)
    return floor.run(30)


def queued() -> Robot:
    """It stands behind the second of two that face each other."""
    return Robot("b", "Pine", 3.2, 0.0, face_to_face()[1].yaw_rad)


@pytest.mark.parametrize(
    ("reply", "is_unable", "since_s"),
    [
        (Reply("declined", "cannot: no room to turn"), True, 3.0),
        (Reply("declined", "busy"), False, 3.0),
        (Reply("declined", "no room"), False, 3.0),
        (Reply(), False, 5.0),
        (Reply("done"), False, 3.0),
        (Reply("accepted"), False, 7.0),
    ],
    ids=["cannot", "busy", "another reason", "silence", "done where it stands", "accepted and not begun"],
)
def test_what_the_other_stands_until_it_moves_is_booked_at_who_refused(
    reply: Reply, is_unable: bool, since_s: float
) -> None:
    assert booked(first_refuses(reply)) == [("l", is_unable, since_s, {"r": 2.0})]


def test_who_obeys_has_refused_nothing() -> None:
    floor = AdvisedFloor(list(face_to_face()), lambda _: AROUND).run(30)
    assert [advice.cleared_code for advice in floor.revisions if advice.cleared_code] == ["done"]
    assert floor.refusals == []


def test_who_begins_and_stands_again_has_not_refused() -> None:
    half = Reply("accepted", moves=lambda robot, _, since_s: forward(robot, 0.2 if since_s == 1.0 else 0.0))
    floor = AdvisedFloor(list(face_to_face()), lambda _: half).run(7)
    assert [advice.cleared_code for advice in floor.revisions if advice.cleared_code] == ["withdrawn"]
    assert floor.run(4).refusals == []


def test_those_behind_are_held_up_too_and_of_one_that_stands_alone_nobody_is() -> None:
    (refused,) = booked(first_refuses(Reply("declined", "busy"), queued()))[:1]
    assert refused == ("l", False, 3.0, {"r": 2.0, "b": 2.0})
    parked = AdvisedFloor([face_to_face()[0], Robot("p", "Pine", 1.6, 0.0, 0.0, means_to_go=False)]).run(30)
    assert {stood_s for *_, others in booked(parked) for stood_s in others.values()} == {0.0}


def test_of_a_long_queue_only_the_first_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(advice_lifecycle, "MOST_HELD_UP", 1)
    assert booked(first_refuses(Reply("declined", "busy"), queued()))[0] == ("l", False, 3.0, {"r": 2.0})


def test_what_is_refused_again_is_booked_once() -> None:
    floor = AdvisedFloor(list(face_to_face()), lambda _: Reply("declined", "busy")).run(28)
    of_left = [(since_s, others["r"]) for name, _, since_s, others in booked(floor) if name == "l"]
    assert of_left == [(3.0, 4.0), (7.0, 7.0), (14.0, 13.0)]


def test_a_standoff_that_dissolves_by_itself_costs_until_then() -> None:
    floor = AdvisedFloor(list(face_to_face()), lambda _: Reply("declined", "cannot")).run(6)
    floor.robots[1].y_m += 6.0
    assert booked(floor.run(2)) == [("l", True, 3.0, {"r": 3.0}), ("r", True, 4.0, {"l": 2.0})]


def test_who_declines_to_wait_has_refused_and_not_who_was_to_go_first() -> None:
    refuses = {"go_first": Reply("accepted"), "wait_before": Reply("declined", "busy")}
    floor = AdvisedFloor(list(before_crossing()), lambda advice: refuses[advice.verb]).run(12)
    floor.robots[0].y_m += 20.0
    assert [(name, others) for name, _, _, others in booked(floor.run(2))] == [("n", {"e": 2.0}), ("e", {"n": 1.0})]


def test_advice_that_is_not_needed_any_more_was_not_refused() -> None:
    floor = AdvisedFloor(list(face_to_face())).run(3)
    floor.robots[1].y_m += 6.0
    assert [advice.cleared_code for advice in floor.run(4).revisions] == [None, "withdrawn"]
    overloaded = AdvisedFloor(list(face_to_face())).run(3)
    overloaded.engine.withdraw_advice(overloaded.now_s)
    overloaded.robots.pop()
    assert (floor.refusals, overloaded.run(2).refusals) == ([], [])


def test_both_kinds_of_refusals_are_summed_by_vendor_beside_lost_time_and_count_once() -> None:
    unable, busy = (first_refuses(Reply("declined", why), queued()).refusals[:1] for why in ("cannot", "busy"))
    with closing(LossLedger(None, LossSettings())) as ledger:
        ledger.add("engine", 1, refusal_entries([*unable, *busy, *busy]))
        (row,) = ledger.ask(LossQuestion(START_S, START_S + 3600.0, ("by",))).rows
        models = ledger.ask(LossQuestion(START_S, START_S + 3600.0, ("vendor", "model", "kind"))).rows
    assert row.model_dump()["by"] == "Larch"
    assert (row.refusals, row.refused_s, row.unable, row.unable_s) == (2, 8.0, 1, 4.0)
    assert (row.lost_s, row.losses) == (0.0, 0)
    assert {(row["vendor"], row["model"], row["kind"]) for row in map(dict, models)} == {
        ("Rowan", "Q", "deadlock"),
        ("Pine", "Q", "queue"),
    }
    measures = first_refuses(Reply("declined", "busy"), queued()).engine.measures.values
    assert measures["deconflict_advice_refused_total"]["Larch", "unwilling"] == 1
    assert measures["deconflict_advice_refused_seconds_total"]["Larch", "unwilling"] == 4.0


def test_the_engine_role_delivers_refusals_to_the_ledger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    floor, delivered = first_refuses(Reply("declined", "busy")), list[LedgerEntry]()
    role = EngineRole(DEFAULT, tmp_path)
    monkeypatch.setattr(role._delivery, "add_pass", lambda *given: delivered.extend(given[-1]))
    floor.engine.refusals = floor.refusals
    batch = Batch.from_bytes(floor.fleet.next_batch(floor.now_s + 1).to_bytes())
    role._run_pass(floor.engine, batch, 0, {}, timed=False)
    assert [(entry.by_vendor, entry.refused_s) for entry in delivered] == [("Larch", 2.0)]
