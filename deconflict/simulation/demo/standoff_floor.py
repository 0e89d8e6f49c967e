"""The demo's robots that stand for each other, with advice on and off in turns, and what it saves."""

from collections.abc import Iterator
from typing import Any

from deconflict.simulation.demo.advice_follower import Follow
from deconflict.simulation.demo.advice_turns import AdviceTurns, Saved
from deconflict.simulation.demo.demo_floor import FollowingFloor
from deconflict.simulation.demo.standoff_hall import StandoffWorld
from deconflict.simulation.scripted_annex import Annex
from deconflict.simulation.vendors.senders import STEP_S
from deconflict_client.advisory import ClearedCode
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.counted_nouns import count_of
from deconflict_client.situations import AnyRevision

OFF = "busy: advice is off in this turn"
"""What robots answer while advice is off. The service asks them again soon."""


class StandoffFloor(FollowingFloor):
    """Robots that do what is asked of them in one turn, and decline all in another."""

    who = "robots of three vendors, which stand for each other,"

    def __init__(self, robots: int, seed: int) -> None:
        super().__init__(StandoffWorld(robots, seed), Annex(()), Follow.REQUESTS)
        self.turns = AdviceTurns(self.world, [member.make.vendor.value for member in self.world.members])
        self.yielded_s = dict.fromkeys(self.turns.vendors, 0.0)
        """By vendor: how long its robots did what they were asked, so that others passed."""

    def begin(self) -> None:
        self.turns.begin()

    def step(self) -> None:
        super().step()
        self.turns.update(STEP_S)

    def pass_on(self, revision: AnyRevision, now_s: float) -> None:
        if self._follower:
            self._follower.declines = "" if self.turns.is_on else OFF
        if isinstance(revision, RobotAdvice) and revision.begun_at and revision.cleared_code is ClearedCode.DONE:
            yields = revision.other if revision.verb == "go_first" else revision.robot
            vendor = revision.vendors[revision.robots.index(yields or revision.robot)]
            self.yielded_s[vendor] += (revision.updated_at - revision.raised_at).total_seconds()
        super().pass_on(revision, now_s)

    def result(self) -> dict[str, Any]:
        yielded_s = {vendor: round(seconds, 1) for vendor, seconds in self.yielded_s.items()}
        return {"advice": self.turns.result() | {"yielded_s": yielded_s}}

    def sentence(self) -> str:
        state = "on" if self.turns.is_on else "off"
        left_s = self.turns.left_s
        now = f"Advice is {state} for {left_s:.0f} s more" if left_s < float("inf") else "There is no advice yet"
        return f"{now}. {self.saving()}"

    def report(self) -> list[str]:
        """Each turn, and what they show."""
        lines = [
            f"turn {number}: advice {'on ' if turn.advice else 'off'}  {turn.driven_mps:.2f} m/s a robot, "
            f"{60 * turn.stood_share:.0f} s of a minute stood"
            for number, turn in enumerate(self.turns.turns, 1)
        ]
        return [*lines, *self._by_vendor(), self.saving()]

    def _by_vendor(self) -> Iterator[str]:
        """What advice saved the robots of each vendor, and how long these yielded."""
        for vendor in self.turns.vendors:
            if stood := self.turns.saved("stood_share_of", vendor):
                yield (
                    f"{vendor}: of a minute on their way its robots stood for {60 * stood.with_advice:.1f} s with "
                    f"advice, {60 * stood.without:.1f} s without: {_difference(stood, 60.0, 1)}; "
                    f"they yielded for {self.yielded_s[vendor]:.0f} s"
                )

    def saving(self) -> str:
        """What the turns so far have shown."""
        driven, stood = self.turns.saved("driven_mps"), self.turns.saved("stood_share")
        if not driven or not stood:
            return "What it saves is known after two turns"
        pairs = count_of(driven.pairs, "pair of turns", "pairs of turns")
        return (
            f"With advice {driven.with_advice:.2f} m/s a robot, without {driven.without:.2f}: "
            f"{_difference(driven, 1.0, 2)} over {pairs}. Of a minute on their way robots stood for "
            f"{60 * stood.with_advice:.1f} s with advice, {60 * stood.without:.1f} s without: "
            f"{_difference(stood, 60.0, 1)}"
        )


def _difference(saved: Saved, unit: float, digits: int) -> str:
    """The difference with its interval, times `unit`."""

    def signed(value: float) -> str:
        return f"{value * unit:+.{digits}f}"

    interval = f" ({signed(saved.interval[0])} to {signed(saved.interval[1])})" if saved.interval else ""
    return signed(saved.difference) + interval
