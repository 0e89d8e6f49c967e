"""How fast each robot goes on, and for whom it brakes, slows down or swerves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deconflict.simulation.cast import Member, Protection
from deconflict.simulation.driving.passing import SWERVING_MPS, Passings
from deconflict.simulation.driving.protection import NOBODY, Bools, Free, Traffic, free_ways
from ingest.batch import Floats, Ints

HELD_S = (0.8, 1.5)
"""How long a robot's field must be clear before it goes on, by robot."""
RESTART_M = 0.15
"""A robot that stands goes on only where so much of its way is free."""
CREEPING_MPS, CREEPING_S, CREEPING_GAP_M = 0.25, 8.0, 0.05
"""One that has stood for long creeps on for so long, with so short a field."""
GENTLY = 0.6
"""Share of its greatest braking with which a robot slows down for what it sees or knows in time."""
YIELDS_SHARE = 0.5
"""A robot that goes no faster than this share of its pace for another gives way to it."""
SWERVES_FROM_M = 2.0
"""So far beyond its stopping distance a robot looks for one to go past."""
SWERVE_AGAIN_S = 1.0
ASIDE_M = 0.1
"""One that is further off its way than this may not come into a bend."""
MOVING_MPS, NEARLY_M = 0.03, 0.02

Limit = tuple[Floats, Ints]
"""(n,) metres that each may go, and (n,) for whom it may not go further."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """What each of n robots does next."""

    wanted_mps: Floats
    kept: Bools
    """Who may not go on at all."""
    by: Ints
    """And for whom."""


class Braking:
    """The protective stops of n robots."""

    def __init__(self, members: Sequence[Member], passings: Passings, rng: np.random.Generator) -> None:
        n, makes = len(members), [member.make for member in members]
        self.yields_to: Ints = np.full(n, NOBODY)
        """(n,) for whom each brakes, slows down or swerves that is not of its own fleet."""
        self.behind: Ints = np.full(n, NOBODY)
        """(n,) who of its own fleet is ahead of each, or in whose way it would come; of a person, anybody."""
        self.behind_m = np.full(n, np.inf)
        """(n,) how far each can go until then."""
        self._passings = passings
        self._stop_gap_m = np.array([make.stop_gap_m for make in makes])
        self._held_s, self._held_until_s = rng.uniform(*HELD_S, n), np.zeros(n)
        self._creeps_until_s = np.zeros(n)
        self._held_for: Ints = np.full(n, NOBODY)
        self._swerve_at_s = np.zeros(n)
        self._slows, self._swerves = (
            np.array([make.protection in kinds for make in makes], np.bool_)
            for kinds in ({Protection.SLOW}, {Protection.SWERVE, Protection.ATTEND})
        )

    def top_mps(self, now_s: float) -> Floats:
        """(n,) the most that each goes now, besides what its way allows; inf for most."""
        tops_mps: Floats = np.where(self._creeps_until_s > now_s, CREEPING_MPS, self._passings.top_mps)
        return tops_mps

    def top_of_mps(self, robot: int, now_s: float) -> float:
        """The same of one robot."""
        return CREEPING_MPS if self._creeps_until_s[robot] > now_s else float(self._passings.top_mps[robot])

    def creep(self, robot: int, now_s: float) -> None:
        """A robot that has stood for long goes on slowly, and nearer to others."""
        self._creeps_until_s[robot] = now_s + CREEPING_S

    def let_go(self, robot: int) -> None:
        """A robot no longer stands for what was in its field."""
        self._held_until_s[robot] = -np.inf

    def course(
        self, seen: Traffic, pace_mps: Floats, crossing: Limit, line: Limit, now_s: float, dt_s: float
    ) -> Course:
        """What everybody does next, who would go at `pace_mps` if nobody were in the way.

        `crossing` is how far the own fleet lets each go, `line` how far each may come before a crossing that is taken.
        """
        free = free_ways(seen)
        creeps = seen.backing | (self._creeps_until_s > now_s)
        gap_m = np.where(creeps, CREEPING_GAP_M, self._stop_gap_m)
        sensed_m, known_m = (np.maximum(way_m - gap_m, 0.0) for way_m in (free.sensed_m, free.known_m))
        self.behind, self.behind_m = free.known, known_m
        self._swerve(seen, free, now_s)
        held = self._hold(seen, free, sensed_m, creeps, now_s, dt_s)
        slow_mps = np.where(self._slows, self._gently(seen, sensed_m), np.inf)
        known_mps = np.where(seen.person, self._gently(seen, known_m), np.inf)
        self._note_yields(seen, free, held, np.minimum(slow_mps, known_mps) < YIELDS_SHARE * pace_mps, line)
        order_m, order = self._own_order(seen, known_m, free.known, crossing)
        open_m = np.minimum(order_m, line[0])
        wanted_mps = np.minimum(np.minimum(pace_mps, slow_mps), self._gently(seen, open_m))
        return Course(
            wanted_mps=np.where(held | ~seen.going, 0.0, wanted_mps),
            kept=seen.going & (held | (open_m < NEARLY_M)),
            by=np.select([held, line[0] < order_m], [self._held_for, line[1]], order),
        )

    def _gently(self, seen: Traffic, open_m: Floats) -> Floats:
        speed_mps: Floats = np.sqrt(2 * GENTLY * seen.brake_mps2 * open_m)
        return speed_mps

    def _own_order(self, seen: Traffic, known_m: Floats, known: Ints, crossing: Limit) -> Limit:
        """How far the own fleet lets each go."""
        crossing_m = np.where(seen.backing, np.inf, crossing[0])
        off_way = ~seen.backing & (np.abs(seen.aside_m) > ASIDE_M)
        bend_m = np.where(off_way, self._passings.end_m - seen.progress_m, np.inf)
        open_m = np.minimum(np.minimum(known_m, crossing_m), bend_m)
        return np.maximum(open_m, 0.0), np.where(crossing_m < known_m, crossing[1], known)

    def _hold(self, seen: Traffic, free: Free, sensed_m: Floats, creeps: Bools, now_s: float, dt_s: float) -> Bools:
        """(n,) who brakes, or stands, since somebody is or was a moment ago in its field."""
        speed_mps = np.abs(seen.speed_mps)
        restart_m = np.where(creeps, CREEPING_GAP_M, RESTART_M)
        stopping_m = np.abs(seen.braking_m()) + speed_mps * dt_s
        brakes = seen.going & (sensed_m < np.where(speed_mps < MOVING_MPS, restart_m, stopping_m))
        self._held_until_s = np.where(brakes, now_s + self._held_s, self._held_until_s)
        self._held_for = np.where(brakes, free.sensed, self._held_for)
        held: Bools = seen.going & (now_s < self._held_until_s)
        return held

    def _note_yields(self, seen: Traffic, free: Free, held: Bools, slows: Bools, line: Limit) -> None:
        nearest = np.where(seen.person, free.known, free.sensed)
        others = [self._held_for, nearest, line[1], self._passings.past]
        does = [held, slows, np.isfinite(line[0]), self._passings.past != NOBODY]
        foreign = [seen.fleet[other] != seen.fleet for other in others]
        chosen = [one & other & seen.going for one, other in zip(does, foreign, strict=True)]
        self.yields_to = np.select(chosen, others, NOBODY)

    def _swerve(self, seen: Traffic, free: Free, now_s: float) -> None:
        """Those that swerve look for a way past whoever comes near."""
        others = np.where(seen.person, free.known, free.sensed)
        near = np.where(seen.person, free.known_m, free.sensed_m) < seen.braking_m() + SWERVES_FROM_M
        looks = near & self._swerves & seen.going & ~seen.backing & (self._swerve_at_s <= now_s)
        for robot in np.flatnonzero(looks).tolist():
            self._swerve_at_s[robot] = now_s + SWERVE_AGAIN_S
            if robot not in self._passings:
                self._passings.begin(seen, robot, int(others[robot]), now_s, SWERVING_MPS)
