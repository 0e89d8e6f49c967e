"""The service decides over the kept logs what it decided when they were kept."""

import pytest

from benchmarks.decisions.compared import changes, intended, is_within_limit, read_kept, with_situations
from benchmarks.decisions.decided import decided
from benchmarks.decisions.kept_logs import KEPT_LOGS, KeptLog


@pytest.mark.slow
@pytest.mark.parametrize("log", KEPT_LOGS, ids=lambda log: log.name)
def test_decisions_are_those_that_were_kept(log: KeptLog) -> None:
    if not (file := log.file()):
        pytest.skip("the recordings are not here; set DECONFLICT_RECORDINGS")
    kept = read_kept(log.name)
    today, _ = decided(file, log.site(), log.clearance_m)
    changed = changes(kept, today)
    reasons = intended(log.name)
    assert [change for change in changed if change.key not in reasons] == []
    assert is_within_limit(changed, kept)


def test_a_change_is_found_whatever_it_is() -> None:
    kept = {
        "conflict a b #1 at 1": "raised caution 0.3 0.2 0.1",
        "conflict a b #1 at 2": "cleared caution 0.3 0.2 0.1",
        "pair a b": "3 looks 0.500000000",
        "lost in all": "losses=2 lost_s=3.0",
    }
    assert changes(kept, dict(kept)) == []
    assert changes(kept, kept | {"pair a b": "3 looks 0.500000900"}) == []
    others = {
        "conflict a b #1 at 1": "raised warning 0.3 0.2 0.1",
        "pair a b": "3 looks 0.500001100",
        "lost in all": "losses=2 lost_s=3.1",
        "conflict a c #1 at 1": "raised caution None None None",
    }
    changed = changes(kept, {**kept, **others})
    assert {change.key: change.today for change in changed} == others
    assert [change.today for change in changes(kept, {})] == [None] * 4


def test_situations_are_kept_anew_and_nothing_else() -> None:
    kept = {"situation a b from 1 at 1": "raised", "pair a b": "3 looks 0.5"}
    today = {"situation a c from 1 at 1": "raised", "pair a b": "4 looks 0.5"}
    assert with_situations(kept, today) == {"situation a c from 1 at 1": "raised", "pair a b": "3 looks 0.5"}


def test_a_log_may_change_by_a_hundredth() -> None:
    kept = {str(number): "" for number in range(200)}
    two = changes(kept, kept | {"0": "x", "1": "x"})
    assert is_within_limit(two, kept)
    assert not is_within_limit(changes(kept, kept | {"0": "x", "1": "x", "2": "x"}), kept)
