"""How much the engine does in a pass when it can't keep up. Near conflicts are never left out."""

from dataclasses import dataclass
from enum import IntEnum

LATE_PASSES = 2
"""After this many late passes in a row the next pass does less."""
EASY_PASSES, MOST_EASY_PASSES = 50, 800
"""After so many easy passes in a row the next pass does more; twice as many each time that this proved too much."""
EASY_SHARE = 0.5
"""A pass that took less than this share of the deadline was easy."""


class Effort(IntEnum):
    """What a pass does, the most first. Each level leaves out what the levels before it do."""

    FULL = 0
    COARSE = 1
    """Smallest separations are accurate to 0.25 m, and never too small."""
    NEAR = 2
    """Conflicts later than `conflict.warning_s` wait, open ones stand; queues are looked at every ten seconds."""


@dataclass(slots=True)
class LoadShedder:
    """Chooses the effort of the next pass by how long the last ones took. Pure: the caller measures."""

    deadline_s: float
    effort: Effort = Effort.FULL
    _late: int = 0
    """Late passes in a row."""
    _easy: int = 0
    """Easy passes in a row."""
    _easy_needed: int = EASY_PASSES
    _did_more: bool = False
    """Whether the newest change was to do more."""

    def add_pass(self, pass_s: float) -> bool:
        """Add how long a pass took; return whether it missed its deadline."""
        is_late = pass_s > self.deadline_s
        self._late = self._late + 1 if is_late else 0
        self._easy = self._easy + 1 if pass_s < EASY_SHARE * self.deadline_s else 0
        if self._late >= LATE_PASSES and self.effort < Effort.NEAR:
            self._easy_needed = min(2 * self._easy_needed, MOST_EASY_PASSES) if self._did_more else self._easy_needed
            self._change(1)
        elif self._easy >= self._easy_needed:
            if self.effort > Effort.FULL:
                self._change(-1)
            elif self._easy >= MOST_EASY_PASSES:
                self._easy_needed = EASY_PASSES
        return is_late

    def _change(self, by: int) -> None:
        self.effort = Effort(self.effort + by)
        self._late, self._easy, self._did_more = 0, 0, by < 0
