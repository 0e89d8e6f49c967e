"""Questions that other threads or processes answer. A replay gives each answer at the same pass."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Protocol

from deconflict_client.advisory import Recommendation
from ingest.batch import Pair
from ingest.measures.measures import Measures

ANSWER_AFTER_S = 0.5
"""An answer is given in the first pass this long after its question, even if it was computed sooner."""


class PairAdvice(dict[Pair, Recommendation]):
    """The advice for each conflict of a group."""


Answer = Recommendation | PairAdvice


class PendingAnswer(Protocol):
    """An answer that may still be in computation."""

    def done(self) -> bool: ...

    def result(self) -> Answer: ...


Submit = Callable[[Callable[[], Answer]], PendingAnswer]
"""Starts the computation of an answer, as `concurrent.futures.Executor.submit` does."""


@dataclass(slots=True)
class AdviceQuestion:
    """A question, until its answer is given."""

    asked_s: float = -inf
    answer: PendingAnswer | None = None
    """None once it was given, or dropped."""
    late: bool = False
    """Whether the answer was not ready when it was due."""

    def is_due(self, now_s: float) -> bool:
        return self.answer is not None and now_s - self.asked_s >= ANSWER_AFTER_S

    def take_answer(self, measures: Measures) -> Answer | None:
        """The answer, which is given only once. None if it is not ready, which is counted once."""
        answer = self.answer
        if answer and answer.done():
            self.answer = None
            return answer.result()
        if not self.late:
            self.late = True
            measures.count("deconflict_advice_late_total")
        return None


@dataclass(frozen=True, slots=True)
class ReadyAnswer:
    """An answer that was computed at once."""

    advice: Answer

    def done(self) -> bool:
        return True

    def result(self) -> Answer:
        return self.advice


def answer_at_once(question: Callable[[], Answer]) -> PendingAnswer:
    return ReadyAnswer(question())


class AsyncAnswers:
    """Answers in the order of their questions.

    The number of unanswered questions is fixed before each pass, and recorded. A replay gives each answer at the same
    pass.
    """

    def __init__(self, submit: Submit) -> None:
        self._submit = submit
        self._asked, self._ready = 0, 0
        """How many questions there were, and how many of them, the oldest first, count as answered."""
        self._under_way: deque[PendingAnswer] = deque()

    def submit(self, question: Callable[[], Answer]) -> PendingAnswer:
        answer = self._submit(question)
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
        """Treat the newest `pending` questions as unanswered until the next call."""
        self._ready = self._asked - pending

    def is_ready(self, number: int) -> bool:
        return number <= self._ready


@dataclass(frozen=True, slots=True)
class NumberedAnswer:
    """The answer to question `number`; it is done once `answers` counts it as answered."""

    answers: AsyncAnswers
    number: int
    answer: PendingAnswer

    def done(self) -> bool:
        return self.answers.is_ready(self.number)

    def result(self) -> Answer:
        return self.answer.result()
