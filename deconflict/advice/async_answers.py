"""Questions and answers: what is worked out aside, and given at event times, so that a replay gives the same advice."""

from collections import deque
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


class Aside:
    """What is worked out aside, in the order in which it was asked.

    What is there at a step is settled before it, and recorded: an answer that comes late is as late in a replay.
    """

    def __init__(self, submit: Submit) -> None:
        self._work = submit
        self._asked, self._there = 0, 0
        self._under_way: deque[Answer] = deque()

    def submit(self, work: Callable[[], Recommendation]) -> Answer:
        answer = self._work(work)
        self._asked += 1
        if not answer.done():
            self._under_way.append(answer)
        return Numbered(self, self._asked, answer)

    def pending(self) -> int:
        """How many answers, the newest, are not there yet."""
        while self._under_way and self._under_way[0].done():
            self._under_way.popleft()
        return len(self._under_way)

    def settle(self, pending: int) -> None:
        """So many, the newest, count as not there until this is said again."""
        self._there = self._asked - pending

    def has(self, number: int) -> bool:
        return number <= self._there


@dataclass(frozen=True, slots=True)
class Numbered:
    """One answer of those worked out aside."""

    aside: Aside
    number: int
    answer: Answer

    def done(self) -> bool:
        return self.aside.has(self.number)

    def result(self) -> Recommendation:
        return self.answer.result()
