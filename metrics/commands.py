"""The commands that look at recorded logs: `replay`, `conform` and `blackbox`."""

import argparse
import json
import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from math import inf
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from deconflict.operator.blackbox.start_state import Start, head_of, site_of, start_of
from deconflict.settings import overrides, site
from ingest.recording.log_reader import UNREADABLE, Event, Reader, by_time
from metrics.replay import blackbox_verify, conformance_counts
from metrics.scoring import compare

if TYPE_CHECKING:
    from metrics.replay.replay import Tell, Watch

TOLD_EVERY = 500
"""Lines between two looks at how far the progress bar has come."""
SLIGHT_S = 1.0
"""Messages that stand no further from their place than this, as where several sockets are read, mislead nobody."""

log = logging.getLogger(__name__)


class LogError(ValueError):
    """A log or a result that can't be read, and what to change."""


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add them to the command line."""
    again = commands.add_parser("replay", help="run recorded logs through the engine and score its advisories")
    _add_logs(again, "*")
    again.add_argument("--clearance", nargs="+", type=_clearance_m, metavar="M", help="metres; the site's if not given")
    again.add_argument("--json", type=Path, metavar="OUT.json", help="write the scores here, not to standard output")
    again.add_argument("--html", type=Path, metavar="OUT.html", help="a report for people, in one file")
    again.add_argument("--advisories", type=Path, metavar="OUT.jsonl", help="what the live stream would have said")
    again.add_argument("--mcap", type=Path, metavar="OUT.mcap", help="envelopes and advisories for robot viewers")
    again.add_argument(
        "--scheduler",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="spread the work over a Dask cluster; without an address over the cores of this machine",
    )
    again.add_argument("--compare", nargs=2, type=Path, metavar=("A.json", "B.json"), help="say what a change did")
    again.set_defaults(run=_replay)

    alone = commands.add_parser("conform", help="what each vendor's messages in a log depart from the standard in")
    _add_logs(alone, "+")
    alone.add_argument("--json", type=Path, metavar="OUT.json", help="write the counts here too")
    alone.set_defaults(run=_conform)
    blackbox_verify.add(commands)


def _add_logs(command: argparse.ArgumentParser, count: str) -> None:
    command.add_argument("logs", nargs=count, type=Path, metavar="LOG", help="a file, or a directory of logs")
    command.add_argument("--site", type=Path, metavar="SITE.toml")
    command.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes", help="as if the site said so"
    )


def _clearance_m(text: str) -> float:
    try:
        clearance_m = float(text)
    except ValueError:
        clearance_m = inf
    if not 0 <= clearance_m < inf:
        raise argparse.ArgumentTypeError(f"{text!r} is no distance: give metres, 0 or more, such as 0.3")
    return clearance_m


def _replay(args: argparse.Namespace) -> int:
    if args.compare:
        sys.stdout.write(_compared(*args.compare))
        return 0
    if not args.logs:
        raise LogError("replay: give a LOG, or --compare A.json B.json")
    settings, logs = _settings(args), files_of(args.logs)
    _spared(logs, args.json, args.html, args.advisories, args.mcap)

    from metrics.replay.replay import replay  # noqa: PLC0415 - brings numba
    from metrics.report import html_report  # noqa: PLC0415 - brings numba

    reader, clearances_m = Reader(), args.clearance or [settings.conflict.clearance_m]
    with ExitStack() as files:
        tell, watch = _outputs(args, files)
        events = files.enter_context(_shown(reader, logs))
        start = start_of(head) if (head := _head(args)) else Start()
        again = replay if args.scheduler is None else _spread(args.scheduler, files)
        result = again(reader, events, settings, clearances_m, tell=tell, watch=watch, start=start)
    _look_back(reader, args.logs, result)
    if args.html:
        title = f"Replay of {', '.join(one.name for one in args.logs)}"
        _write(args.html, html_report.page(result, title))
    if args.json:
        _write(args.json, _text(result))
    elif not args.html:
        sys.stdout.write(_text(result))
    return 0


def _spread(address: str, files: ExitStack) -> Callable[..., dict[str, Any]]:
    """The replay on a cluster that `files` lets go of."""
    try:
        from metrics.replay import dask_replay  # noqa: PLC0415 - only where it is asked for
    except ImportError as error:
        raise LogError(f"--scheduler needs Dask ({error}): pip install '.[dask]'") from error
    try:
        return partial(dask_replay.replay, files.enter_context(dask_replay.cluster(address)))
    except dask_replay.ClusterError as error:
        raise LogError(str(error)) from error


def _conform(args: argparse.Namespace) -> int:
    reader, settings, logs = Reader(), _settings(args), files_of(args.logs)
    _spared(logs, args.json)
    with _shown(reader, logs) as events:
        result = conformance_counts.conform(reader, events, settings)
    _look_back(reader, args.logs, result)
    sys.stdout.write(conformance_counts.page(result))
    if args.json:
        _write(args.json, _text(result))
    return 0


def _compared(a: Path, b: Path) -> str:
    results = _result(a), _result(b)
    try:
        return compare.page(*results)
    except UNREADABLE as error:
        told = f"{a} or {b} lacks what this release writes ({error!r})"
        raise LogError(f"{told}; write both anew with replay --json") from error


def _result(path: Path) -> dict[str, Any]:
    """What an earlier replay wrote."""
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, *UNREADABLE) as error:
        raise LogError(f"{path} can't be read: {error}") from error
    if not isinstance(told, dict) or "scores" not in told:
        raise LogError(f"{path} is no result of a replay; write one with --json")
    return told


def _head(args: argparse.Namespace) -> dict[str, Any] | None:
    """What the only log says of itself where it is a black box."""
    return head_of(args.logs[0]) if len(args.logs) == 1 else None


def _settings(args: argparse.Namespace) -> site.Site:
    head = None if args.site else _head(args)
    told = site_of(head) if head else site.load(args.site) if args.site else site.DEFAULT
    return overrides.changed(told, args.changes) if args.changes else told


def _text(result: dict[str, Any]) -> str:
    return json.dumps(result, indent=2) + "\n"


def _outputs(args: argparse.Namespace, files: ExitStack) -> "tuple[Tell | None, Watch | None]":
    """What is called with each advisory line and with each batch, writing to files that `files` closes."""
    tellers: list[Tell] = []
    watch: Watch | None = None
    if args.advisories:
        lines = files.enter_context(_opened(args.advisories, "w"))
        tellers.append(lambda line: lines.writelines((json.dumps(line), "\n")))
    if args.mcap:
        from metrics.report.mcap_export import Export  # noqa: PLC0415 - only where it is asked for

        export = Export(files.enter_context(_opened(args.mcap, "wb")))
        files.callback(export.finish)
        tellers.append(export.tell)
        watch = export.watch

    def tell(line: dict[str, Any]) -> None:
        for teller in tellers:
            teller(line)

    return tell if tellers else None, watch


def files_of(logs: Iterable[Path]) -> list[Path]:
    """The files of the logs, by time. Raises `LogError` where there are none, or one can't be read."""
    for one in logs:
        if not os.access(one, os.R_OK):
            raise LogError(f"{one} can't be read: give a log that is there, or a directory of logs")
    try:
        files = by_time(logs)
        if unreadable := [file for file in files if not os.access(file, os.R_OK)]:
            raise LogError(f"{unreadable[0]} can't be read: you must have the right to")
    except OSError as error:
        raise LogError(f"{error.filename} can't be read: {error.strerror}") from error
    if not files:
        raise LogError(f"no log is in {_named(logs)}: their names have .jsonl in them")
    return files


