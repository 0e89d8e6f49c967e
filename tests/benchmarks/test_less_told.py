import json
from collections.abc import Iterator
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.less_told import __main__ as command
from benchmarks.less_told import fields
from benchmarks.less_told.drives import Style, driven
from benchmarks.less_told.fields import FIELDS, Comparison, Fields, comparisons, variants
from benchmarks.less_told.findings import HOLDS, MORE_VAIN, Finding
from benchmarks.less_told.languages.sending import Sent
from benchmarks.less_told.scenes import KINDS, SECONDS, Scene, drawn_scene, motion_of
from benchmarks.less_told.scoring import LANGUAGES, SceneFloor, SceneScore
from benchmarks.planned_floors.truth.encounters import encounters
from ingest.languages.front_ends import FRONT_ENDS
from ingest.languages.model import Rejection

STYLE = Style(limit_mps=2.0, pace_mps=1.0, acceleration_mps2=1.0, turn_radps=pi / 4)


def test_a_drive_stops_and_turns_at_its_corners() -> None:
    drive = driven([(0.0, 0.0), (4.0, 0.0), (8.0, 0.0), (8.0, 4.0)], STYLE, 5.0, 40.0, last_yaw_rad=pi)
    assert drive.node_s == pytest.approx((5.0, 9.5, 16.0, 23.0), abs=0.2)
    assert drive.node_yaw_rad == (None, None, pi / 2, pi)
    assert drive.ends_s == pytest.approx(23.0, abs=0.1)
    assert drive.at(np.array([0.0, 12.0, 30.0]))[:, :2].tolist() == pytest.approx(
        np.array([[0, 0], [6.5, 0], [8, 4]]), abs=0.7
    )
    assert drive.motion_at(10.0) == pytest.approx((1.0, 0.0), abs=0.01)
    assert drive.motion_at(15.0) == pytest.approx((0.0, pi / 4), abs=0.01)


def test_a_hurried_path_is_ahead_of_the_drive() -> None:
    drive = driven([(0.0, 0.0), (20.0, 0.0)], STYLE, 5.0, 60.0)
    assert drive.hurried(10.0, np.array([2.0]), 2.0)[0, 0] == pytest.approx(drive.at(np.array(14.0))[0])
    assert drive.hurried(3.0, np.array([1.0, 4.0]), 2.0)[:, 0] == pytest.approx(drive.at(np.array([4.0, 9.0]))[:, 0])


def test_scenes_of_a_seed_are_the_same_and_many_robots_meet() -> None:
    scenes = [drawn_scene(seed) for seed in range(70)]
    assert {scene.kind for scene in scenes} == set(KINDS)
    assert (drawn_scene(3).robots[0].drive.poses == scenes[3].robots[0].drive.poses).all()
    met = dict.fromkeys(KINDS, 0)
    for scene in scenes:
        met[scene.kind] += len(encounters(motion_of(list(scene.robots), ["a", "b"], 0.0), 0.3))
        for robot in scene.robots:
            assert len(robot.drive.poses) == SECONDS * 10 + 1
            assert robot.drive.ends_s < SECONDS
    assert min(met.values()) >= 2
    assert sum(met.values()) < 50


def read(scene: Scene, language: str, fields: Fields) -> Iterator[Any]:
    """What a front end reads of the messages of a scene's first robot."""
    front_end, memory = FRONT_ENDS[language], None
    sent: list[Sent] = sorted(LANGUAGES[language].messages(scene.robots[0], fields), key=lambda each: each.arrival_s)
    for _, received in sent:
        message, memory = front_end.read(received.raw, received.connection.topic, memory, None)
        yield message


@pytest.mark.parametrize("language", FIELDS)
def test_messages_with_all_fields_deviate_in_nothing(language: str) -> None:
    for seed in range(len(KINDS)):
        for message in read(drawn_scene(seed), language, frozenset(FIELDS[language])):
            assert not isinstance(message, Rejection)
            findings = set(getattr(message, "findings", ()))
            assert findings <= {"path-past", "key-absent", "key-unknown"}, findings


@pytest.mark.parametrize("language", FIELDS)
def test_a_field_that_is_left_out_is_not_sent(language: str) -> None:
    scene, every = drawn_scene(1), frozenset(FIELDS[language])

    def size(fields: Fields) -> int:
        return sum(len(each.message.raw) for each in LANGUAGES[language].messages(scene.robots[0], fields))

    for field in every - {"node_theta", "horizon"}:
        assert size(every - {field}) < size(every), field


@pytest.mark.parametrize("language", FIELDS)
def test_both_sides_of_each_comparison_differ_in_the_field_alone(language: str) -> None:
    found = list(comparisons(language))
    assert {comparison.field for comparison in found} == set(FIELDS[language])
    for field, beside, having, lacking in found:
        assert field in having - lacking
        assert lacking < having
        dependent = {other for other, needs in FIELDS[language].items() if field in needs}
        assert having - lacking <= {field} | dependent
        assert beside == "all" or having - lacking == {field} or dependent
        assert {having, lacking} <= set(variants(language))


@pytest.mark.parametrize("language", FIELDS)
def test_robots_that_report_all_are_warned_of(language: str) -> None:
    crossings = [drawn_scene(seed) for seed in range(0, 105, len(KINDS))]
    punctual = [scene for scene in crossings if not any(robot.is_hurried for robot in scene.robots)]
    scores = SceneFloor(punctual, language).scores(frozenset(FIELDS[language]))
    assert sum(score.outcomes for score in scores) >= 2
    assert sum(score.told_2s for score in scores) == sum(score.outcomes for score in scores)


def finding(having: list[tuple[int, int, int]], lacking: list[tuple[int, int, int]]) -> Finding:
    """Of scenes with one outcome: of each, outcomes that were told of, alerts, and alerts in vain."""
    rows = [
        np.array([SceneScore(1, told_of, told_of, alerts, in_vain, 60.0) for told_of, alerts, in_vain in scores], float)
        for scores in (having, lacking)
    ]
    comparison = Comparison("path", "all", frozenset({"path"}), frozenset())
    return Finding(comparison, [drawn_scene(seed) for seed in range(len(having))], rows[0], rows[1])


def test_a_field_is_worse_if_fewer_are_told_of_or_there_are_more_alerts() -> None:
    told_of, missed, vain = (1, 1, 0), (0, 0, 0), (1, 2, 1)
    assert finding([told_of] * 100, [told_of] * 100).verdict == HOLDS
    assert finding([told_of] * 98 + [missed] * 2, [told_of] * 100).verdict == HOLDS
    worse = finding([told_of] * 97 + [missed] * 3, [told_of] * 100)
    assert worse.verdict == "fewer told"
    assert any("97" in line for line in worse.worse_classes())
    assert finding([told_of] * 2, [told_of, missed]).verdict == "more alerts, none in vain"
    assert finding([told_of, vain], [told_of] * 2).verdict == MORE_VAIN


def test_the_command_prints_and_writes_all_comparisons(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fields, "FIELDS", {"iso21423": {"velocity": (), "angular": ("velocity",), "trajectory": ()}})
    out = tmp_path / "out.json"
    command.main(["--languages", "iso21423", "--seeds", "1", "--json", str(out)])
    assert len(json.loads(out.read_text())["iso21423"]) == len(list(comparisons("iso21423")))
    assert "comparisons hold" in capsys.readouterr().out
