"""The commands that look at what the service has recorded or hears: `replay`, `whatif`, `conform`, `senders`,
`fields`, `blackbox`, `losses` and `export`."""

import argparse
import json
import logging
import os
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from deconflict.operator.blackbox.start_state import site_of
from deconflict.runtime.command_parsers import Commands, add_command, number_in
from deconflict.runtime.kernel_preparation import ALL_PACKAGES, compile_kernels, report_on_terminal
from deconflict.settings import overrides, site, site_file
from deconflict_client.counted_nouns import count_of
from ingest.plain_files import read_file
from ingest.recording.log_reader import UNREADABLE, Event, LogReader, by_time
from ingest.recording.log_segments import packed_name, under_present_name
from metrics.conformance.fields_command import add_fields
from metrics.conformance.senders_command import add_senders
from metrics.export.ledger_commands import add_ledger_commands
from metrics.replay import blackbox_verify, conformance_counts
from metrics.replay_files import LogError, ReplayFiles, add_outputs, check_outputs, create_directory, write_text
from metrics.replay_processes import ReplayTask, add_processes, head_of_only, replayed
from metrics.report import replay_summary
from metrics.report.conformance_report import vendor_page
from metrics.scoring import compare
from metrics.whatif.question_options import add_whatif

LINES_PER_UPDATE = 500
"""Lines between two updates of the progress bar."""
MOST_CLEARANCE_M = 100_000
SLIGHT_S = 1.0
"""Messages that are out of order by at most this are harmless. They occur if several sockets are read."""

log = logging.getLogger(__name__)


def add_log_commands(commands: Commands) -> None:
    """Add the commands to the command line."""
    _add_replay(commands)
    whatif_command = add_whatif(commands)
    add_logs(whatif_command, "+")
    whatif_command.set_defaults(run=_whatif, changes=[])
    conform_command = add_command(
        commands,
        "conform",
        "count each vendor's deviations from the standard",
        "deconflict conform data/log --site SITE.toml",
        "deconflict conform data/log --site SITE.toml --html build",
    )
    add_logs(conform_command, "+")
    _add_settings(conform_command)
    conform_command.add_argument("--json", type=Path, metavar="OUT.json", help="also write the counts to this file")
    conform_command.add_argument(
        "--html", type=Path, metavar="DIR", help="also write a page for each vendor into this directory, to send to it"
    )
    conform_command.set_defaults(run=_conform)
    add_senders(commands)
    add_fields(commands)
    blackbox_verify.add(commands)
    add_ledger_commands(commands)


def _add_replay(commands: Commands) -> None:
    replay_command = add_command(
        commands,
        "replay",
        "run recorded logs through the engine and score its advisories",
        "deconflict replay data/log --site SITE.toml --html report.html",
        "deconflict replay data/log --site SITE.toml --set clearance=0.5 --json wider.json",
        "deconflict replay --compare scores.json wider.json",
        "deconflict replay monday tuesday --each --variant now --variant wide clearance=0.5 --json scores.json",
    )
    add_logs(replay_command, "*")
    _add_settings(replay_command)
    replay_command.add_argument(
        "--clearance",
        nargs="+",
        type=number_in(0, MOST_CLEARANCE_M),
        metavar="M",
        help="in metres; by default the site's",
    )
    replay_command.add_argument(
        "--each", action="store_true", help="each LOG by itself, with a result for each, in OUT-LOG.json"
    )
    replay_command.add_argument(
        "--variant",
        action="append",
        nargs="+",
        default=[],
        metavar=("NAME", "KEY=VALUE"),
        dest="variants",
        help="a result with these settings too, in OUT-NAME.json; give it once for each variant",
    )
    add_outputs(replay_command)
    add_processes(replay_command)
    replay_command.add_argument(
        "--compare", nargs=2, type=Path, metavar=("A.json", "B.json"), help="compare two results"
    )
    replay_command.set_defaults(run=_replay)


def add_logs(
    command: argparse.ArgumentParser,
    count: str,
    site: str = "the site file with which the log was recorded",
    *,
    needs_site: bool = False,
) -> None:
    """Add the arguments for recorded logs and a site file. `site` says which one."""
    command.add_argument("logs", nargs=count, type=Path, metavar="LOG", help="a file, or a directory of logs")
    command.add_argument("--site", type=Path, required=needs_site, metavar="SITE.toml", help=site)


def _add_settings(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="changes", help="override a setting of the site"
    )


