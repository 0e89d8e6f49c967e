"""The speed of each robot, and for whom it brakes, slows down or swerves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from deconflict.simulation.driving.passing import SWERVING_MPS, Passings
from deconflict.simulation.driving.protection import NOBODY, FreeWays, Traffic, free_ways
from deconflict.simulation.participants import Chassis, Protection
from ingest.batch import Bools, Floats, Ints

HELD_S = (0.8, 1.5)
"""Range of the time for which a robot's field must be clear before it continues. Each robot has its own."""
RESTART_M = 0.15
"""A standing robot starts only if this much of its path is free."""
CREEPING_MPS, CREEPING_S, CREEPING_GAP_M = 0.25, 8.0, 0.05
"""A robot that has stood for long creeps on: its speed, for how long, and the length of its field."""
GENTLY = 0.6
"""Share of its greatest deceleration that a robot uses if it sees or knows an obstacle in time."""
YIELDS_SHARE = 0.5
"""A robot that another slows down to at most this share of its speed yields to it."""
SWERVES_FROM_M = 2.0
"""How far beyond its stopping distance a robot looks for robots to pass."""
SWERVE_AGAIN_S = 1.0
ASIDE_M = 0.1
"""A robot that is further off its path than this may not enter a bend."""
MOVING_MPS, NEARLY_M = 0.03, 0.02

Limit = tuple[Floats, Ints]
"""(n,) metres that each robot may drive, and (n,) the robot that limits this."""


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The next motion of n robots."""

    wanted_mps: Floats
    """(n,) speed that it is to reach."""
    kept: Bools
    """(n,) whether it must not move."""
    by: Ints
    """(n,) the robot for which it must not move."""


class Braking:
    """The protective stops of n robots."""

    def __init__(self, makes: Sequence[Chassis], passings: Passings, rng: np.random.Generator) -> None:
        n = len(makes)
        self.yields_to: Ints = np.full(n, NOBODY)
        """(n,) the robot of another fleet for which each brakes, slows down or swerves."""
        self.slowed_by: Ints = np.full(n, NOBODY)
        """(n,) the robot, of any fleet, because of which each is now slower than its path allows."""
        self.behind: Ints = np.full(n, NOBODY)
        """(n,) the robot of its own fleet that is ahead of it, or whose path it would enter; for a person, of any
        fleet."""
        self.behind_m = np.full(n, np.inf)
        """(n,) how far it can drive until there."""
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
        """(n,) present speed limit of each robot besides that of its path; inf for most."""
        return np.where(self._creeps_until_s > now_s, CREEPING_MPS, self._passings.top_mps)

    def top_of_mps(self, robot: int, now_s: float) -> float:
        """`top_mps` of one robot."""
        return CREEPING_MPS if self._creeps_until_s[robot] > now_s else float(self._passings.top_mps[robot])

    def creep(self, robot: int, now_s: float) -> None:
        """Let a robot that has stood for long continue slowly, and nearer to others."""
        self._creeps_until_s[robot] = now_s + CREEPING_S

    def let_go(self, robot: int) -> None:
        """Let a robot ignore what was in its field."""
        self._held_until_s[robot] = -np.inf

    def course(
        self, seen: Traffic, pace_mps: Floats, crossing: Limit, line: Limit, now_s: float, dt_s: float
    ) -> Course:
        """The next motion of all robots. Without obstacles they would drive at `pace_mps`.

        `crossing` is how far their own fleet lets them drive, `line` how far they may drive before an occupied
        crossing.
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
        order_mps, seen_mps = self._gently(seen, open_m), np.minimum(slow_mps, known_mps)
        wanted_mps = np.minimum(np.minimum(pace_mps, slow_mps), order_mps)
        by = np.select([held, line[0] < order_m], [self._held_for, line[1]], order)
        nearest = np.where(seen.person, free.known, free.sensed)
        causes = [held, self._passings.past != NOBODY, seen_mps < np.minimum(order_mps, pace_mps), order_mps < pace_mps]
        self.slowed_by = np.where(seen.going, np.select(causes, [by, self._passings.past, nearest, by], NOBODY), NOBODY)
        return Course(
            wanted_mps=np.where(held | ~seen.going, 0.0, wanted_mps),
            kept=seen.going & (held | (open_m < NEARLY_M)),
            by=by,
        )

    def _gently(self, seen: Traffic, open_m: Floats) -> Floats:
        return np.sqrt(2 * GENTLY * seen.brake_mps2 * open_m)

    def _own_order(self, seen: Traffic, known_m: Floats, known: Ints, crossing: Limit) -> Limit:
        """How far its own fleet lets each robot drive."""
        crossing_m = np.where(seen.backing, np.inf, crossing[0])
        off_way = ~seen.backing & (np.abs(seen.aside_m) > ASIDE_M)
        bend_m = np.where(off_way, self._passings.end_m - seen.progress_m, np.inf)
        open_m = np.minimum(np.minimum(known_m, crossing_m), bend_m)
        return np.maximum(open_m, 0.0), np.where(crossing_m < known_m, crossing[1], known)

    def _hold(self, seen: Traffic, free: FreeWays, sensed_m: Floats, creeps: Bools, now_s: float, dt_s: float) -> Bools:
        """(n,) whether a robot brakes or stands because another is, or was a moment ago, in its field."""
        speed_mps = np.abs(seen.speed_mps)
        restart_m = np.where(creeps, CREEPING_GAP_M, RESTART_M)
        stopping_m = np.abs(seen.braking_m()) + speed_mps * dt_s
        brakes = seen.going & (sensed_m < np.where(speed_mps < MOVING_MPS, restart_m, stopping_m))
        self._held_until_s = np.where(brakes, now_s + self._held_s, self._held_until_s)
        self._held_for = np.where(brakes, free.sensed, self._held_for)
        return seen.going & (now_s < self._held_until_s)

    def _note_yields(self, seen: Traffic, free: FreeWays, held: Bools, slows: Bools, line: Limit) -> None:
        nearest = np.where(seen.person, free.known, free.sensed)
        others = [self._held_for, nearest, line[1], self._passings.past]
        does = [held, slows, np.isfinite(line[0]), self._passings.past != NOBODY]
        foreign = [seen.fleet[other] != seen.fleet for other in others]
        chosen = [yields & is_foreign & seen.going for yields, is_foreign in zip(does, foreign, strict=True)]
        self.yields_to = np.select(chosen, others, NOBODY)

    def _swerve(self, seen: Traffic, free: FreeWays, now_s: float) -> None:
        """Robots that can swerve look for room to pass robots that come near."""
        others = np.where(seen.person, free.known, free.sensed)
        near = np.where(seen.person, free.known_m, free.sensed_m) < seen.braking_m() + SWERVES_FROM_M
        looks = near & self._swerves & seen.going & ~seen.backing & (self._swerve_at_s <= now_s)
        for robot in np.flatnonzero(looks).tolist():
            self._swerve_at_s[robot] = now_s + SWERVE_AGAIN_S
            if robot not in self._passings:
                self._passings.begin(seen, robot, int(others[robot]), now_s, SWERVING_MPS)
