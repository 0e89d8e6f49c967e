"""Which robot waits for which, and which have waited too long."""

import numpy as np

from deconflict.simulation.driving.protection import NOBODY
from ingest.batch import Bools, Floats, Ints

PATIENCE_S = (4.0, 10.0)
"""Usual range of the time that a robot stands for another before it acts."""
LONG_WAIT_S = 30.0
"""It backs off after this time even if no robot waits for it."""
AGAIN_S = 2.0
"""Interval between searches for a path past the other robot."""


class MutualWaits:
    """How long others have blocked each of n robots."""

    def __init__(self, robots: int, rng: np.random.Generator, patience_s: tuple[float, float] = PATIENCE_S) -> None:
        self._rng, self._range_s = rng, patience_s
        self.waited_s = np.zeros(robots)
        """(n,) how long others have blocked each."""
        self.blocker: Ints = np.full(robots, NOBODY)
        """(n,) the robot for which each stands."""
        self._patience_s = rng.uniform(*patience_s, robots)
        self._look_at_s = np.zeros(robots)

    def update(self, standing: Bools, by: Ints, dt_s: float) -> None:
        """Set which robots stand for others now, and for which."""
        self.blocker = np.where(standing, by, NOBODY)
        self.waited_s = np.where(standing, self.waited_s + dt_s, 0.0)

    def look_past(self, speed_mps: Floats, now_s: float) -> list[int]:
        """Robots that have stood too long for a standing robot, and now look for a path past it."""
        stands = (self.blocker != NOBODY) & (np.abs(speed_mps[self.blocker]) < 0.05)
        looking = np.flatnonzero(stands & (self.waited_s > self._patience_s) & (now_s >= self._look_at_s))
        self._look_at_s[looking] = now_s + AGAIN_S
        return [int(robot) for robot in looking]

    def out_of_patience(self) -> list[int]:
        """Robots that have waited too long for a robot that waits for them, directly or through others."""
        mutual = self._mutual() & (self.waited_s > self._patience_s)
        return [int(robot) for robot in np.flatnonzero(mutual | (self.waited_s > LONG_WAIT_S))]

    def restart(self, robot: int) -> None:
        """Restart the wait of a robot that has acted."""
        self.waited_s[robot], self.blocker[robot] = 0.0, NOBODY
        self._patience_s[robot] = self._rng.uniform(*self._range_s)

    def _mutual(self) -> Bools:
        """(n,) whether the robot is in, or behind, a ring of waits, which ends only if a robot yields."""
        nobody = len(self.blocker)
        waits_for = np.append(np.where(self.blocker == NOBODY, nobody, self.blocker), nobody)
        for _ in range(6):
            waits_for = waits_for[waits_for]
        return waits_for[:-1] != nobody
