"""Who waits for whom, and whose patience is at an end."""

import numpy as np

from deconflict.simulation.driving.protection import NOBODY, Bools
from ingest.batch import Floats, Ints

PATIENCE_S = (4.0, 10.0)
"""How long a robot stands for another before it does something about it."""
LONG_WAIT_S = 30.0
"""It backs off after so long even if nobody waits for it."""
AGAIN_S = 2.0
"""It looks for a way past the other so often."""


class Waits:
    """How long others have kept each of n robots standing."""

    def __init__(self, robots: int, rng: np.random.Generator) -> None:
        self._rng = rng
        self.waited_s = np.zeros(robots)
        self.blocker: Ints = np.full(robots, NOBODY)
        """(n,) for whom each stands."""
        self._patience_s = rng.uniform(*PATIENCE_S, robots)
        self._look_at_s = np.zeros(robots)

    def keep(self, standing: Bools, by: Ints, dt_s: float) -> None:
        """Who stands for others now, and for whom."""
        self.blocker = np.where(standing, by, NOBODY)
        self.waited_s = np.where(standing, self.waited_s + dt_s, 0.0)

    def look_past(self, speed_mps: Floats, now_s: float) -> list[int]:
        """Robots that have stood for long for one that stands, and now look for a way past it."""
        stands = (self.blocker != NOBODY) & (np.abs(speed_mps[self.blocker]) < 0.05)
        looking = np.flatnonzero(stands & (self.waited_s > self._patience_s) & (now_s >= self._look_at_s))
        self._look_at_s[looking] = now_s + AGAIN_S
        return [int(robot) for robot in looking]

    def tired(self) -> list[int]:
        """Robots that have waited for long for somebody who waits, directly or through others, for them."""
        mutual = self._mutual() & (self.waited_s > self._patience_s)
        return [int(robot) for robot in np.flatnonzero(mutual | (self.waited_s > LONG_WAIT_S))]

    def begin_anew(self, robot: int) -> None:
        """A robot does something about its wait."""
        self.waited_s[robot], self.blocker[robot] = 0.0, NOBODY
        self._patience_s[robot] = self._rng.uniform(*PATIENCE_S)

    def _mutual(self) -> Bools:
        """(n,) whose wait ends only when somebody gives way."""
        nobody = len(self.blocker)
        waits_for = np.append(np.where(self.blocker == NOBODY, nobody, self.blocker), nobody)
        for _ in range(6):
            waits_for = waits_for[waits_for]
        mutual: Bools = waits_for[:-1] != nobody
        return mutual
