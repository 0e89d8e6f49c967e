"""The commands `losses` and `export`, which read the ledger of lost time. Both may run beside the service."""

import argparse
import sqlite3
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from datetime import UTC, datetime
from math import inf
from pathlib import Path

from deconflict.engine.message_latency import LEARNED_EVERY_S
from deconflict.operator.ledger.loss_csv import as_csv
from deconflict.operator.ledger.loss_ledger import FILE_NAME, LossLedger
from deconflict.operator.ledger.loss_questions import DAY_S, LossQuestion
from deconflict.operator.store.learned_file import FILE_NAME as LEARNED
from deconflict.runtime.command_parsers import Commands, add_command, number_in
from deconflict.settings import site, site_file
from deconflict.settings.site import Site
from metrics.export.day_files import write_days
from metrics.replay_files import LogError, check_outputs, create_directory, write_text
from metrics.report import loss_report

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
