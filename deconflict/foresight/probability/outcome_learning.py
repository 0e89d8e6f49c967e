"""What happened to the watched pairs, and learning from it.

At each whole second a question is asked: which pairs meet within the horizon? It is answered from the robots' own
reports once the horizon is over. The calibrations learn from the answers.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import floor
from typing import NamedTuple

import numba
import numpy as np

from deconflict.foresight.probability.calibration import CONTACT, Calibration, contact_features
from deconflict.foresight.probability.censoring import CensoredOutcomes, outcomes_of
from deconflict.foresight.probability.pair_table import PAIR, Pairs, has_robot_of
from deconflict.foresight.probability.tracked_robots import TrackedRobots
from ingest.batch import Bools, Floats, Ints
from ingest.kernels import FLOAT, FLOATS, INT, kernel
from ingest.measures.measures import Measures

_PAIRS = numba.from_dtype(PAIR)[::1]
_CODES = numba.types.Array(INT, 1, "A", readonly=True)

OwnUntil = Callable[[Ints, float], Floats]
"""Takes pairs `code` (p,), ascending, and the time of their question. Returns until when both robots of each were heard
and drove unadvised, (p,); -inf for a pair of which one did not when the question was asked."""


@dataclass(slots=True, eq=False)
class Question:
    """The pairs of one whole second whose outcome is not known yet."""

    asked_s: float
    code: Ints
    """(p,) ascending."""
    features: Floats
    """(p, FEATURES) of that second."""


class AnsweredQuestion(NamedTuple):
    """The known outcomes of the pairs of one question."""

    asked_s: float
    code: Ints
    """(p,)"""
    features: Floats
    """(p, FEATURES)"""
    interacted: CensoredOutcomes
    """Whether the two got in each other's way."""
    touched: CensoredOutcomes
    """Whether they came within the clearance."""


@kernel((_PAIRS, _CODES, FLOATS, *[FLOAT] * 2))
def _ended(
    pairs: Pairs, asked: Ints, until_s: Floats, asked_s: float, horizon_s: float
) -> tuple[Ints, Floats, Bools, Floats, Bools]:
    """The outcomes of the pairs `asked` (n,), ascending codes, within the horizon of the question.

    Returns for the m pairs whose outcome is known: their rows of `asked` (m,); when the two got in each other's way, or
    else the end of observation by `until_s` (n,), and whether they did, (m,) each; and the same two arrays of
    coming within the clearance.

    Left out are pairs that were in an encounter, or gave way, when asked, and pairs of one vendor of which it is not
    known whether an order of their fleet explains what they did. A pair that is no longer in the table did not meet.
    """
    kept, n, row = np.empty(len(asked), np.int64), 0, 0
    ended_s, touched_s = np.empty(len(asked)), np.empty(len(asked))
    met, touched = np.empty(len(asked), np.bool_), np.empty(len(asked), np.bool_)
    for at, code in enumerate(asked):
        while row < len(pairs) and pairs[row].code < code:
            row += 1
        started_s = last_within_s = yielded_s = yield_end_s = uncertain_s = -np.inf
        if row < len(pairs) and pairs[row].code == code:
            pair = pairs[row]
            started_s, last_within_s, uncertain_s = pair.started_s, pair.last_within_s, pair.uncertain_s
            yielded_s, yield_end_s = pair.yielded_s, pair.yield_end_s
        last_s = until_s[at]
        until_end_s = min(asked_s + horizon_s, last_s)
        was_in_encounter = not (started_s > asked_s or last_within_s < asked_s)
        if was_in_encounter or yielded_s <= asked_s < yield_end_s or last_s == -np.inf:
            continue
        touched[n] = asked_s < started_s <= until_end_s
        yielded = asked_s < yielded_s <= until_end_s
        if asked_s < uncertain_s <= until_end_s and not (touched[n] or yielded):
            continue
        kept[n], met[n] = at, touched[n] or yielded
        touched_s[n] = ended_s[n] = started_s if touched[n] else last_s
        if yielded:
            ended_s[n] = min(ended_s[n], yielded_s)
        n += 1
    return kept[:n].copy(), ended_s[:n].copy(), met[:n].copy(), touched_s[:n].copy(), touched[:n].copy()


