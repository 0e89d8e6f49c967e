from dataclasses import dataclass, field

import numpy as np

from deconflict.foresight.forecast_errors.error_ledger import HALF_LIFE_S, Ledger
from deconflict.foresight.learned_estimates import LearnedErrors
from deconflict.foresight.rollout.start_times import StartTimes
from ingest.batch import Basis, Floats
from tests.deconflict.foresight.forecast_errors.made_errors import off

NOW_S = 1_790_000_000.0


@dataclass
class Learning:
    """The two ledgers and the starts."""

    ledger: Ledger = field(default_factory=Ledger)
    following: Ledger = field(default_factory=Ledger)
    start_times: StartTimes = field(default_factory=StartTimes)

    @property
    def errors(self) -> LearnedErrors:
        return LearnedErrors(self.ledger, self.following, self.start_times)

    def record(self, model: str, errors_m: Floats, at_s: float | None = None, following: bool = True) -> int:
        """Add a kind with these errors a second ahead. Returns its row."""
        at_s = NOW_S + 2.0 * len(self.ledger.kinds) if at_s is None else at_s
        row = self.ledger.row("Alder", model, Basis.PATH, at_s)
        self.following.add_kinds(self.ledger, at_s)
        for ledger in (self.ledger, self.following) if following else (self.ledger,):
            ledger.record(off(row, 1, errors_m, np.zeros(len(errors_m)), ledger.bands_m[row, 0]), at_s)
        return row

    def started(self, row: int, after_s: float) -> None:
        """Forty robots of a kind start after they have stood for a time."""
        kind, free = np.full(40, row), np.zeros(40, np.bool_)
        for second in range(round(after_s)):
            started = np.full(40, float(second == after_s - 1))
            self.start_times.record(kind, free, np.full(40, float(second)), np.ones(40), started, NOW_S)

    def resumed(self) -> "Learning":
        after = Learning()
        after.errors.resume(self.errors.learned())
        return after


def test_kept_errors_fade_by_their_time_stamps_over_a_restart() -> None:
    learning = Learning()
    row = learning.record("A-7", np.ones(8))
    ledger = learning.resumed().ledger
    ledger.record(off(row, 2, np.ones(1), np.zeros(1), ledger.bands_m[row, 1]), NOW_S + HALF_LIFE_S)
    assert np.allclose(ledger.cases[row, :2], [4.0, 1.0])


def test_a_kind_of_which_nothing_is_left_is_not_kept() -> None:
    learning = Learning()
    for model, at_s in (("A-7", NOW_S), ("A-8", NOW_S + 20 * HALF_LIFE_S)):
        learning.record(model, np.ones(100), at_s)
    resumed = learning.resumed()
    assert [kind.model for kind in resumed.ledger.kinds] == ["A-8"]
    assert resumed.ledger.bands_m[0].tolist() == learning.ledger.bands_m[1].tolist()


def test_every_kind_has_its_own_bands_and_starts_after_a_restart_whichever_kinds_were_left_out() -> None:
    learning = Learning()
    learning.record("faded", np.zeros(0))
    stands = learning.record("never follows", np.full(100, 0.2), following=False)
    wild, exact = learning.record("wild", np.full(100, 3.0)), learning.record("exact", np.full(100, 0.01))
    for row, after_s in ((stands, 2.0), (wild, 30.0), (exact, 4.0)):
        learning.started(row, after_s)
    after = learning.resumed()
    assert list(after.ledger.kinds) == list(after.following.kinds) == list(learning.ledger.kinds)[1:]
    after.ledger.row("Alder", "new", Basis.PATH, NOW_S)
    after.following.add_kinds(after.ledger, NOW_S)
    assert after.following.kinds == after.ledger.kinds
    for kind, row in after.ledger.kinds.items():
        if kind.model != "new":
            before = learning.ledger.kinds[kind]
            assert after.ledger.bands_m[row].tolist() == learning.ledger.bands_m[before].tolist()
            assert after.following.bands_m[row].tolist() == learning.following.bands_m[before].tolist()
            assert after.start_times.counts[row].tolist() == learning.start_times.counts[before].tolist()
