"""The demo's scene of standoffs in simulated time, with the adviser in this process."""

from collections import Counter

import numpy as np
import pytest

from deconflict.adviser import Adviser, Request
from deconflict.settings.site import Site
from deconflict.settings.site_file import fit_problems, load
from deconflict.simulation.demo.demo_site import demo_site
from deconflict.simulation.demo.standoff_floor import OFF, ORDER, Saved, StandoffFloor, paired
from deconflict.simulation.demo.standoff_hall import standoff_site
from deconflict.simulation.driving.protection import gaps
from deconflict.simulation.robot_state import robot_states
from deconflict.simulation.vendors.dialects import DIALECTS, GROUND_ID
from deconflict_client.advisory import ClearedCode, Location, moment
from deconflict_client.advisory.robot_advice import RobotAdvice
from ingest.batch import Floats
from tests.helpers.made_advisories import START, made_advice

ROBOTS, TURNS, LOOK_STEPS = 40, 8, 10


def scene_site() -> Site:
    return standoff_site(load(demo_site()), ROBOTS)


class AdvisedScene:
    """The scene's robots, who hear an adviser once a second, or none."""

    def __init__(self, adviser: Adviser | None, seed: int) -> None:
        self.floor = StandoffFloor(ROBOTS, seed)
        self.floor.begin()
        self._adviser = adviser
        self._open: dict[str, RobotAdvice] = {}
        self.answers = Counter[tuple[str, str]]()
        self.overlaps = 0

    def drive(self, turns: int) -> None:
        step = 0
        while len(self.floor.turns.turns) < turns:
            if self._adviser and step % LOOK_STEPS == 0:
                self._advise(self._adviser, is_first=step == 0)
            self.floor.step()
            step += 1
            if step % LOOK_STEPS == 0:
                self.overlaps += overlapping(self.floor.world.envelopes())

    def _advise(self, adviser: Adviser, *, is_first: bool) -> None:
        world = self.floor.world
        now_s, messages = START.timestamp() + world.t_s, []
        for robot in robot_states(world, np.arange(len(world))):
            dialect = DIALECTS[robot.member.make.vendor]
            messages += [dialect.identity(robot, now_s)] if is_first else []
            messages.append(dialect.status(robot, now_s))
        for request in adviser.hear(now_s, messages):
            self._pass_on(request, now_s)
        for answer in self.floor.take_answers():
            self.answers[answer.answer, answer.why] += 1
            adviser.answer(*answer)

    def _pass_on(self, request: Request, now_s: float) -> None:
        if request.withdrawn:
            if asked := self._open.pop(request.id, None):
                self.floor.pass_on(asked.cleared_revision(now_s, ClearedCode.WITHDRAWN), now_s)
            return
        self._open[request.id] = made_advice(
            int(request.id),
            id=request.id,
            robot=request.robot,
            verb=request.verb,
            other=request.other,
            side=request.side,
            robots=tuple(sorted((request.robot, request.other or ""))),
            place=Location(datum=GROUND_ID, x=request.at[0], y=request.at[1]) if request.at else None,
            raised_at=moment(now_s),
            latest_at=moment(request.latest_s),
        )
        self.floor.pass_on(self._open[request.id], now_s)


def overlapping(bodies: Floats) -> int:
    """How many pairs of bodies (n, 5) overlap."""
    a, b = np.triu_indices(len(bodies), 1)
    first, second = bodies[a].T, bodies[b].T
    return int((gaps(first[:3], second[:3], (first[3], first[4]), (second[3], second[4])) < 0.0).sum())


def saved(scene: AdvisedScene, name: str) -> Saved:
    found = scene.floor.turns.saved(name)
    assert found
    return found


def test_advice_that_ends_standoffs_saves_time_and_bodies_never_overlap() -> None:
    adviser = Adviser(scene_site())
    scene = AdvisedScene(adviser, 1)
    scene.drive(TURNS)
    stood, driven = saved(scene, "stood_share"), saved(scene, "driven_mps")
    assert stood.pairs == TURNS // 2
    assert stood.interval
    assert stood.interval[1] < 0.0, "robots stand less with advice"
    assert driven.difference > 0.0
    assert adviser.refused == scene.overlaps == 0
    assert scene.answers["accepted", ""] > 0
    for vendor in scene.floor.turns.vendors:
        of_vendor = scene.floor.turns.saved("stood_share_of", vendor)
        assert of_vendor
        assert of_vendor.difference < 0.0, f"{vendor} is better off"
    assert scene.answers["declined", OFF] > 0


def test_without_an_adviser_the_two_kinds_of_turns_do_not_differ() -> None:
    scene = AdvisedScene(None, 1)
    scene.drive(TURNS)
    for name in ("stood_share", "driven_mps"):
        found = saved(scene, name)
        assert found.interval
        assert found.interval[0] < 0.0 < found.interval[1]
    assert not scene.answers


def test_the_site_of_the_scene_is_sound_and_drawn() -> None:
    site = scene_site()
    assert fit_problems(site) == []
    assert Site.model_validate(site.model_dump()) == site
    assert [datum.id for datum in site.datums] == [GROUND_ID]
    assert sum(part.kind == "rack" for part in site.obstacles) > 4


def test_the_interval_is_students() -> None:
    assert paired(np.array([0.1])) == (0.1, None)
    mean, interval = paired(np.array([1.0, 2.0, 3.0]))
    assert interval
    assert (mean, *interval) == pytest.approx((2.0, 2.0 - 4.303 / 3**0.5, 2.0 + 4.303 / 3**0.5), abs=1e-3)


def test_turns_are_on_and_off_as_ordered_and_are_named() -> None:
    floor = StandoffFloor(3, 1)
    assert "no advice yet" in floor.sentence()
    floor.begin()
    seen = []
    while len(floor.turns.turns) < len(ORDER):
        floor.step()
        seen.append(floor.turns.is_on)
    assert [turn.advice for turn in floor.turns.turns] == list(ORDER)
    assert "over 2 pairs of turns" in floor.sentence()
    assert len(floor.report()) == len(ORDER) + len(floor.turns.vendors) + 1
    assert floor.result()["advice"]["driven_mps"]["pairs"] == 2


def test_what_each_vendor_yielded_is_said() -> None:
    """Who goes around yields, and who lets another go first. What was not done counts for nobody."""
    floor = StandoffFloor(3, 1)
    first, second, *_ = floor.turns.vendors
    begun = {"vendor": first, "vendors": (first, second), "begun_at": START}
    for number, verb, code, seconds in (
        (1, "go_around", ClearedCode.DONE, 5.0),
        (2, "go_first", ClearedCode.DONE, 3.0),
        (3, "go_around", ClearedCode.WITHDRAWN, 9.0),
    ):
        asked = made_advice(number, verb=verb, **begun)
        floor.pass_on(asked.cleared_revision(START.timestamp() + seconds, code), 0.0)
    assert [floor.yielded_s[first], floor.yielded_s[second]] == [5.0, 3.0]
    assert floor.result()["advice"]["yielded_s"][first] == 5.0
