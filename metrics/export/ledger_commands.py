"""The commands `losses` and `export`, which read the ledger of lost time. Both may run beside the service.

`export` writes the ledger as Parquet files, one for each day in UTC. A file is written beside its place and then moved
there: whoever reads it sees the old one or the new one. Each run writes all days that the ledger still has. A day of
which the ledger has already removed hours keeps the file that it has.
"""

import argparse
import os
import sqlite3
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from datetime import UTC, datetime
from math import inf
from pathlib import Path
from typing import Any

from deconflict.engine.message_latency import LEARNED_EVERY_S
from deconflict.operator.ledger.loss_csv import as_csv
from deconflict.operator.ledger.loss_ledger import FILE_NAME, LossLedger
from deconflict.operator.ledger.loss_questions import DAY_S, FIGURES, LossQuestion
from deconflict.operator.store.learned_file import FILE_NAME as LEARNED
from deconflict.runtime.command_parsers import Commands, add_command, number_in
from deconflict.settings import site, site_file
from deconflict.settings.site import Site
from deconflict_client.answers.loss_models import LossKey, LossList, LossRow
from deconflict_client.counted_nouns import count_of
from metrics.replay_files import LogError, check_outputs, create_directory, write_text
from metrics.report import loss_report

KEYS: tuple[LossKey, ...] = ("hour", "vendor", "model", "by", "root", "kind", "floor", "place", "cell")
NAMES = "vendor", "model", "by_vendor", "root_vendor", "kind", "floor", "floor_name", "place"
COUNTS = "losses", "refusals", "unable"
NO_LIMIT = 1 << 62
COUNT = b"losses"
"""Key of the file's metadata that has the number of losses."""


def write_days(ledger: LossLedger, directory: Path, floor_names: Mapping[str, str]) -> Iterator[str]:
    """Write all days; yields a line for people about each. Raises `LogError` if pyarrow is missing or a file can't be
    written."""
    arrow = _arrow()
    days = ledger.ask(LossQuestion(0.0, inf, ("day",), limit=NO_LIMIT)).rows
    for day_s in sorted(row.model_dump()["day"] for row in days):
        path = directory / f"losses-{datetime.fromtimestamp(day_s, UTC):%Y-%m-%d}.parquet"
        found = ledger.ask(LossQuestion(day_s, day_s + DAY_S, KEYS, limit=NO_LIMIT))
        if path.exists() and _written_losses(arrow, path) > found.total.losses:
            yield f"{path}: left as it is, since the ledger has removed a part of this day"
            continue
        _write(arrow, path, _table(arrow, found, floor_names))
        yield f"{path}: {count_of(len(found.rows), 'row')}, {found.total.lost_s:.0f} s lost"


def _arrow() -> Any:
    try:
        import pyarrow  # noqa: PLC0415 - only this command needs it
        import pyarrow.parquet  # noqa: PLC0415
    except ImportError as error:
        raise LogError("export: needs pyarrow; pip install 'amr-deconflict[export]'") from error
    return pyarrow


def _table(arrow: Any, found: LossList, floor_names: Mapping[str, str]) -> Any:
    """One row for each hour and combination of the keys, in their order."""
    texts, numbers = arrow.dictionary(arrow.int32(), arrow.string()), arrow.float64()
    schema = arrow.schema(
        [
            ("hour_start", arrow.timestamp("s", tz="UTC")),
            *((name, texts) for name in NAMES),
            *((name, numbers) for name in ("cell_x_m", "cell_y_m")),
            *((name, arrow.int64() if name in COUNTS else numbers) for name in FIGURES),
        ],
        metadata={"currency": found.currency, COUNT: str(found.total.losses)},
    )
    rows = sorted((_row(row, floor_names) for row in found.rows), key=lambda row: tuple(map(str, row[:11])))
    columns = zip(*rows, strict=True)
    return arrow.table(
        [arrow.array(column, type_) for column, type_ in zip(columns, schema.types, strict=True)], schema
    )


def _row(row: LossRow, floor_names: Mapping[str, str]) -> tuple[object, ...]:
    values = row.model_dump()
    *names, floor, place, (x_m, y_m) = (values[key] for key in KEYS)
    figures = (values[name] for name in FIGURES)
    return *names, floor, floor_names.get(floor, floor), place, x_m, y_m, *figures


