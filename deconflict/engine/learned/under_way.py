"""What an engine has under way at one pass, for a black box: forecasts that are not compared with reports yet, open
questions, and looks at pairs.

An engine that has made the passes before it has the same robots and pairs, and takes over the numbers.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from deconflict.advisories.watched.watched_pairs import WatchedPairs
from deconflict.foresight.forecast_errors.error_ledger import Ledger
from deconflict.foresight.forecast_errors.pending_forecasts import KEPT
from deconflict.foresight.forecast_errors.track_kernels import LONG_AGO_S, ReportHistory
from deconflict.foresight.keyed_tables import KeyedTable, keys_of
from deconflict.foresight.probability.estimator import ProbabilityEstimator
from deconflict.foresight.probability.outcome_learning import Question
from deconflict.foresight.probability.pair_table import FEATURES, PAIR
from deconflict.runtime.learned_state import Part, UnreadableError

WATCHED, FORECASTS, PLACES, PAIRS, ASKED = "watched", "forecasts", "places", "pairs", "asked "
NEXT = "next_index"
OF_ROBOT = "surprise", "stood_since_s"
"""The columns of a robot that remember more than its newest report."""


def under_way(estimator: ProbabilityEstimator, watched: WatchedPairs) -> dict[str, Part]:
    """A copy of what is under way."""
    parts = {name: table.part() for name, table in _tables(estimator, watched)}
    parts[PLACES] = _places(estimator.pending.history, estimator.robots.by_uuid).part()
    for question in estimator.learning.questions.open:
        parts[f"{ASKED}{round(question.asked_s * 1e6)}"] = _of_question(estimator, question).part()
    return parts


def take_over(parts: Mapping[str, Part], estimator: ProbabilityEstimator, watched: WatchedPairs) -> dict[str, str]:
    """Go on with what was under way. Returns the parts with which this does not go on, each with the reason."""
    set_aside: dict[str, str] = {}
    try:
        watched.watch_only({(key[0], key[-1]) for key in keys_of(parts.get(WATCHED, {}))})
        estimator.learning.questions.open = _questions(parts, estimator)
        _leave_others(parts, estimator)
    except UnreadableError as error:
        set_aside[ASKED] = str(error)
    for name, table in _tables(estimator, watched):
        try:
            table.fill(parts.get(name, {}))
        except UnreadableError as error:
            set_aside[name] = str(error)
    return set_aside


def _leave_others(parts: Mapping[str, Part], estimator: ProbabilityEstimator) -> None:
    """Forget forecasts and pairs that are not in the parts, and keep forecasts in the same order as there.

    Errors of forecasts count in this order.
    """
    robots, pending = estimator.robots, estimator.pending
    table = _of_forecasts(pending.history, robots.by_uuid)
    table.columns["made_s"][table.rows_not_in(parts.get(FORECASTS, {}))] = LONG_AGO_S
    places = _places(pending.history, robots.by_uuid)
    turned = places._replace(columns={NEXT: pending.history.next_index.copy()})
    turned.fill(parts.get(PLACES, {}))
    pending.turn(turned.columns[NEXT])
    pairs = KeyedTable(robots.pair_names(estimator.pairs["code"]), range(len(estimator.pairs)), {})
    estimator.pairs = np.delete(estimator.pairs, pairs.rows_not_in(parts.get(PAIRS, {})))


def _tables(estimator: ProbabilityEstimator, watched: WatchedPairs) -> Iterator[tuple[str, KeyedTable]]:
    robots, pairs = estimator.robots, estimator.pairs
    for name, ledger in (("errors", estimator.ledger), ("following", estimator.following)):
        yield name, _of_ledger(ledger)
        yield f"{name} read", KeyedTable([(name,)], [0], {"refreshed_s": ledger.refreshed_s})
    slots = robots.by_uuid
    columns = {name: robots.records[name] for name in OF_ROBOT}
    yield "robots", KeyedTable([(uuid,) for uuid in slots], list(slots.values()), columns)
    yield "followers", estimator.followers.table(slots)
    yield FORECASTS, _of_forecasts(estimator.pending.history, slots)
    columns = {name: pairs[name] for name in PAIR.names or () if name != "code"}
    yield PAIRS, KeyedTable(robots.pair_names(pairs["code"]), range(len(pairs)), columns)
    yield WATCHED, watched.table()


def _of_ledger(ledger: Ledger) -> KeyedTable:
    """The bands as they were last read, and since when there are others."""
    keys = [(kind.vendor, kind.model, kind.basis.name) for kind in ledger.kinds]
    return KeyedTable(keys, range(len(keys)), {"bands_m": ledger.bands_m, "stale": ledger.stale})


def _of_forecasts(history: ReportHistory, slots: Mapping[str, int]) -> KeyedTable:
    """The bands of each kept forecast when it was made."""
    keys, rows = list[tuple[str, str]](), list[int]()
    for uuid, slot in slots.items():
        row = int(history.row[slot])
        for at, made_s in enumerate(history.made_s[row].tolist() if row >= 0 else ()):
            if made_s > LONG_AGO_S:
                keys.append((uuid, repr(made_s)))
                rows.append(row * KEPT + at)
    columns = {"bands_m": history.bands_m.reshape(-1, *history.bands_m.shape[2:]), "made_s": history.made_s.reshape(-1)}
    return KeyedTable(keys, rows, columns)


def _places(history: ReportHistory, slots: Mapping[str, int]) -> KeyedTable:
    """Where the next forecast of each robot comes among the kept ones."""
    kept = {uuid: int(history.row[slot]) for uuid, slot in slots.items() if history.row[slot] >= 0}
    return KeyedTable([(uuid,) for uuid in kept], list(kept.values()), {NEXT: history.next_index})


def _of_question(estimator: ProbabilityEstimator, question: Question) -> KeyedTable:
    keys = estimator.robots.pair_names(question.code)
    return KeyedTable(keys, range(len(keys)), {"features": question.features})


def _questions(parts: Mapping[str, Part], estimator: ProbabilityEstimator) -> list[Question]:
    """The questions that were open, about robots that are there. Raises `UnreadableError`."""
    slots, found = estimator.robots.by_uuid, list[Question]()
    for name in (name for name in parts if name.startswith(ASKED)):
        pairs = [[slots[uuid] for uuid in key if uuid in slots] for key in keys_of(parts[name])]
        code = np.array(sorted({estimator.robots.pair_code(*pair) for pair in pairs if len({*pair}) == 2}), np.int64)
        question = Question(_seconds(name), code, np.zeros((len(code), FEATURES)))
        _of_question(estimator, question).fill(parts[name])
        found.append(question)
    return sorted(found, key=lambda question: question.asked_s)


def _seconds(name: str) -> float:
    try:
        return int(name.removeprefix(ASKED)) / 1e6
    except ValueError as error:
        raise UnreadableError("a question has no time") from error
