"""A thread that works out advice, and what is counted of it."""

import pytest

from deconflict.advice.advice_thread import NO_ADVICE, AdviceThread
from deconflict.advice.deferred_answers import Answer, PairAdvice
from ingest.measures.measures import Measures


def fail() -> Answer:
    raise ZeroDivisionError


def test_a_solver_that_fails_gives_no_advice_and_is_counted(caplog: pytest.LogCaptureFixture) -> None:
    thread, measures = AdviceThread(), Measures()
    advice = PairAdvice()
    answers = [thread.submit(question).result() for question in (lambda: advice, fail)]
    thread.count(measures)
    thread.end()
    assert answers == [advice, NO_ADVICE]
    assert measures.values["deconflict_advice_failures_total"] == {(): 1}
    assert sum(measures.histograms["deconflict_advice_solve_seconds"][()].counts) == 1
    assert "the solver failed" in caplog.text
