"""What robots are told from outside, as by a site service: to wait, or to drive slowly for a while."""

import numpy as np

from ingest.batch import Floats


class Instructions:
    """The instructions that n robots follow. Times are the world's."""

    def __init__(self, robots: int) -> None:
        self._top_mps = np.full(robots, np.inf)
        self._until_s = np.zeros(robots)

    def wait(self, robot: int, seconds: float, now_s: float) -> None:
        """Let a robot stand, after what it was told before."""
        starts_s = max(self._until_s[robot], now_s) if self._top_mps[robot] == 0.0 else now_s
        self._top_mps[robot], self._until_s[robot] = 0.0, starts_s + seconds

    def slow_down(self, robot: int, top_mps: float, seconds: float, now_s: float) -> None:
        """Let a robot drive at most at this speed, instead of what it was told before."""
        self._top_mps[robot], self._until_s[robot] = top_mps, now_s + seconds

    def top_mps(self, now_s: float) -> Floats:
        """(n,) present speed limit of each robot; inf if there is none."""
        return np.where(self._until_s > now_s, self._top_mps, np.inf)

    def top_of_mps(self, robot: int, now_s: float) -> tuple[float, float]:
        """`top_mps` of one robot, and for how long that is."""
        left_s = float(self._until_s[robot] - now_s)
        return (float(self._top_mps[robot]), left_s) if left_s > 0 else (np.inf, 0.0)

    def waits(self, robot: int, now_s: float) -> bool:
        """Whether a robot has been told to stand now."""
        return self.top_of_mps(robot, now_s)[0] == 0.0
