"""The demo's robots that stand for each other, with advice on and off in turns, and what it saves: what robots do in
neighbouring turns is compared."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from math import inf, sqrt
from typing import Any

import numpy as np
from scipy.special import stdtrit

from deconflict.simulation.demo.advice_follower import Follow
from deconflict.simulation.demo.demo_floor import FollowingFloor
from deconflict.simulation.demo.standoff_hall import StandoffWorld
from deconflict.simulation.driving.lost_time import STANDING_MPS
from deconflict.simulation.driving.motion import Activity, MovingRobots
from deconflict.simulation.scripted_annex import Annex
from deconflict.simulation.vendors.senders import STEP_S
from deconflict_client.advisory import ClearedCode
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.counted_nouns import count_of
from deconflict_client.situations import AnyRevision
from ingest.batch import Floats

TURN_S, SETTLES_S = 60.0, 20.0
"""How long a turn lasts, and how much of its begin does not count: what the turn before has left still lasts."""
FILLS_S = 90.0
"""Robots set out one after another: the first turn begins no sooner."""
ORDER = (False, True, True, False)
"""Whether advice is on in a turn, again and again: whatever grows or shrinks all the time favours neither."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What robots did by second on their way, without the begin of the turn. Stays in bays do not count."""

    advice: bool
    driven_mps: float
    """Metres driven forwards, less those driven backwards."""
    stood_share: float
    """Share of this time for which they stood."""
    stood_share_of: dict[str, float]
    """The same of each vendor's robots."""


@dataclass(frozen=True, slots=True)
class Saved:
    """Turns with and without advice, and the mean difference of pairs of neighbours."""

    pairs: int
    with_advice: float
    without: float
    difference: float
    interval: tuple[float, float] | None
    """95 % interval of the difference; None for fewer than two pairs."""


class AdviceTurns:
    """The turns of a world. Call `begin` once there is advice, and `update` after each step."""

    def __init__(self, world: MovingRobots, vendors: Sequence[str]) -> None:
        """`vendors` has the vendor of each robot."""
        self._world, self._begins_s = world, inf
        self.vendors = sorted(set(vendors))
        self._is_of = np.array(vendors) == np.array(self.vendors)[:, None]
        """(v, n) whether a robot is a vendor's."""
        self._driven_m = 0.0
        """Of the turn that lasts, over all robots."""
        self._stood_s, self._on_way_s = np.zeros((2, len(self.vendors)))
        """The same by vendor."""
        self.turns: list[Turn] = []
        """Those that have ended."""

    def begin(self) -> None:
        """There is advice from now on."""
        self._begins_s = max(self._world.t_s, FILLS_S)

    @property
    def is_on(self) -> bool:
        """Whether advice is on now."""
        return self._world.t_s >= self._begins_s and ORDER[len(self.turns) % len(ORDER)]

    @property
    def left_s(self) -> float:
        """How long it stays so. That is until the first turn, if none has begun."""
        return self._begins_s + TURN_S * (len(self.turns) + (self._world.t_s >= self._begins_s)) - self._world.t_s

    def update(self, dt_s: float) -> None:
        """Count a step of this length."""
        world = self._world
        in_turn_s = world.t_s - self._begins_s - TURN_S * len(self.turns)
        if in_turn_s >= SETTLES_S:
            on_way = np.isin(world.doing, (Activity.DRIVING, Activity.BACKING, Activity.HOLDING))
            self._driven_m += dt_s * float(world.velocities()[:, 0].sum())
            self._stood_s += dt_s * (self._is_of & on_way & (np.abs(world.speed_mps) < STANDING_MPS)).sum(axis=1)
            self._on_way_s += dt_s * (self._is_of & on_way).sum(axis=1)
        if in_turn_s >= TURN_S:
            on_way_s, shares = max(float(self._on_way_s.sum()), dt_s), self._stood_s / np.maximum(self._on_way_s, dt_s)
            shares_of = dict(zip(self.vendors, shares.tolist(), strict=True))
            stood_share = float(self._stood_s.sum()) / on_way_s
            self.turns.append(Turn(self.is_on, self._driven_m / on_way_s, stood_share, shares_of))
            self._driven_m = 0.0
            self._stood_s, self._on_way_s = np.zeros((2, len(self.vendors)))

    def saved(self, name: str, vendor: str = "") -> Saved | None:
        """The pairs so far by one of the figures of `Turn`, of one that is by vendor that of a vendor. None if there is
        no pair."""
        pairs = [
            sorted(pair, key=lambda turn: turn.advice) for pair in zip(self.turns[::2], self.turns[1::2], strict=False)
        ]
        if not pairs:
            return None
        without, with_advice = np.array([[_figure(turn, name, vendor) for turn in pair] for pair in pairs]).T
        difference, interval = paired(with_advice - without)
        return Saved(len(pairs), float(with_advice.mean()), float(without.mean()), difference, interval)

    def result(self) -> dict[str, Any]:
        """All turns, and what was saved, rounded."""
        turns = [{name: _rounded(value) for name, value in asdict(turn).items()} for turn in self.turns]
        of_vendors = {vendor: self._rounded_saved("stood_share_of", vendor) for vendor in self.vendors}
        saved = {name: self._rounded_saved(name) for name in ("driven_mps", "stood_share")}
        return {"turns": turns, **saved, "stood_share_of": of_vendors}

    def _rounded_saved(self, name: str, vendor: str = "") -> dict[str, Any] | None:
        saved = self.saved(name, vendor)
        return {key: _rounded(value) for key, value in asdict(saved).items()} if saved else None


def _figure(turn: Turn, name: str, vendor: str) -> float:
    figure = getattr(turn, name)
    return float(figure[vendor] if vendor else figure)


def paired(differences: Floats) -> tuple[float, tuple[float, float] | None]:
    """The mean of differences (n,) and its 95 % interval by Student's distribution; None for fewer than two."""
    mean = float(differences.mean())
    if len(differences) < 2:
        return mean, None
    half = float(stdtrit(len(differences) - 1, 0.975) * differences.std(ddof=1) / sqrt(len(differences)))
    return mean, (mean - half, mean + half)


def _rounded(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_rounded(each) for each in value]
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    return round(value, 3) if isinstance(value, float) else value


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
