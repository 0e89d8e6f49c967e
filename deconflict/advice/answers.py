"""Questions and answers: what is worked out aside, and given at event times, so that a replay gives the same advice."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from deconflict.advisory import Recommendation

ANSWER_AFTER_S = 0.5
"""An answer is given at the first step so long after it was asked for, however soon it was worked out."""


class Answer(Protocol):
    """What is being worked out."""

    def done(self) -> bool: ...

    def result(self) -> Recommendation: ...


Submit = Callable[[Callable[[], Recommendation]], Answer]
"""Has the work done, as `concurrent.futures.Executor.submit` does."""


@dataclass(frozen=True, slots=True)
class Done:
    """An answer that is there."""

    advice: Recommendation

    def done(self) -> bool:
        return True

    def result(self) -> Recommendation:
        return self.advice


def at_once(work: Callable[[], Recommendation]) -> Answer:
    return Done(work())
