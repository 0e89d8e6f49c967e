"""The thread that works out advice, so that no pass of an engine waits for it."""

import logging
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from deconflict.advice.deferred_answers import Answer, PendingAnswer
from deconflict_client.advisory import Recommendation
from ingest.measures.measures import Measures

NO_ADVICE = Recommendation(cost_s=0.0, bound_s=0.0, proven_optimal=False, note="no advice could be worked out")

log = logging.getLogger(__name__)


class AdviceThread:
    """Answers questions in order. One that fails has no advice, and ends nothing."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "adviser")
        self._solved_s: deque[float] = deque()
        """Durations of solves since the last count. The thread appends."""
        self._failed: deque[Exception] = deque()
        """Errors of solves since the last count. The thread appends."""

    def submit(self, question: Callable[[], Answer]) -> PendingAnswer:
        return self._thread.submit(self._answer, question)

    def count(self, measures: Measures) -> None:
        """Count what was worked out since the last call, and what failed."""
        failed = [self._failed.popleft() for _ in range(len(self._failed))]
        measures.count("deconflict_advice_failures_total", by=len(failed))
        solved_s = [self._solved_s.popleft() for _ in range(len(self._solved_s))]
        measures.observe("deconflict_advice_solve_seconds", solved_s)

    def end(self) -> None:
        self._thread.shutdown(cancel_futures=True)

    def _answer(self, question: Callable[[], Answer]) -> Answer:
        began_s = time.perf_counter()
        try:
            advice = question()
        except Exception as error:
            log.exception("the solver failed; conflicts are published without advice")
            self._failed.append(error)
            return NO_ADVICE
        self._solved_s.append(time.perf_counter() - began_s)
        return advice
