"""Advice that must end although the engine can't go on asking: robots may be waiting for its end."""

from pathlib import Path

import pytest

from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.adviser.standoff_advice import StandoffAdvice
from deconflict.engine.load_shedding import Effort
from deconflict.roles.engine_role import EngineRole
from deconflict_client.advisory.robot_advice import RobotAdvice
from tests.deconflict.contention.scenes import NOW_S, Scene, standoff


def asked_of_a_robot() -> tuple[Scene, RobotAdvice, float]:
    """A scene, what is asked in it, and the time."""
    scene, second = standoff(0), 0
    while not scene.asked and second < 30:
        scene.run(second + 1, from_s=second)
        second += 1
    return scene, scene.asked[0], NOW_S + second


def test_all_is_withdrawn_while_the_engine_cannot_keep_up() -> None:
    scene, advice, now_s = asked_of_a_robot()
    ended = scene.engine.withdraw_advice(now_s)
    assert (advice.id, "withdrawn") in {(each.id, each.cleared_code) for each in ended}
    assert not scene.engine.withdraw_advice(now_s + 1)


def test_the_role_of_an_engine_that_cannot_keep_up_publishes_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, advice, now_s = asked_of_a_robot()
    role, published = EngineRole(scene.site, tmp_path), list[RobotAdvice]()
    monkeypatch.setattr(role._load, "effort", Effort.NEAR)
    monkeypatch.setattr(role._delivery, "add_advice", published.extend)
    role._advise(scene.engine, now_s)
    assert (advice.id, "withdrawn") in {(each.id, each.cleared_code) for each in published}


def test_what_is_open_when_the_adviser_fails_is_ended_once(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, advice, now_s = asked_of_a_robot()

    def fails(*_: object) -> None:
        scene.engine._shared.asked.standoffs.end_all()  # as if it had ended requests before it failed
        raise KeyError("robot")

    with monkeypatch.context() as patched:
        patched.setattr(StandoffAdvice, "step", fails)
        with pytest.raises(KeyError):
            scene.engine.advise(now_s + 1)
        ended = scene.engine.withdraw_advice(now_s + 1)
    assert (advice.id, advice.revision + 1) in {(each.id, each.revision) for each in ended}
    assert not scene.engine.withdraw_advice(now_s + 2)


def test_accepted_and_then_declined_is_no_decline() -> None:
    scene, advice, now_s = asked_of_a_robot()
    given = [AnsweredAdvice(advice.id, answer, "") for answer in ("accepted", "done", "declined")]
    codes = {each.id: each.cleared_code for each in scene.engine.advise(now_s + 1, given)}
    assert codes[advice.id] == "done"
