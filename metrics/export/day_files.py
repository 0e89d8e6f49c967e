"""The ledger of lost time as Parquet files, one for each day in UTC.

A file is written beside its place and then moved there: whoever reads it sees the old one or the new one. Each run
writes all days that the ledger still has. A day of which the ledger has already removed hours keeps the file that it
has.
"""

import os
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from math import inf
from pathlib import Path
from typing import Any

from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import DAY_S, FIGURES, LossQuestion
from deconflict_client.answers.loss_models import LossKey, LossList, LossRow
from deconflict_client.counted_nouns import count_of
from metrics.replay_files import LogError

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
