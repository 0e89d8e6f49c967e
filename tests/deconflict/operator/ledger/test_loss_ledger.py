"""The ledger of lost time."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from threading import Event, Thread

import pytest

from deconflict.operator.ledger.ledger_formats import UPGRADES
from deconflict.operator.ledger.loss_ledger import FILE_NAME, LossLedger
from deconflict.operator.ledger.loss_questions import DAY_S, HOUR_S
from deconflict.settings.site import LossSettings
from deconflict_client.answers.loss_models import LossRow
from tests.deconflict.operator.ledger.made_entries import CROSSED, LATER, QUEUED, REFUSED, START_S, question


@pytest.fixture
def ledger(tmp_path: Path) -> Iterator[LossLedger]:
    with closing(LossLedger(tmp_path, LossSettings())) as opened:
        yield opened


def lost(rows: list[LossRow], key: str) -> dict[object, float]:
    return {row.model_dump()[key]: row.lost_s for row in rows}


def test_losses_are_summed_by_any_key(ledger: LossLedger) -> None:
    ledger.add("engine", 1, [QUEUED, CROSSED, LATER])
    assert lost(ledger.ask(question("vendor")).rows, "vendor") == {"Alder": 11.0, "Corvid": 5.0}
    assert lost(ledger.ask(question("hour")).rows, "hour") == {START_S: 11.0, START_S + HOUR_S: 5.0}
    assert lost(ledger.ask(question("cell")).rows, "cell") == {(5.0, 7.0): 16.0}
    total = ledger.ask(question()).total
    assert (total.lost_s, total.over_usual_s, total.sure_s, total.losses) == (16.0, 14.5, 13.0, 3)
    assert (total.warned_s, total.advised_s, total.heeded_s) == (16.0, 13.0, 5.0)


def test_the_time_that_refusals_cost_is_no_further_loss(ledger: LossLedger) -> None:
    ledger.add("engine", 1, [QUEUED, CROSSED, REFUSED, REFUSED])
    total = ledger.ask(question(by="Basalt")).total
    assert (total.refusals, total.refused_s, total.unable, total.unable_s) == (4, 140.0, 2, 24.0)
    assert (total.lost_s, total.sure_s, total.losses) == (3.0, 0.0, 1)


def test_filters_and_the_span_leave_others_out(ledger: LossLedger) -> None:
    ledger.add("engine", 1, [QUEUED, CROSSED, LATER])
    assert ledger.ask(question(by="Basalt")).total.lost_s == 3.0
    assert ledger.ask(question(place="Aisle 3", vendor="Alder")).total.lost_s == 8.0
    assert ledger.ask(question(from_s=START_S + HOUR_S + 10.0)).total.lost_s == 5.0


def test_new_losses_do_not_wait_for_a_question(ledger: LossLedger) -> None:
    ledger.add("engine", 1, [QUEUED, CROSSED, LATER])
    is_asking, is_added = Event(), Event()

    def wait_for_losses() -> int:
        if not is_asking.is_set():
            is_asking.set()
            is_added.wait(5)
        return 0

    ledger._reader.set_progress_handler(wait_for_losses, 1)
    asking = Thread(target=ledger.ask, args=(question("vendor"),))
    asking.start()
    assert is_asking.wait(10)
    ledger.add("engine", 2, [QUEUED])
    assert asking.is_alive()
    is_added.set()
    asking.join()
    assert ledger.ask(question()).total.losses == 4


def test_a_parcel_that_comes_twice_counts_once(ledger: LossLedger) -> None:
    ledger.add("engine", 1, [QUEUED])
    ledger.add("engine", 1, [QUEUED])
    ledger.add("another engine", 1, [QUEUED])
    assert ledger.ask(question()).total.losses == 2


def test_an_hour_of_a_model_costs_what_the_site_says_or_what_its_vendor_costs(ledger: LossLedger) -> None:
    ledger.settings = LossSettings(currency="EUR", cost_per_robot_hour={"Alder": 3600.0, "Alder/A200": 7200.0})
    ledger.add("engine", 1, [QUEUED, QUEUED._replace(model="A200"), LATER])
    found = ledger.ask(question("vendor"))
    assert {row.model_dump()["vendor"]: row.cost for row in found.rows} == {"Alder": 24.0, "Corvid": None}
    assert (found.total.cost, found.currency) == (24.0, "EUR")


def test_the_ledger_outlives_a_restart(tmp_path: Path) -> None:
    for number in (1, 2):
        with closing(LossLedger(tmp_path, LossSettings())) as opened:
            opened.add("engine", number, [QUEUED])
    with closing(LossLedger(tmp_path, LossSettings())) as opened:
        assert opened.ask(question()).total.lost_s == 16.0


def test_hours_are_removed_if_they_are_old_or_too_many(ledger: LossLedger) -> None:
    ledger.add("engine", 1, [QUEUED, LATER])
    ledger.settings = LossSettings(keep_days=1.0)
    assert ledger.prune(START_S + DAY_S + 1.0) == 1
    assert ledger.ask(question()).total.lost_s == 5.0
    ledger.settings = LossSettings(most_bytes=1)
    assert ledger.prune(START_S) == 1


def test_hours_of_a_wrong_clock_do_not_make_newer_ones_go_first(ledger: LossLedger) -> None:
    """Those of a clock that was ahead were written earlier; while it is ahead they are the newest."""
    ahead = QUEUED._replace(from_s=START_S + 30 * DAY_S)
    ledger.add("engine", 1, [QUEUED])
    ledger.add("engine", 2, [ahead])
    ledger.settings = LossSettings(most_bytes=1)
    removed = list[float]()
    ledger._db.create_function("note", 1, removed.append)
    ledger._db.execute("CREATE TEMP TRIGGER removal DELETE ON main.losses BEGIN SELECT note(OLD.hour_s); END")
    assert ledger.prune(0.0) == 2
    ledger.add("engine", 3, [ahead])
    ledger.add("engine", 4, [QUEUED, LATER])
    assert ledger.prune(0.0) == 3
    assert [(hour_s - START_S) / HOUR_S for hour_s in removed] == [0.0, 720.0, 720.0, 0.0, 1.0]


def test_a_damaged_file_is_set_aside(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_bytes(b"no database at all" * 100)
    with closing(LossLedger(tmp_path, LossSettings())) as opened:
        opened.add("engine", 1, [QUEUED])
        assert opened.ask(question()).total.losses == 1
    assert len(list(tmp_path.glob("losses-*.db"))) == 1


def test_a_ledger_of_the_first_format_is_upgraded(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as db, db:
        for statement in UPGRADES[0]:
            db.execute(statement)
        row = (START_S, "Alder", "A100", "Corvid", "Basalt", "queue", "hall", "", 2, 3, 9.0, 4.0, 1)
        db.execute(f"INSERT INTO losses VALUES ({', '.join('?' * len(row))})", row)  # noqa: S608 - constants
    with closing(LossLedger(tmp_path, LossSettings())) as opened:
        opened.add("engine", 1, [QUEUED])
        total = opened.ask(question()).total
        assert opened.ask(question()).begun_s == START_S
    assert (total.lost_s, total.over_usual_s, total.warned_s, total.losses) == (17.0, 15.0, 8.0, 2)
    assert (total.refusals, total.unable_s) == (0, 0.0)


def test_the_ledger_knows_when_its_first_loss_began(tmp_path: Path) -> None:
    with closing(LossLedger(tmp_path, LossSettings())) as opened:
        assert opened.ask(question()).begun_s is None
        opened.add("engine", 1, [QUEUED._replace(from_s=START_S + 700.0), QUEUED._replace(from_s=START_S + 600.0)])
    with closing(LossLedger(tmp_path, LossSettings())) as opened:
        opened.add("engine", 2, [QUEUED._replace(from_s=START_S + 800.0)])
        assert opened.ask(question()).begun_s == START_S + 600.0


def test_a_ledger_of_a_newer_release_is_refused_and_left_alone(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as db:
        db.execute("PRAGMA user_version = 99")
    with pytest.raises(sqlite3.OperationalError, match="newer release"):
        LossLedger(tmp_path, LossSettings())
    assert [path.name for path in tmp_path.glob("*.db")] == [FILE_NAME]


def test_a_ledger_that_can_t_be_opened_says_so(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).mkdir()
    with pytest.raises(sqlite3.Error):
        LossLedger(tmp_path, LossSettings())
