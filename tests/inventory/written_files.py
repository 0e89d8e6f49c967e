"""What a service leaves on disk when it has ended, and what commands make of its recording."""

import json
import re
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from tests.inventory import surface

NAME = re.compile(r"[a-z_][A-Za-z0-9_]*")
BY_KIND = ("advisories_raised", "by_kind")
"""Mappings whose keys depend on what happened."""
DEEPEST = 2
"""Of scores, the paths of so many keys: what is below depends on what happened."""


def written_lines(data: Path, folder: Path) -> Iterator[str]:
    """The files in a data directory, and the fields of what is made from them. `folder` takes the results."""
    yield from _output_lines(data, folder)
    yield from _file_lines(data)


def _run(*arguments: str) -> None:
    """Run a command to its end. Raises `CalledProcessError` if it fails."""
    command, environment = surface.command(*arguments), surface.environment()
    subprocess.run(command, check=True, cwd=surface.ROOT, env=environment, stdout=subprocess.DEVNULL)


def _output_lines(data: Path, folder: Path) -> Iterator[str]:
    for name in ("replay", "conform"):
        result = folder / f"{name}.json"
        _run(name, str(data / "log"), "--json", str(result))
        for path in json_paths(json.loads(result.read_text(encoding="utf-8"))):
            if path.count(".") < DEEPEST:
                yield f"live output {name} --json {path}"
    result = folder / "losses.csv"
    _run("losses", "--data", str(data), "--csv", str(result))
    header = result.read_text(encoding="utf-8").splitlines()[0]
    yield from (f"live output losses --csv column {column}" for column in header.split(","))


def json_paths(value: Any, path: str = "") -> Iterator[str]:
    """The paths of a document. Where a key is no identifier, all beside it are data, such as names, and are `{}`."""
    if isinstance(value, dict):
        holds_data = path.endswith(BY_KIND) or not all(map(NAME.fullmatch, value))
        for key, inner in value.items():
            below = f"{path}.{'{}' if holds_data else key}".lstrip(".")
            yield below
            yield from json_paths(inner, below)
    elif isinstance(value, list):
        for inner in value:
            yield from json_paths(inner, f"{path}[]")


def _file_lines(data: Path) -> Iterator[str]:
    """The files of a service that has ended, and what is in them."""
    for path in sorted(data.rglob("*")):
        name = re.sub(r"\d+", "N", str(path.relative_to(data)))
        yield f"live file {name}{'/' if path.is_dir() else ''}"
        if path.suffix == ".db":
            yield from (f"live file {name} {line}" for line in _tables(path))
        elif path.suffix == ".npz":
            with np.load(path) as arrays:
                yield from (f"live file {name} part {key.split('.')[0]}" for key in arrays)
        elif path.suffix == ".json":
            yield from (f"live file {name} {line}" for line in json_paths(json.loads(path.read_text(encoding="utf-8"))))
        elif path.suffix == ".jsonl":
            for line in path.read_text(encoding="utf-8").splitlines():
                yield from (f"live file {name} key {key}" for key in json.loads(line))


def _tables(path: Path) -> Iterator[str]:
    with closing(sqlite3.connect(path)) as database:
        yield f"version {database.execute('pragma user_version').fetchone()[0]}"
        for (table,) in database.execute("select name from sqlite_master where type = 'table'").fetchall():
            columns = database.execute(f"pragma table_info({table})").fetchall()
            yield from (f"table {table} column {column[1]} {column[2]}".rstrip() for column in columns)
