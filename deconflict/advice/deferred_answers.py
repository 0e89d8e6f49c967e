"""Questions whose answers are worked out elsewhere, and given at event times, so that a replay gives the same ones."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from deconflict.advisory import Recommendation

ANSWER_AFTER_S = 0.5
"""An answer is given in the first pass so long after its question, even if it was worked out sooner."""


class PendingAnswer(Protocol):
    """An answer that is being worked out."""

    def done(self) -> bool: ...

    def result(self) -> Recommendation: ...


Submit = Callable[[Callable[[], Recommendation]], PendingAnswer]
"""Has a question worked out, as `concurrent.futures.Executor.submit` does."""


@dataclass(frozen=True, slots=True)
class ReadyAnswer:
    """An answer that was worked out at once."""

    advice: Recommendation

    def done(self) -> bool:
        return True

    def result(self) -> Recommendation:
        return self.advice


def answer_at_once(question: Callable[[], Recommendation]) -> PendingAnswer:
    return ReadyAnswer(question())


class AsyncAnswers:
    """Answers in the order of their questions.

    How many answers were ready at a pass is settled before it, and recorded: an answer that came late comes as late in
    a replay.
    """

    def __init__(self, submit: Submit) -> None:
        self._work_out = submit
        self._asked, self._ready = 0, 0
        """How many questions there were, and how many of the first of them count as answered."""
        self._under_way: deque[PendingAnswer] = deque()

    def submit(self, question: Callable[[], Recommendation]) -> PendingAnswer:
        answer = self._work_out(question)
        self._asked += 1
        if not answer.done():
            self._under_way.append(answer)
        return NumberedAnswer(self, self._asked, answer)

    def pending(self) -> int:
        """How many of the newest questions have no answer yet."""
        while self._under_way and self._under_way[0].done():
            self._under_way.popleft()
        return len(self._under_way)

    def set_pending(self, pending: int) -> None:
        """Let so many of the newest questions count as not answered until the next call."""
        self._ready = self._asked - pending

    def is_ready(self, number: int) -> bool:
        return number <= self._ready


@dataclass(frozen=True, slots=True)
class NumberedAnswer:
    """The answer to the question of a number; it is done once `answers` counts it as answered."""

    answers: AsyncAnswers
    number: int
    answer: PendingAnswer

    def done(self) -> bool:
        return self.answers.is_ready(self.number)

    def result(self) -> Recommendation:
        return self.answer.result()
