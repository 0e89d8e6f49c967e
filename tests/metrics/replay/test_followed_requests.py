"""What robots do as they were asked teaches nothing and is judged as heeded, live and in the replay of a log."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deconflict.engine.engine import Engine
from deconflict.settings.site import DEFAULT
from deconflict_client.advisory import AdviceAnswer
from ingest.measures.measures import Measures
from ingest.recording.log_reader import LogReader, Tick
from ingest.recording.recorder import Recorder
from metrics.replay.recorded_passes import EnginePass, PassReader
from metrics.replay.replay import replay
from tests.deconflict.adviser.advised_floor import NO_ROOM, OBEYS, SILENT, UNBEGUN, AdvisedFloor, Reply, obeys
from tests.deconflict.adviser.floors import START_S, face_to_face

ACCEPTED: AdviceAnswer = "accepted"
LATE = Reply(ACCEPTED, moves=lambda robot, advice, since_s: obeys(robot, advice, since_s - 3.0))
"""An engine that hears no answers has asked the other robot by then."""


def recorded(log: Path, reply: Reply) -> AdvisedFloor:
    """Two robots face each other, of which one drives around the other if it does what it is asked."""
    recorder = Recorder(DEFAULT.recorder, log, Measures(), lambda: START_S)
    floor = AdvisedFloor(list(face_to_face()), lambda _: reply, recorder=recorder).run(40)
    recorder.close()
    return floor


def passes(log: Path) -> list[EnginePass]:
    return list(PassReader(DEFAULT).passes_of(LogReader().read([log])))


def replayed(engine_passes: list[EnginePass]) -> Engine:
    """An engine that hears no answers."""
    engine = Engine(DEFAULT)
    for each in engine_passes:
        engine.receive(each.batch)
        engine.step(each.now_s, each.effort, each.pending, each.is_own_log, each.followed)
        engine.advise(each.now_s)
    return engine


def taught(engine: Engine) -> tuple[dict[tuple[str, ...], float], list[float]]:
    """The outcomes that the model of warnings took in, and what it believes."""
    outcomes = engine.foresight.measures.values["deconflict_probability_outcomes_total"]
    return dict(outcomes), engine.foresight.learning.calibration.of_all.weights.tolist()


def scores(log: Path) -> dict[str, Any]:
    reader = LogReader()
    figures: dict[str, Any] = replay(reader, reader.read([log]), DEFAULT, [DEFAULT.conflict.clearance_m])["scores"][0]
    return figures


@pytest.mark.parametrize("reply", [OBEYS, LATE], ids=["at once", "late"])
def test_a_conflict_that_a_followed_request_ended_teaches_nothing_live_and_in_replay(
    reply: Reply, tmp_path: Path
) -> None:
    live = recorded(tmp_path, reply).engine
    engine_passes = passes(tmp_path)
    assert taught(replayed(engine_passes)) == taught(live)
    (outcomes, weights), (all_outcomes, others) = (
        taught(live),
        taught(replayed([replace(each, followed=()) for each in engine_passes])),
    )
    assert all_outcomes["passed",] >= outcomes["passed",] + 5
    assert np.abs(np.subtract(weights, others)).max() > 0.05


def test_a_robot_follows_from_when_it_has_visibly_begun_until_its_request_ends(tmp_path: Path) -> None:
    raised, begun, cleared = recorded(tmp_path, OBEYS).revisions
    assert begun.begun_at
    assert begun.begun_at > raised.raised_at
    ticks = [event for event in LogReader().read([tmp_path]) if isinstance(event, Tick)]
    followed = {tick.now_s: tick.followed for tick in ticks if tick.followed}
    assert set(followed.values()) == {((raised.robot, raised.other),)}
    looks_s = [begun.begun_at.timestamp(), cleared.updated_at.timestamp()]
    assert [min(followed) - 1.0, max(followed) - 1.0] == looks_s, "the next pass has what was found at a look"


@pytest.mark.parametrize("reply", [NO_ROOM, SILENT, UNBEGUN], ids=["declined", "silent", "accepted and not begun"])
def test_what_was_not_visibly_begun_is_judged_and_learned_as_before(reply: Reply, tmp_path: Path) -> None:
    live = recorded(tmp_path, reply).engine
    assert not any(each.followed for each in passes(tmp_path))
    outcomes, _ = taught(live)
    assert outcomes["passed",] > 20
    assert not outcomes["left",]
    figures = scores(tmp_path)
    assert (figures["warnings"]["in_vain"], figures["warnings"]["heeded"]) == (1, 0)


def test_a_warning_whose_conflict_a_followed_request_ended_is_heeded_in_a_log_of_the_service(tmp_path: Path) -> None:
    recorded(tmp_path, OBEYS)
    figures = scores(tmp_path)
    warnings = figures["warnings"]
    assert (warnings["alerts"], warnings["in_vain"], warnings["heeded"]) == (1, 0, 1)
    assert figures["heeded"] == 1
    assert min(figures["heeded_samples"], warnings["probability"]["heeded_samples"]) > 5


@pytest.mark.parametrize("heard", [True, False])
def test_robots_of_a_log_that_another_service_recorded_follow_nothing(heard: bool, tmp_path: Path) -> None:
    recorded(tmp_path, OBEYS)
    engine, following = Engine(DEFAULT), []
    for each in passes(tmp_path):
        engine.receive(each.batch)
        engine.step(each.now_s, heard=heard)
        engine.advise(each.now_s)
        following += engine.foresight.following_advice(each.now_s)
    assert bool(following) is heard
