"""How much the engine does in a pass when it can't keep up. Near conflicts are never left out."""

import logging
import time
from dataclasses import dataclass
from enum import IntEnum
from math import inf

from ingest.measures.measures import Measures

LATE_PASSES = 2
"""After this many late passes in a row the next pass does less."""
EASY_S, MOST_EASY_S = 5.0, 80.0
"""After easy passes for so long the next pass does more; twice as long each time that this proved too much."""
EASY_SHARE = 0.5
"""A pass that took less than this share of the deadline was easy."""


class Effort(IntEnum):
    """What a pass does, the most first. Each level leaves out what the levels before it do."""

    FULL = 0
    COARSE = 1
    """Smallest separations are accurate to 0.25 m, and never too small."""
    NEAR = 2
    """Conflicts later than `conflict.warning_s` wait, open ones stand; queues are looked at every ten seconds."""


LEFT_OUT = {
    Effort.FULL: "nothing is left out any more",
    Effort.COARSE: "smallest separations are given to a quarter of a metre",
    Effort.NEAR: "conflicts later than conflict.warning_s wait as well, and queues are checked every ten seconds",
}

log = logging.getLogger(__name__)


@dataclass(slots=True)
class LoadShedder:
    """Chooses the effort of the next pass by how long the last ones took. Pure: the caller measures."""

    deadline_s: float
    effort: Effort = Effort.FULL
    least: Effort = Effort.NEAR
    """The effort below which it does not go."""
    _late: int = 0
    """Late passes in a row."""
    _easy_since_s: float = inf
    """When the first of the newest easy passes in a row ended; inf if the last one was not easy."""
    _easy_needed_s: float = EASY_S
    _did_more: bool = False
    """Whether the newest change was to do more."""

    def add_pass(self, pass_s: float, now_s: float) -> bool:
        """Add how long a pass took that ended at `now_s`; return whether it missed its deadline."""
        is_late = pass_s > self.deadline_s
        self._late = self._late + 1 if is_late else 0
        self._easy_since_s = min(self._easy_since_s, now_s) if pass_s < EASY_SHARE * self.deadline_s else inf
        easy_s = now_s - self._easy_since_s
        if self._late >= LATE_PASSES and self.effort < self.least:
            self._easy_needed_s = min(2 * self._easy_needed_s, MOST_EASY_S) if self._did_more else self._easy_needed_s
            self._change(1)
        elif easy_s >= self._easy_needed_s:
            if self.effort > Effort.FULL:
                self._change(-1)
            elif easy_s >= MOST_EASY_S:
                self._easy_needed_s = EASY_S
        return is_late

    def _change(self, by: int) -> None:
        self.effort = Effort(self.effort + by)
        self._late, self._easy_since_s, self._did_more = 0, inf, by < 0


def adapt_effort(load: LoadShedder, measures: Measures, took_s: float) -> None:
    """Count whether the pass that took so long was late, and set the effort of the next passes."""
    before = load.effort
    measures.count("deconflict_deadlines_missed_total", by=load.add_pass(took_s, time.monotonic()))
    measures.level("deconflict_engine_effort_reduced", {(): load.effort})
    if load.effort > before:
        log.warning("the engine can't keep up, a pass took %.2f s: %s", took_s, LEFT_OUT[load.effort])
    elif load.effort < before:
        log.info("the engine keeps up again: %s", LEFT_OUT[load.effort])
