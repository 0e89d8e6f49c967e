"""The demo's robots, the time that they lose, and what following advice saves."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.simulation.demo.advice_follower import Follow, Follower
from deconflict.simulation.driving.lost_time import LostTimeCounter
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.scripted_annex import Annex
from deconflict.simulation.vendors.senders import STEP_S, RobotFloor, warehouse
from deconflict_client.counted_nouns import count_of
from deconflict_client.situations import AnyRevision

SHOWN = ("delay_s", "waited_s", "stops", "trips")
"""The sums of `LostTime` that the demo prints."""
ORDERS = ("wait", "slow_down", "back_out", "go_around", "wait_before")


class FollowingFloor(RobotFloor, ABC):
    """Robots that report, and may follow advice."""

    who = "robots of four vendors"
    """Who they are, for people."""

    def __init__(self, world: World, annex: Annex, follow: Follow) -> None:
        super().__init__(world, annex)
        self._follower = Follower(world, world.rows(), follow) if follow is not Follow.NONE else None

    @property
    def follows_advice(self) -> bool:
        return self._follower is not None

    def begin(self) -> None:
        """The engine is up: from now on there is advice."""

    def pass_on(self, revision: AnyRevision, now_s: float) -> None:
        """Pass on the advice of a revision, if the robots follow advice. `now_s` is seconds since the epoch."""
        if self._follower:
            self._follower.pass_on(revision, now_s)

    def take_answers(self) -> list[AnsweredAdvice]:
        """What robots have answered to what was asked of them since the last call."""
        return self._follower.take_answers() if self._follower else []

    @abstractmethod
    def result(self) -> dict[str, Any]:
        """What the demo's last line says of these robots."""

    @abstractmethod
    def sentence(self) -> str:
        """What following advice saved so far; empty if the robots follow none."""

    def report(self) -> Iterable[str]:
        """What the demo prints before its last line."""
        return ()


class DemoFloor(FollowingFloor):
    """The robots that report. If they follow advice, the same robots without advice move beside them, unreported."""

    def __init__(self, robots: int, seed: int, *, follows_advice: bool) -> None:
        super().__init__(*warehouse(robots, seed), Follow.SITUATIONS if follows_advice else Follow.NONE)
        self.lost = LostTimeCounter(self.world)
        """What the robots of the halls lose."""
        self._without_advice = DemoFloor(robots, seed, follows_advice=False) if follows_advice else None

    def step(self) -> None:
        super().step()
        self.lost.update(STEP_S)
        if self._without_advice:
            self._without_advice.step()

    def result(self) -> dict[str, Any]:
        """The sums over the robots of the halls; with advice, those of the same robots without it beside them."""
        sums = asdict(self.lost.now())
        shown: dict[str, Any] = {name: sums[name] for name in SHOWN}
        if self._without_advice:
            shown["without_advice"] = self._without_advice.result()
        return shown

    def sentence(self) -> str:
        if not self._without_advice or not self._follower:
            return ""
        own, other = self.lost.now(), self._without_advice.lost.now()
        orders = sum(self._follower.counts[action] for action in ORDERS)
        return (
            f"Robots follow advice: {count_of(orders, 'order')} so far. "
            f"They were {own.delay_s:.0f} s late on their way, {other.delay_s:.0f} s without advice; "
            f"{own.stops} long stops, {other.stops} without; {own.trips} arrivals, {other.trips} without"
        )
