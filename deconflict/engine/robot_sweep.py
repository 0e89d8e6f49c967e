"""The sweep of the live robots, each as wide as its position is uncertain: a robot that stops reporting grows.

A robot that has grown to the limit, and whose forecast has ended, is dormant: until it reports, nothing of it changes.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from heapq import heappop, heappush
from itertools import compress
from math import floor, inf

import numpy as np

from deconflict.advisories.conflict_lifecycle import ConflictLifecycle
from deconflict.foresight.presence.live_robots import LiveRobot, LiveRobots
from deconflict.settings.site import Site
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.incremental import Sweeper
from deconflict.sweep.pair_choice import LATER_S
from ingest.batch import Batch, Bools, Floats, Forecasts, Ints, Pair
from ingest.measures.measures import Measures

GROWTH_STEP_M = 0.1
"""Uncertainty grows in steps of this, so that a quiet robot is swept again only when that matters."""

NEW_S = 300.0
"""A robot came lately if it did so within this time."""
LATELY_S = 10.0
"""A robot is partly examined for so long after a pair of it was left out."""


class PairClaims:
    """Which claims robots and pairs have to be examined, see `pair_choice.Claims`: the sources of live robots, and the
    pairs that may have a conflict advisory."""

    def __init__(self, live: LiveRobots, conflicts: ConflictLifecycle, crowds: Mapping[str, int]) -> None:
        self._live, self._conflicts, self._crowds = live, conflicts, crowds
        self._left_out_s: dict[str, float] = {}
        """By robot, when a pair of it was last left out."""
        self._now_s = -inf
        """When the last pass was."""

    def note_left_out(self, now_s: float, robots: Iterable[str]) -> None:
        """Pairs of these robots were left out in the pass at `now_s`."""
        self._now_s = now_s
        lately = {uuid: at_s for uuid, at_s in self._left_out_s.items() if now_s - at_s <= LATELY_S}
        self._left_out_s = lately | dict.fromkeys(robots, now_s)

    def partly_examined(self) -> list[str]:
        """The robots that were heard lately, and of which pairs were left out lately, or that are in a crowd; in
        ascending order."""
        robots = self._live.robots
        concerned = sorted((self._left_out_s.keys() | self._crowds.keys()) & robots.keys())
        heard_s = self._live.event_s[[robots[uuid].slot for uuid in concerned]]
        return list(compress(concerned, (heard_s >= self._now_s - LATELY_S).tolist()))

    def sources(self) -> tuple[Ints, Floats, Bools]:
        live, known = self._live, [robot.slot for robot in self._live.robots.values()]
        live.make_room()
        newest_s, first_s = live.event_s[known].max(initial=-inf), live.came_s[known].min(initial=inf)
        return live.source, live.came_s, (live.came_s > newest_s - NEW_S) & (live.came_s > first_s + LATER_S)

    def watched(self) -> Iterable[Pair]:
        return self._conflicts.pairs.all()


class RobotSweep:
    """Keeps the sweep up to date with the live robots."""

    def __init__(
        self, site: Site, live: LiveRobots, measures: Measures, crowds: Mapping[str, int], claims: PairClaims
    ) -> None:
        self._conflict, self._reading = site.conflict, site.reading
        self._live, self._measures, self._claims = live, measures, claims
        bounds = {"clearance_m": site.conflict.clearance_m, "horizon_s": site.conflict.horizon_s}
        self.sweeper = Sweeper(**bounds, crowds=crowds, claims=claims, slots=live.slots)
        self._quiet: list[tuple[float, str]] = []
        """A heap of when to look at the silence of robots, and their UUIDs; see `_next_s`."""
        self._next_s: dict[str, float] = {}
        """When each robot that is not dormant is looked at next. Its other entries are void."""
        self.dormant: set[str] = set()

    def add(self, batch: Batch, new_robots: Iterable[str]) -> None:
        """Add the forecasts of a batch; `new_robots` are those that were not live before it."""
        woken = self.dormant.intersection(batch.robots)
        self.dormant -= woken
        for uuid in woken.union(new_robots):
            self._look_next(uuid, self._quiet_s(self._live.robots[uuid]))
        self._update(batch.robots, batch.forecasts, 2 * batch.doubt_m)

    def discard(self, robots: Iterable[str]) -> None:
        robots = list(robots)
        self.dormant.difference_update(robots)
        for uuid in robots:
            self._next_s.pop(uuid, None)
        self.sweeper.discard(robots)

    def find_conflicts(self, now_s: float, reach_s: float, accuracy_m: float) -> PairConflicts:
        """See `Sweeper.find_conflicts`. Notes the robots of which pairs were left out."""
        conflicts = self.sweeper.find_conflicts(now_s, reach_s, accuracy_m)
        self._claims.note_left_out(now_s, self.sweeper.cut_robots())
        return conflicts

    def grow_quiet(self, now_s: float) -> set[str]:
        """Grow the robots whose next step of growth is due. Returns those that are dormant from now on."""
        grown, dormant = self._look_at_quiet(now_s)
        if grown:
            robots, forecasts = self._live.forecasts(sorted(grown))
            widened_m = np.array([self._live.robots[uuid].widened_m for uuid in robots])
            self._update(robots, forecasts, widened_m)
        if dormant:
            self.sweeper.let_sleep(dormant)
            self.dormant |= dormant
        return dormant

    def _update(self, robots: Sequence[str], forecasts: Forecasts, widened_m: Floats) -> None:
        for _, reason in self.sweeper.update(robots, _widened(forecasts, widened_m), widened_m):
            self._measures.count("deconflict_invalid_forecasts_total", reason)

    def _quiet_s(self, robot: LiveRobot) -> float:
        """From when on a robot is quiet, if it is not heard before."""
        return robot.event_s + max(self._reading.quiet_after_s, robot.reports_within_s)

    def _look_at_quiet(self, now_s: float) -> tuple[set[str], set[str]]:
        """Look at the robots that are due. Returns those that have grown, and those that are dormant from now on."""
        grown, dormant = set(), set()
        while self._quiet and self._quiet[0][0] <= now_s:
            due_s, uuid = heappop(self._quiet)
            robot = self._live.robots.get(uuid)
            if robot is None or self._next_s.get(uuid) != due_s:
                continue
            next_s = self._quiet_s(robot)
            if next_s <= now_s:
                before_m, next_s = robot.growth_m, self._grow(robot, now_s - next_s, next_s)
                if robot.growth_m > before_m:
                    grown.add(uuid)
                if next_s == inf:
                    next_s = float(robot.forecast.t_s[-1])
                    if next_s <= now_s:
                        dormant.add(uuid)
                        continue
            self._look_next(uuid, next_s)
        return grown, dormant

    def _look_next(self, uuid: str, at_s: float) -> None:
        self._next_s[uuid] = at_s
        heappush(self._quiet, (at_s, uuid))

    def _grow(self, robot: LiveRobot, quiet_for_s: float, since_s: float) -> float:
        """Grow the uncertainty of a robot that is quiet since `since_s`. Returns when it grows further; inf if it has
        grown to the limit."""
        rate_mps, limit_m = self._conflict.silent_growth_mps, self._conflict.silent_growth_limit_m
        steps = floor(quiet_for_s * rate_mps / GROWTH_STEP_M) + 1
        robot.growth_m = min(steps * GROWTH_STEP_M, limit_m)
        if rate_mps == 0 or robot.growth_m >= limit_m:
            return inf
        return since_s + steps * GROWTH_STEP_M / rate_mps


def _widened(forecasts: Forecasts, by_m: Floats) -> Forecasts:
    return replace(forecasts, length_m=forecasts.length_m + by_m, width_m=forecasts.width_m + by_m)
