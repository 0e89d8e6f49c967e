"""The ways to the product: its entry point, the files that it ships, and its source text.

Nothing here names a module of the product: the entry point is read from `pyproject.toml`, and other objects are found
by what they are. So parts of the product can be moved without a change here.
"""

import argparse
import ast
import gc
import io
import json
import os
import sys
import tomllib
from collections.abc import Iterator
from contextlib import redirect_stdout
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any
from unittest.mock import patch

import fastapi

ROOT = Path(__file__).parent.parent.parent
PACKAGES = ("deconflict_client", "ingest", "deconflict", "metrics")
Document = dict[str, Any]


class _ParsedError(Exception):
    """The command line begins to parse; `args[0]` is its parser."""


def project() -> Document:
    """The contents of `pyproject.toml`."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def main() -> int:
    """Call the function of the console script. Arguments are those in `sys.argv`."""
    module, name = project()["project"]["scripts"]["deconflict"].split(":")
    return int(getattr(import_module(module), name)())


def parser() -> argparse.ArgumentParser:
    """The parser of the whole command line."""

    def refuse(self: argparse.ArgumentParser, *_: object, **__: object) -> None:
        raise _ParsedError(self)

    with _kept_collector(), patch.object(argparse.ArgumentParser, "parse_known_args", refuse):
        try:
            main()
        except _ParsedError as parsed:
            found: argparse.ArgumentParser = parsed.args[0]
            return found
    raise AssertionError("the command `deconflict` parses no arguments by argparse")


def printed(*arguments: str) -> str:
    """What a command prints. Raises `AssertionError` if it fails."""
    output = io.StringIO()
    with _kept_collector(), patch.object(sys, "argv", ["deconflict", *arguments]), redirect_stdout(output):
        code = main()
    assert code == 0, f"`deconflict {' '.join(arguments)}` ends with exit code {code}"
    return output.getvalue()


def command(*arguments: str) -> list[str]:
    """The command line of a command as a process of its own, which runs in `ROOT` with `environment()`."""
    return [sys.executable, "-c", "from tests.inventory import surface; raise SystemExit(surface.main())", *arguments]


def environment() -> dict[str, str]:
    """That of this process, with the product of this checkout, whichever is installed."""
    return os.environ | {"PYTHONPATH": str(ROOT)}


def schema(name: str) -> Document:
    """What `deconflict schema` prints under this name."""
    document: Document = json.loads(printed("schema", name))
    return document


def routes() -> list[Any]:
    """The routes of the operators' port, also those that its description leaves out."""
    made: list[fastapi.FastAPI] = []
    begin = fastapi.FastAPI.__init__

    def noted(self: fastapi.FastAPI, *args: Any, **kwargs: Any) -> None:
        begin(self, *args, **kwargs)
        made.append(self)

    with patch.object(fastapi.FastAPI, "__init__", noted):
        schema("openapi")
    return [route for app in made for route in app.routes]


def named_objects() -> Iterator[tuple[str, Any]]:
    """Each entry of each dictionary that a module of the product holds, with its key."""
    for package in PACKAGES:
        for found in walk_packages(import_module(package).__path__, f"{package}."):
            if not found.name.endswith("__main__"):
                for value in list(vars(import_module(found.name)).values()):
                    if isinstance(value, dict):
                        yield from ((key, entry) for key, entry in value.items() if isinstance(key, str))


def constants() -> Iterator[Any]:
    """Every literal in the source of the product."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Constant):
                    yield node.value


def document(name: str) -> str:
    """The text of a page of `docs`."""
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


class _kept_collector:  # noqa: N801 - used as a function
    """The command line sets thresholds of the garbage collector; afterwards they are as before."""

    def __enter__(self) -> None:
        self._thresholds = gc.get_threshold()

    def __exit__(self, *_: object) -> None:
        gc.set_threshold(*self._thresholds)