def _replay(args: argparse.Namespace) -> int:
    if args.compare:
        sys.stdout.write(_compared(*args.compare))
        return 0
    if not args.logs:
        raise LogError("replay: give a LOG, or --compare A.json B.json")
    tasks = _tasks(args)
    check_outputs(
        [file for task in tasks for file in task.files],
        [path for task in tasks for path in task.outputs.paths()],
        args.site,
    )
    with _kernels_compiled():
        from metrics.replay import replay  # noqa: F401, PLC0415 - brings kernels
        from metrics.report import html_report  # noqa: F401, PLC0415 - brings kernels

    with replayed(args, tasks, _with_progress) as outcomes:
        for task, (result, reader) in zip(tasks, outcomes, strict=True):
            _check_order(reader, task.logs, result)
            _check_site(args, task.logs, reader)
            _write_result(task, result, args.page)
    return 0


def _tasks(args: argparse.Namespace) -> list[ReplayTask]:
    """What a replay has to do: each log with each variant. Raises `LogError`."""
    groups = [[log] for log in args.logs] if args.each else [args.logs]
    variants = args.variants or [[""]]
    if len(groups) * len(variants) > 1 and not (args.json or args.html):
        raise LogError("there is a result for each log and variant: name their files with --json or --html")
    tasks = []
    for logs in groups:
        files = files_of(logs)
        for variant, *changes in variants:
            if not re.fullmatch(r"[\w.-]*", variant):
                raise LogError(f"{variant!r} names no variant: give a name first, as in --variant wide clearance=0.5")
            settings = _settings(args, logs, changes)
            clearances_m = list(dict.fromkeys(args.clearance or [settings.conflict.clearance_m]))
            names = ([_name_of(logs[0])] if len(groups) > 1 else []) + ([variant] if len(variants) > 1 else [])
            outputs = ReplayFiles.of(args, clearances_m, "-".join(names))
            tasks.append(ReplayTask(logs, files, variant, settings, clearances_m, outputs))
    return tasks


def _write_result(task: ReplayTask, result: dict[str, Any], page: str) -> None:
    from metrics.report import html_report  # noqa: PLC0415 - brings kernels

    outputs, settings = task.outputs, task.site
    if outputs.html:
        title = f"{settings.name}: replay of {', '.join(log.name for log in task.logs)}"
        title += f" ({task.variant})" if task.variant else ""
        write_text(outputs.html, html_report.page(result, title, settings, page))
    if outputs.json:
        write_text(outputs.json, _text(result))
    elif not outputs.html:
        sys.stdout.write(_text(result))
    sys.stderr.write(replay_summary.summary(result, outputs.paths(), settings))


def _kernels_compiled() -> AbstractContextManager[None]:
    """While imports bring kernels: compile those that are missing, all at once."""
    from ingest.kernels import before_compiling  # noqa: PLC0415 - brings numba

    return before_compiling(partial(compile_kernels, ALL_PACKAGES, report_on_terminal))


def _whatif(args: argparse.Namespace) -> int:
    settings, logs = _settings(args, args.logs), files_of(args.logs)
    check_outputs(logs, [args.json] if args.json else [], args.site)
    with _kernels_compiled():
        from metrics.whatif import whatif_question  # noqa: PLC0415 - brings kernels

    found: whatif_question.Answer
    if args.other_settings:
        changed = overrides.with_overrides(settings, args.other_settings)
        found = whatif_question.settings_compared(logs, settings, changed)
    else:
        reader = LogReader()
        with _with_progress(reader, logs) as events:
            found = whatif_question.answered(events, logs, settings, args)
        _check_site(args, args.logs, reader)
    if args.json:
        write_text(args.json, _text(found.document()))
    sys.stdout.writelines(f"{line}\n" for line in found.lines())
    return whatif_question.NO_ANSWER if found.problems else 0


def _conform(args: argparse.Namespace) -> int:
    reader, settings, logs = LogReader(), _settings(args, args.logs), files_of(args.logs)
    check_outputs(logs, [args.json] if args.json else [], args.site)
    with _with_progress(reader, logs) as events:
        result = conformance_counts.conform(reader, events, settings)
    _check_order(reader, args.logs, result)
    _check_site(args, args.logs, reader)
    sys.stdout.write(conformance_counts.page(result))
    if args.json:
        write_text(args.json, _text(result))
    if args.html:
        create_directory(args.html)
    for vendor in result["conformance"] if args.html else ():
        page = args.html / f"{re.sub(r'[^A-Za-z0-9-]+', '-', vendor['vendor'])}.html"
        write_text(page, vendor_page(vendor, conformance_counts.standards(vendor), _named(args.logs)))
        sys.stderr.write(f"Wrote {page}\n")
    return 0


