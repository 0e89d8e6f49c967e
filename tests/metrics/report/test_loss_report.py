"""The report of lost time."""

import os
from contextlib import closing
from pathlib import Path

import pytest

from deconflict.__main__ import parser
from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.store.learned_file import FILE_NAME as LEARNED
from deconflict.settings.site import LossSettings
from metrics.replay_files import LogError
from tests.deconflict.operator.ledger.made_entries import CROSSED, LATER, QUEUED, REFUSED, START_S

SPAN = ("--until", "2027-01-17T00:00:00+00:00", "--days", "7")


def run(arguments: list[str]) -> int:
    args = parser().parse_args(arguments)
    return int(args.run(args))


@pytest.fixture
def data(tmp_path: Path) -> Path:
    with closing(LossLedger(tmp_path, LossSettings())) as ledger:
        ledger.add("engine", 1, [QUEUED._replace(place="<b>Aisle</b>"), CROSSED, LATER])
    return tmp_path


def test_the_report_has_the_sums_and_no_markup_of_names(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    site = data / "site.toml"
    site.write_text('[losses]\ncurrency = "EUR"\ncost_per_robot_hour = {Alder = 3600.0}\n')
    assert run(["losses", "--data", str(data), "--site", str(site), "--html", str(data / "w.html"), *SPAN]) == 0
    page = (data / "w.html").read_text()
    assert "&lt;b&gt;Aisle&lt;/b&gt;" in page
    assert "<td>8 s</td><td>50%</td><td>8.00 EUR</td>" in page
    assert (
        "robots and people lost 16 s to each other, which costs 11.00 EUR; of the time before nothing is known. "
        in page
    )
    assert "Of 16 s lost, 16 s were warned of before; for 13 s of them one of the two robots was advised" in page
    assert "robots and people lost 16 s" in capsys.readouterr().out


def test_the_report_says_what_to_change_or_why_nothing(data: Path) -> None:
    assert run(["losses", "--data", str(data), "--html", str(data / "w.html"), *SPAN]) == 0
    assert "<h2>What to change</h2><p>Nothing: too little time was lost yet" in (data / "w.html").read_text()
    with closing(LossLedger(data, LossSettings())) as ledger:
        crossings = [CROSSED._replace(place="Aisle 3", lost_s=30.0)] * 40
        ledger.add("engine", 2, crossings)
    assert run(["losses", "--data", str(data), "--html", str(data / "w.html"), *SPAN]) == 0
    page = (data / "w.html").read_text()
    page = (data / "w.html").read_text()
    assert "<li>Aisle 3: robots lose" in page
    assert "because robots cross without an order" in page
    assert "<code>deconflict whatif LOG --site SITE.toml --order &#x27;Aisle 3&#x27;</code>" in page


def test_hours_after_the_service_ended_do_not_count_as_hours_without_losses(data: Path) -> None:
    with closing(LossLedger(data, LossSettings())) as ledger:
        ledger.add("engine", 2, [CROSSED._replace(place="Aisle 3", lost_s=30.0)] * 40)
    (data / LEARNED).touch()
    os.utime(data / LEARNED, times=(START_S + 600.0, START_S + 600.0))
    assert run(["losses", "--data", str(data), "--html", str(data / "w.html"), *SPAN]) == 0
    page = (data / "w.html").read_text()
    assert "<li>Aisle 3: robots lose 120 min an hour (99% of all lost time; of 10 min only)" in page


def test_the_report_has_what_each_vendor_refused_and_could_not(data: Path) -> None:
    assert run(["losses", "--data", str(data), "--html", str(data / "w.html"), *SPAN]) == 0
    assert "<h2>Advice that was refused</h2><p>Nothing.</p>" in (data / "w.html").read_text()
    with closing(LossLedger(data, LossSettings())) as ledger:
        often = REFUSED._replace(by_vendor="<i>Often", refused_s=300.0, unable=0, unable_s=0.0)
        ledger.add("engine", 2, [REFUSED, often])
    assert run(["losses", "--data", str(data), "--html", str(data / "w.html"), *SPAN]) == 0
    page = (data / "w.html").read_text()
    rows = [["&lt;i&gt;Often", "2", "5 min", "0", "0 s"], ["Basalt", "2", "70 s", "1", "12 s"]]
    assert (
        "".join(f'<tr id="refused-{k}"><td>{"</td><td>".join(row)}</td></tr>' for k, row in enumerate(rows, 1)) in page
    )
    assert "<td>0%</td>" not in page, "refused advice is no loss of its own"


def test_a_report_of_refused_advice_alone_has_no_shares(tmp_path: Path) -> None:
    with closing(LossLedger(tmp_path, LossSettings())) as ledger:
        ledger.add("engine", 1, [REFUSED])
    assert run(["losses", "--data", str(tmp_path), "--html", str(tmp_path / "w.html"), *SPAN]) == 0
    assert "<h2>Worst pairs</h2><p>Nothing.</p>" in (tmp_path / "w.html").read_text()


def test_the_csv_has_a_row_for_each_combination(data: Path) -> None:
    assert run(["losses", "--data", str(data), "--csv", str(data / "w.csv"), *SPAN]) == 0
    head, *rows = (data / "w.csv").read_text().splitlines()
    assert head.startswith("day,vendor,model,by,root,kind,floor,place,lost_s")
    assert len(rows) == 3


def test_a_directory_without_a_ledger_says_what_is_expected(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="data directory of a service"):
        run(["losses", "--data", str(tmp_path)])
