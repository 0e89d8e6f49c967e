"""The ledger of lost time as Parquet files."""

import sys
from contextlib import closing
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from deconflict.__main__ import parser
from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import DAY_S
from deconflict.settings.site import LossSettings
from metrics.replay_files import LogError
from tests.deconflict.operator.ledger.made_entries import CROSSED, LATER, QUEUED, REFUSED, START_S

DAYS = [datetime.fromtimestamp(START_S + more_s, UTC).date() for more_s in (0.0, DAY_S)]
NEXT_DAY = QUEUED._replace(from_s=START_S + DAY_S + 1.0)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    add(tmp_path, 1, [QUEUED, CROSSED, LATER, NEXT_DAY])
    return tmp_path


def add(data: Path, number: int, entries: list[Any]) -> None:
    with closing(LossLedger(data, LossSettings())) as ledger:
        ledger.add("engine", number, entries)


def export(data: Path, *more: str) -> None:
    args = parser().parse_args(["export", "--data", str(data), "--out", str(data / "out"), *more])
    assert args.run(args) == 0


def exported(data: Path, day: date) -> pd.DataFrame:
    return pd.read_parquet(data / "out" / f"losses-{day}.parquet")


def test_each_day_has_a_file_with_the_sums_of_its_hours(data: Path) -> None:
    pytest.importorskip("pyarrow")
    export(data)
    first, second = (exported(data, day) for day in DAYS)
    assert (len(first), len(second)) == (3, 1)
    assert first.groupby("vendor", observed=True)["lost_s"].sum().to_dict() == {"Alder": 11.0, "Corvid": 5.0}
    row = first[first.kind == "crossing"].iloc[0]
    assert (row.by_vendor, row.root_vendor, row.cell_x_m, row.cell_y_m) == ("Basalt", "Basalt", 5.0, 7.0)
    assert (row.lost_s, row.over_usual_s, row.sure_s, row.warned_s, row.losses) == (3.0, 2.5, 0.0, 3.0, 1)
    assert row.hour_start == pd.Timestamp(START_S, unit="s", tz="UTC")
    assert first.cost.isna().all()


def test_refused_advice_is_in_columns_of_its_own(data: Path) -> None:
    pytest.importorskip("pyarrow")
    add(data, 2, [REFUSED])
    export(data)
    found = exported(data, DAYS[0])
    row = found[found.kind == "deadlock"].iloc[0]
    assert (row.by_vendor, row.refusals, row.refused_s, row.unable, row.unable_s) == ("Basalt", 2, 70.0, 1, 12.0)
    assert found.lost_s.sum() == 16.0


def test_costs_and_names_of_floors_are_those_of_the_site(data: Path) -> None:
    pytest.importorskip("pyarrow")
    site = data / "site.toml"
    site.write_text('[[datums]]\nid = "hall"\nname = "Main hall"\n[losses]\ncost_per_robot_hour = {Alder = 3600.0}\n')
    export(data, "--site", str(site))
    found = exported(data, DAYS[1])
    assert (found.cost[0], found.floor[0], found.floor_name[0]) == (8.0, "hall", "Main hall")


def test_a_day_is_replaced_by_the_next_run_but_not_by_less_than_it_has(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyarrow")
    export(data)
    add(data, 2, [NEXT_DAY])
    export(data)
    assert exported(data, DAYS[1]).lost_s.sum() == 16.0
    with closing(LossLedger(data, LossSettings(keep_days=1.0))) as ledger:
        assert ledger.prune(START_S + DAY_S + 3599.0) == 1
    export(data)
    assert exported(data, DAYS[0]).lost_s.sum() == 16.0
    assert "left as it is" in capsys.readouterr().out
    assert {path.suffix for path in (data / "out").iterdir()} == {".parquet"}


def test_without_pyarrow_the_command_says_what_to_install(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(LogError, match=r"amr-deconflict\[export\]"):
        export(data)