def _compared(a: Path, b: Path) -> str:
    results = _result(a), _result(b)
    try:
        return compare.page(*results)
    except UNREADABLE as error:
        problem = f"{a} or {b} lacks a value that this release writes ({error!r})"
        raise LogError(f"{problem}; write both again with replay --json") from error


def _result(path: Path) -> dict[str, Any]:
    """The result that an earlier replay wrote."""
    try:
        document = json.loads(read_file(path))
    except (OSError, *UNREADABLE) as error:
        raise LogError(f"{path} can't be read: {error}") from error
    if not isinstance(document, dict) or "scores" not in document:
        raise LogError(f"{path} is not the result of a replay; write one with --json")
    return document


def _settings(args: argparse.Namespace, logs: Sequence[Path], more_changes: Sequence[str] = ()) -> site.Site:
    head = None if args.site else head_of_only(logs)
    settings = site_of(head) if head else site_file.load(args.site) if args.site else site.DEFAULT
    changes = [*args.changes, *more_changes]
    return overrides.with_overrides(settings, changes) if changes else settings


def _text(result: dict[str, Any]) -> str:
    return json.dumps(result, indent=2) + "\n"


def files_of(logs: Iterable[Path]) -> list[Path]:
    """The files of the logs, by time. Raises `LogError` if there are none, or if one can't be read."""
    for log in logs:
        if not os.access(log, os.R_OK):
            raise LogError(f"{log} can't be read: give an existing log, or a directory of logs")
    try:
        files = by_time(logs)
        if unreadable := [file for file in files if not _is_readable(file)]:
            raise LogError(f"{unreadable[0]} can't be read: permission denied")
    except OSError as error:
        raise LogError(f"{error.filename} can't be read: {error.strerror}") from error
    if not files:
        raise LogError(f"no log is in {_named(logs)}: the name of a log contains .jsonl")
    return files


def _is_readable(file: Path) -> bool:
    """It may have been packed since it was listed."""
    return any(os.access(name, os.R_OK) for name in (file, packed_name(file)))


def _check_order(reader: LogReader, logs: Iterable[Path], result: dict[str, Any]) -> None:
    """Log how many messages were out of order. Raises `LogError` if there was no message at all."""
    if not result["messages"]:
        unreadable = f", only {count_of(reader.unreadable, 'line')} that can't be read" if reader.unreadable else ""
        problem = f"no message is in {_named(logs)}{unreadable}"
        raise LogError(f'{problem}: give lines {{"received": ..., "message": {{...}}}} or a recording of the service')
    if reader.late:
        came = count_of(reader.late, "message comes", "messages come")
        late = f"{came} after messages that were received up to {reader.late_by_s:.3g} s later"
        if reader.own or reader.late_by_s <= SLIGHT_S:
            log.info("%s; each was read in the order of the log", late)
        else:
            log.warning("%s, too late for most of them to be scored: sort the lines by `received`", late)


def _check_site(args: argparse.Namespace, logs: Sequence[Path], reader: LogReader) -> None:
    """Warn if the service's own log is read without a site file."""
    if reader.own and args.site is None and not head_of_only(logs):
        log.warning(
            "no site file is given: with --site SITE.toml its maps and places are used, as when it was recorded"
        )


def _name_of(log: Path) -> str:
    """The name of a log, without what says how it is stored."""
    name = log.resolve().name
    return name.partition(".jsonl")[0] or name


def _named(logs: Iterable[Path]) -> str:
    return ", ".join(map(str, logs))


@contextmanager
def _with_progress(reader: LogReader, files: Sequence[Path]) -> Iterator[Iterator[Event]]:
    """The events of the files, with a progress bar if standard error is a terminal."""
    from rich.console import Console  # noqa: PLC0415 - the command line starts without it
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    if not console.is_terminal:
        yield reader.read(files)
        return
    columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=sum(under_present_name(file, Path.stat).st_size for file in files))

        def events() -> Iterator[Event]:
            for number, event in enumerate(reader.read(files), 1):
                if number % LINES_PER_UPDATE == 0:
                    progress.update(task, completed=reader.bytes_read, description=count_of(number, "line"))
                yield event

        yield events()
