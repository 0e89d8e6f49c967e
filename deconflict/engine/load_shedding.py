"""How much the engine does in a pass when it can't keep up: what is least missed goes first, near conflicts never."""

from dataclasses import dataclass
from enum import IntEnum

LESS_AFTER = 2
"""So many late passes in a row, and the next does less."""
MORE_AFTER, MOST_PATIENCE = 50, 800
"""So many easy passes in a row, and the next does more; twice as many each time that it proved too much."""
EASY = 0.5
"""A pass that took less than this share of the deadline was easy."""


class Effort(IntEnum):
    """What a pass does, the most first. Each leaves out what those before it do."""

    FULL = 0
    COARSE = 1
    """How near robots will come is told to a quarter of a metre, and never too small."""
    NEAR = 2
    """Conflicts later than `conflict.warning_s` wait, open ones stand; queues are looked at every ten seconds."""


@dataclass(slots=True)
class Pace:
    """The effort of the next pass, from how long the last ones took. Pure: the edge measures."""

    deadline_s: float
    effort: Effort = Effort.FULL
    _late: int = 0
    _easy: int = 0
    _patience: int = MORE_AFTER
    _raised: bool = False
    """Whether the newest change was to do more."""

    def took(self, pass_s: float) -> bool:
        """Take in how long a pass took; whether it missed its deadline."""
        missed = pass_s > self.deadline_s
        self._late = self._late + 1 if missed else 0
        self._easy = self._easy + 1 if pass_s < EASY * self.deadline_s else 0
        if self._late >= LESS_AFTER and self.effort < Effort.NEAR:
            self._patience = min(2 * self._patience, MOST_PATIENCE) if self._raised else self._patience
            self._change(1)
        elif self._easy >= self._patience:
            if self.effort > Effort.FULL:
                self._change(-1)
            elif self._easy >= MOST_PATIENCE:
                self._patience = MORE_AFTER
        return missed

    def _change(self, by: int) -> None:
        self.effort = Effort(self.effort + by)
        self._late, self._easy, self._raised = 0, 0, by < 0
