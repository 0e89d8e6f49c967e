"""The ledger of a service: nothing waits for its file."""

import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, closing
from pathlib import Path

import pytest

from benchmarks.faulty_files.faults import blocked, held_alone, locked, remove
from deconflict.operator.ledger.loss_ledger import FILE_NAME, LossLedger, LossParcel
from deconflict.operator.ledger.optional_ledger import DROPPED, OptionalLedger
from deconflict.settings.site import LossSettings
from ingest.measures.measures import Measures
from tests.deconflict.operator.ledger.made_entries import CROSSED, QUEUED, question
from tests.deconflict.roles.made_disks import disk_that_can_stick, stuck
from tests.helpers.patience import PATIENCE_S

Harm = Callable[[Path], AbstractContextManager[None]]


@pytest.fixture
def measures() -> Measures:
    return Measures()


@pytest.fixture
def ledger(tmp_path: Path, measures: Measures) -> Iterator[OptionalLedger]:
    with closing(LossLedger(tmp_path, LossSettings())) as before:
        before.add("engine", 1, [QUEUED])
    with closing(OptionalLedger(tmp_path, LossSettings(), measures)) as opened:
        yield opened


@pytest.mark.parametrize("harm", [locked, held_alone, blocked])
def test_losses_wait_for_a_file_that_cannot_be_used(tmp_path: Path, ledger: OptionalLedger, harm: Harm) -> None:
    with harm(tmp_path / FILE_NAME):
        ledger.add(LossParcel("engine", 2, [QUEUED, CROSSED]))
        ledger.store()
        assert ledger.outage
        with pytest.raises(sqlite3.Error):
            ledger.last_parcel()
    ledger.store()
    assert ledger.outage is None
    ledger.add(LossParcel("engine", 2, [QUEUED]))
    ledger.store()
    assert ledger.ask(question()).total.losses == 3, "a parcel that comes twice counts once"


def test_a_file_that_is_removed_is_begun_anew(tmp_path: Path, ledger: OptionalLedger) -> None:
    ledger.store()
    remove(tmp_path / FILE_NAME)
    ledger.add(LossParcel("engine", 2, [CROSSED]))
    ledger.store()
    assert ledger.ask(question()).total.losses == 1
    with closing(LossLedger(tmp_path, LossSettings())) as again:
        assert again.ask(question()).total.losses == 1


def test_what_waits_is_bounded_and_counted(
    tmp_path: Path, ledger: OptionalLedger, measures: Measures, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("deconflict.operator.ledger.optional_ledger.MOST_WAITING", 3)
    with blocked(tmp_path / FILE_NAME):
        for number in (2, 3):
            ledger.add(LossParcel("engine", number, [QUEUED, CROSSED]))
        ledger.store()
    assert measures.values[DROPPED] == {(): 2}
    ledger.store()
    assert ledger.ask(question()).total.losses == 3


def test_a_loss_that_cannot_be_written_holds_up_no_other(ledger: OptionalLedger, measures: Measures) -> None:
    ledger.add(LossParcel("engine", 2, [QUEUED._replace(x_m=float("nan"))]))
    ledger.add(LossParcel("engine", 3, [CROSSED]))
    ledger.store()
    assert ledger.ask(question()).total.losses == 2
    assert measures.values[DROPPED] == {(): 1}


def test_a_ledger_ends_although_its_disk_does_not_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("deconflict.operator.ledger.optional_ledger.OPEN_STUCK_S", 0.2)
    with disk_that_can_stick(tmp_path) as disk:
        other = OptionalLedger(disk, LossSettings(), Measures())
        other.store()
        other.add(LossParcel("engine", 1, [QUEUED]))
        ending = threading.Thread(target=other.close, daemon=True)
        with stuck(disk):
            ending.start()
            ending.join(PATIENCE_S)
            assert not ending.is_alive()
        assert "may be lost" in caplog.text
