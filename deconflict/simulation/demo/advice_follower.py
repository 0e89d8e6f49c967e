"""A site service of the demo's floor: it passes advice on, of situations and single robots or of every advisory."""

from collections import Counter, defaultdict
from collections.abc import Mapping
from enum import StrEnum
from math import inf

from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.simulation.driving.motion import Activity, MovingRobots
from deconflict_client.advisory import Action, AdvisoryState, Hold, Recommendation
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import AnyRevision, Situation, SituationAdvice

STALE_S = 1.5
"""Advice may be based on reports this much older than the advice."""

NOTHING_TO_DO = frozenset(("go_first", "look"))
"""Actions for which a robot changes nothing."""


class Follow(StrEnum):
    """Whose advice is followed."""

    NONE = "none"
    ADVISORIES = "advisories"
    """Holds and slots of every advisory."""
    REQUESTS = "requests"
    """What is asked of single robots, which answer it."""
    SITUATIONS = "situations"
    """The actions of situations, and what is asked of single robots, which answer it."""


class Follower:
    """Passes advice on to the robots of a world."""

    def __init__(self, world: MovingRobots, rows: Mapping[str, int], follow: Follow) -> None:
        """`rows` has the row of each robot by UUID."""
        self._world, self._row, self._follow = world, rows, follow
        self._instructed_s: dict[str, float] = {}
        """By robot, when it was told something last, in the world's time."""
        self._held: dict[str, tuple[Hold, ...]] = {}
        """By advisory: the holds that were passed on last."""
        self._slowed = defaultdict[str, list[int]](list)
        """By situation: the robots that were told to drive slowly by the advice that stands."""
        self._done: set[tuple[str, str]] = set()
        """By advisory and robot, or by situation and since when its advice stands: what was passed on."""
        self._answers: list[AnsweredAdvice] = []
        self.declines = ""
        """The reason with which all that is asked of single robots is declined; empty if they do what they can."""
        self.counts = Counter[str]()
        """What was passed on, and what was left out because the robot had been told something else meanwhile, was not
        driving, or can't do it."""

    def pass_on(self, revision: AnyRevision, now_s: float) -> None:
        """Pass on the advice of one revision. `now_s` is the clock by which revisions are dated."""
        at_s = self._world.t_s - (now_s - revision.updated_at.timestamp())
        if isinstance(revision, RobotAdvice):
            if self._follow in (Follow.REQUESTS, Follow.SITUATIONS):
                self._pass_on_request(revision)
        elif isinstance(revision, Situation):
            if self._follow is Follow.SITUATIONS:
                self._pass_on_actions(revision.id, revision.advice, at_s)
        elif self._follow is Follow.ADVISORIES and revision.recommendation:
            self._pass_on_waits(revision.id, revision.recommendation, at_s)

    def take_answers(self) -> list[AnsweredAdvice]:
        """What robots have answered since the last call."""
        answers, self._answers = self._answers, []
        return answers

    def _pass_on_request(self, advice: RobotAdvice) -> None:
        """Have a robot do what is asked of it, and answer. A robot that waits goes on once that has ended."""
        row, now_s = self._row.get(advice.robot.lower()), self._world.t_s
        if row is None or advice.acknowledgement or advice.begun_at:
            return
        if advice.state is AdvisoryState.CLEARED:
            if advice.verb == "wait_before" and self._world.instructions.waits(row, now_s):
                self._world.instructions.slow_down(row, inf, 0.0, now_s)
            return
        why = self.declines or self._refusal(advice, row)
        self.counts[why or advice.verb] += 1
        self._answers.append(AnsweredAdvice(advice.id, "declined" if why else "accepted", why))

    def _refusal(self, advice: RobotAdvice, row: int) -> str:
        """Have a robot begin what is asked of it. Why it can't; empty if it does."""
        other = self._row.get((advice.other or "").lower())
        if self._world.doing[row] != Activity.DRIVING:
            return "busy"
        match advice.verb:
            case "go_first":
                return ""
            case "wait_before":
                seconds = (advice.latest_at - advice.raised_at).total_seconds()
                self._world.instructions.wait(row, seconds, self._world.t_s)
                return ""
            case "back_out":
                return self._back_out(advice, row)
            case "go_around" if other is not None:
                return "" if self._world.go_around(row, other, advice.side) else "no room"
        return "cannot"

    def _back_out(self, advice: RobotAdvice, row: int) -> str:
        if advice.place:
            return "" if self._world.back_out(row, (advice.place.x, advice.place.y)) else "no way back"
        self._world.back_off(row)
        return ""

    def _pass_on_actions(self, situation_id: str, advice: SituationAdvice | None, at_s: float) -> None:
        """Pass on new advice. Robots that drive slowly by the advice before may drive as usual."""
        key = (situation_id, advice.since_at.isoformat() if advice else "")
        if key in self._done:
            return
        for row in self._slowed.pop(situation_id, ()):
            self._world.instructions.slow_down(row, inf, 0.0, self._world.t_s)
        if advice:
            self._done.add(key)
            for action in advice.actions:
                self._act(situation_id, action, at_s)

    def _pass_on_waits(self, advisory_id: str, advice: Recommendation, at_s: float) -> None:
        held, self._held[advisory_id] = self._held.get(advisory_id, ()), advice.holds
        for hold in advice.holds if held != advice.holds else ():
            self._wait(hold.robot, hold.hold_s, at_s)
        for slot in advice.slots:
            key = (advisory_id, slot.robot)
            if slot.wait_s > 0 and key not in self._done:
                self._done.add(key)
                self._wait(slot.robot, slot.wait_s, at_s)

    def _act(self, situation_id: str, action: Action, at_s: float) -> None:
        if action.action in NOTHING_TO_DO or (row := self._free_row(action.robot, at_s)) is None:
            return
        now_s = self._world.t_s
        match action.action:
            case "wait":
                self._world.instructions.wait(row, action.seconds or 0.0, now_s)
            case "slow_down":
                self._world.instructions.slow_down(row, action.speed_mps or inf, action.seconds or inf, now_s)
                self._slowed[situation_id].append(row)
            case "back_out":
                self._world.back_off(row)
            case _:
                self.counts[f"cannot {action.action}"] += 1
                return
        self.counts[action.action] += 1
        self._instructed_s[action.robot] = now_s

    def _wait(self, robot: str, seconds: float, at_s: float) -> None:
        row = self._free_row(robot, at_s)
        if row is not None:
            self._world.instructions.wait(row, seconds, self._world.t_s)
            self.counts["wait"] += 1
            self._instructed_s[robot] = self._world.t_s

    def _free_row(self, robot: str, at_s: float) -> int | None:
        """The row of a robot that can be told something: its plan is the one on which advice of `at_s` is based."""
        row = self._row.get(robot.lower())
        if row is None:
            self.counts["not of the halls"] += 1
        elif self._world.doing[row] != Activity.DRIVING:
            self.counts["not driving"] += 1
        elif at_s - STALE_S < self._instructed_s.get(robot, -STALE_S):
            self.counts["told meanwhile"] += 1
        else:
            return row
        return None