def _written_losses(arrow: Any, path: Path) -> int:
    """0 if the file can't be read."""
    try:
        return int((arrow.parquet.read_schema(path).metadata or {}).get(COUNT, 0))
    except (OSError, ValueError):
        return 0


def _write(arrow: Any, path: Path, table: Any) -> None:
    beside = path.with_suffix(".new")
    try:
        with beside.open("wb") as file:
            arrow.parquet.write_table(table, file, compression="zstd")
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    except OSError as error:
        raise LogError(f"{path} can't be written: {error.strerror or error}") from error


MOST_DAYS = 36_500
LAST_S = datetime(9999, 1, 1, tzinfo=UTC).timestamp()


def add_ledger_commands(commands: Commands) -> None:
    losses = add_command(
        commands,
        "losses",
        "report how much time robots lost to each other, from the ledger of the service",
        "deconflict losses --data data --site SITE.toml --html week.html --csv week.csv",
        "deconflict losses --days 1 --html day.html",
    )
    _add_ledger(losses)
    losses.add_argument(
        "--days", type=number_in(0, MOST_DAYS), default=7.0, metavar="N", help="length of the span (default: 7)"
    )
    losses.add_argument(
        "--until", type=_moment_s, dest="until_s", metavar="TIME", help="its end, such as 2026-11-23; now if absent"
    )
    losses.add_argument("--html", type=Path, metavar="OUT.html", help="write the report to this file")
    losses.add_argument("--csv", type=Path, metavar="OUT.csv", help="write the sums of each day to this file")
    losses.set_defaults(run=_losses)
    export = add_command(
        commands,
        "export",
        "write the ledger of lost time as Parquet files by day, for DuckDB or pandas",
        "deconflict export --data data --site SITE.toml --out export",
    )
    _add_ledger(export)
    export.add_argument("--out", type=Path, default=Path("export"), metavar="DIR", help="directory (default: export)")
    export.set_defaults(run=_export)


def _add_ledger(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--data", type=Path, default=Path("data"), help="data directory of the service (default: data)"
    )
    command.add_argument("--site", type=Path, metavar="SITE.toml", help="site file, for costs and the names of floors")


def _moment_s(text: str) -> float:
    with suppress(ValueError, OverflowError):
        if 0.0 <= (moment_s := datetime.fromisoformat(text).timestamp()) <= LAST_S:
            return moment_s
    raise argparse.ArgumentTypeError(f"{text!r} is no time from 1970 to 9998, such as 2026-11-23")


@contextmanager
def _opened(args: argparse.Namespace) -> Iterator[tuple[LossLedger, Site]]:
    """Raises `LogError` if the ledger can't be read, then and later."""
    used = site_file.load(args.site) if args.site else site.DEFAULT
    if not (args.data / FILE_NAME).is_file():
        raise LogError(f"{args.data}: has no {FILE_NAME}; expected the data directory of a service that has run")
    try:
        with closing(LossLedger(args.data, used.losses)) as ledger:
            yield ledger, used
    except sqlite3.Error as error:
        raise LogError(f"{args.data / FILE_NAME}: {error}") from error


def _losses(args: argparse.Namespace) -> int:
    until_s = time.time() if args.until_s is None else args.until_s
    check_outputs([], [path for path in (args.html, args.csv) if path], args.site)
    with _opened(args) as (ledger, used):
        from_s, ran_until_s = until_s - args.days * DAY_S, min(until_s, _ran_until_s(args.data))
        tables = loss_report.loss_tables(ledger, used, from_s, until_s, ran_until_s)
    if args.html:
        write_text(args.html, loss_report.loss_page(tables, used))
    if args.csv:
        write_text(args.csv, as_csv(LossQuestion(0.0, 0.0, loss_report.CSV_KEYS), tables.every))
    sys.stdout.write(f"{loss_report.loss_sentence(tables)}\n")
    return 0


def _ran_until_s(data: Path) -> float:
    """Until when the service ran at most: it keeps what it learned from time to time. Without it nobody knows."""
    try:
        return (data / LEARNED).stat().st_mtime + LEARNED_EVERY_S
    except OSError:
        return inf


def _export(args: argparse.Namespace) -> int:
    with _opened(args) as (ledger, used):
        create_directory(args.out)
        for day in write_days(ledger, args.out, {datum.id: datum.name for datum in used.datums}):
            sys.stdout.write(f"{day}\n")
    return 0