@dataclass(slots=True, eq=False)
class OpenQuestions:
    """Questions of which not all answers are known yet."""

    horizon_s: float
    waits_s: float = 6.0
    """Time after the horizon for late reports, and until it shows that a robot gave way."""
    open: list[Question] = field(default_factory=list)
    _settled: list[AnsweredQuestion] = field(default_factory=list)
    """Answers that were known before the time of their question was over."""

    def ask(self, asked_s: float, code: Ints, features: Floats) -> None:
        """Ask for the outcomes of the pairs `code` (p,), which have these features (p, FEATURES)."""
        self.open.append(Question(asked_s, code, features))

    def resolve_left(self, slots: Ints, pairs: Pairs, own_until_s: OwnUntil, *, were_present: bool = True) -> None:
        """Answer the open questions about robots of `slots` now: other robots may have these slots later.

        If the robots `were_present` until now, the outcome of a pair that has not met by now is unknown. If they were
        absent since they were last heard, the two did not get in each other's way.
        """
        for question in self.open:
            rows = has_robot_of(question.code, slots)
            if rows.any():
                settled = Question(question.asked_s, question.code[rows], question.features[rows])
                self._settled.append(self._answer(settled, pairs, own_until_s, were_present))
                question.code, question.features = question.code[~rows], question.features[~rows]

    def answered(self, now_s: float, pairs: Pairs, own_until_s: OwnUntil) -> list[AnsweredQuestion]:
        """Remove and return the questions whose time is over, with the outcomes of their pairs. See `_ended` for the
        pairs that are left out."""
        answers, self._settled = self._settled, []
        while self.open and self.open[0].asked_s + self.horizon_s + self.waits_s <= now_s:
            question = self.open.pop(0)
            answers.append(self._answer(question, pairs, own_until_s))
        return answers

    def _answer(
        self, question: Question, pairs: Pairs, own_until_s: OwnUntil, were_present: bool = True
    ) -> AnsweredQuestion:
        asked_s, until_s = question.asked_s, own_until_s(question.code, question.asked_s)
        kept, ended_s, met, touched_s, touched = _ended(pairs, question.code, until_s, asked_s, self.horizon_s)
        ended_s = ended_s if were_present else np.where(met, ended_s, np.inf)
        interacted = outcomes_of(ended_s - asked_s, met, self.horizon_s)
        contacts = outcomes_of(touched_s - asked_s, touched, self.horizon_s)
        return AnsweredQuestion(asked_s, question.code[kept], question.features[kept], interacted, contacts)


class OutcomeLearning:
    """Asks about the watched pairs once a second, and has the calibrations learn from the answers."""

    def __init__(self, horizon_s: float, measures: Measures) -> None:
        self.calibration = Calibration()
        """Of getting in each other's way."""
        self.contact = Calibration(CONTACT)
        """Of coming within the clearance alone."""
        self.questions, self._measures = OpenQuestions(horizon_s), measures
        self._asked_s = float("-inf")

    def is_due(self, now_s: float) -> bool:
        """Whether a new whole second has begun, for which no question was asked yet."""
        return floor(now_s) > self._asked_s

    def ask(self, now_s: float, code: Ints, features: Floats) -> None:
        """Ask for the outcomes of the pairs `code` (p,), which have these features (p, FEATURES) now."""
        self._asked_s = floor(now_s)
        self.questions.ask(now_s, code, features)

    def learn(self, now_s: float, pairs: Pairs, own_until_s: OwnUntil, robots: TrackedRobots) -> None:
        """Learn from the questions that can be answered now."""
        for answer in self.questions.answered(now_s, pairs, own_until_s):
            vendors, for_all = robots.pair_vendors(answer.code), robots.count_for_all(answer.code)
            self.calibration.learn(answer.features, vendors, answer.interacted, for_all, now_s)
            self.contact.learn(contact_features(answer.features), vendors, answer.touched, for_all, now_s)
            outcomes = answer.interacted
            passed = ~outcomes.met & ~outcomes.left
            for label, is_so in (("met", outcomes.met), ("passed", passed), ("left", outcomes.left)):
                self._measures.count("deconflict_probability_outcomes_total", label, by=int(np.count_nonzero(is_so)))