def _spared(logs: Sequence[Path], *outputs: Path | None) -> None:
    """Raises `LogError` where what is to be written has no place, or that of a log."""
    for out in outputs:
        if out is None:
            continue
        there = os.access(out, os.F_OK)
        if not (os.access(out, os.W_OK) and not out.is_dir() if there else os.access(out.parent, os.W_OK | os.X_OK)):
            raise LogError(f"{out} can't be written: give a file in a directory that is there and yours to write to")
        if there and any(out.samefile(one) for one in logs):
            raise LogError(f"{out} is the log that is to be read: give what is written another name")


def _opened(out: Path, mode: str) -> IO[Any]:
    try:
        return out.open(mode)
    except OSError as error:
        raise LogError(f"{out} can't be written: {error.strerror}") from error


def _write(out: Path, text: str) -> None:
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise LogError(f"{out} can't be written: {error.strerror}") from error


def _look_back(reader: Reader, logs: Iterable[Path], result: dict[str, Any]) -> None:
    """Say what became of messages out of their order. Raises `LogError` where there was no message at all."""
    if not result["messages"]:
        torn = f" and {reader.unreadable} lines that are none" if reader.unreadable else ""
        told = f"no message is in {_named(logs)}{torn}"
        raise LogError(f'{told}: give lines {{"received": ..., "message": {{...}}}} or a recording of the service')
    if reader.late:
        told = f"{reader.late} messages stand behind others that came up to {reader.late_by_s:.3g} s later"
        if reader.own or reader.late_by_s <= SLIGHT_S:
            log.info("%s; each was taken where it stands", told)
        else:
            log.warning("%s, too late for most of what they say to be scored: sort the lines by `received`", told)


def _named(logs: Iterable[Path]) -> str:
    return ", ".join(map(str, logs))


@contextmanager
def _shown(reader: Reader, files: Sequence[Path]) -> Iterator[Iterator[Event]]:
    """The events of the files, with a progress bar on standard error where that is a terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield reader.read(files)
        return
    columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=sum(file.stat().st_size for file in files))

        def events() -> Iterator[Event]:
            for number, event in enumerate(reader.read(files), 1):
                if number % TOLD_EVERY == 0:
                    progress.update(task, completed=reader.bytes_read, description=f"{number:,} lines")
                yield event

        yield events()
