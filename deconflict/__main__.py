"""The command line and the composition root: the one place that sees ingest, deconflict and metrics together."""

import argparse
import gc
import json
import os
import select
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

from deconflict.operator.blackbox.start_state import BoxError
from deconflict.operator.http import json_schemas
from deconflict.roles.processes.backup_command import add_backup
from deconflict.roles.processes.disk_room import disk_lines
from deconflict.roles.processes.off_floor_command import add_off_floor
from deconflict.roles.processes.ports import PortTakenError
from deconflict.roles.service_commands import add_service_commands, add_site_new, serving_problems
from deconflict.runtime.command_parsers import GC_THRESHOLDS, MISUSED, CommandParser, Commands, add_command, number_in
from deconflict.runtime.data_lock import DataDirectoryError
from deconflict.runtime.logging_setup import FORMATS, VARIABLE
from deconflict.runtime.logging_setup import begin as begin_log
from deconflict.settings import site, site_file
from deconflict.settings.importers import plan_reader
from deconflict.settings.importers.plan import PlanError
from deconflict.settings.importers.plan_summary import summary_lines
from deconflict.settings.site_check import check
from deconflict.simulation.simulation_commands import add_simulation_commands
from ingest.languages.visible_text import visible, visible_lines
from ingest.plain_files import UnfitFileError
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError
from metrics.commands import add_log_commands, add_logs, files_of
from metrics.monitoring import dashboards
from metrics.monitoring.exposition import render
from metrics.replay_files import LogError

SHELLS = ("bash", "zsh", "tcsh")


def _openapi() -> dict[str, Any]:
    from deconflict.operator.http import api_descriptions  # noqa: PLC0415 - loads the web server

    return api_descriptions.openapi()


def _asyncapi() -> dict[str, Any]:
    from deconflict.operator.http import api_descriptions  # noqa: PLC0415 - loads the web server

    return api_descriptions.asyncapi()


DESCRIBED = json_schemas.SCHEMAS | {"openapi": _openapi, "asyncapi": _asyncapi}


def parser() -> argparse.ArgumentParser:
    root: argparse.ArgumentParser = CommandParser(
        prog="deconflict",
        description="Traffic deconfliction for floors shared by robots of many vendors. Advisory, not safety rated.",
        epilog="deconflict COMMAND --help has the arguments of a command, and examples. Exit code 2 means that "
        "arguments, the site file or a log can't be used; the message says what to change.",
    )
    root.add_argument("--version", action="version", version=f"deconflict {version('amr-deconflict')}")
    kind = os.environ.get(VARIABLE, "text")
    root.add_argument(
        "--log",
        choices=FORMATS,
        default=kind if kind in FORMATS else "text",
        help=f"format of the log; the environment variable {VARIABLE} sets it too",
    )
    commands = root.add_subparsers(dest="command", required=True, metavar="COMMAND")
    add_simulation_commands(commands, render)
    add_service_commands(commands)
    add_backup(commands)
    add_off_floor(commands)
    _add_check(commands)
    _add_site(commands)
    add_log_commands(commands)
    _add_descriptions(commands)
    return root


def _add_check(commands: Commands) -> None:
    check_parser = add_command(
        commands,
        "check",
        "check a site file, and the fit of each vendor's map to the site's frame, and say how much disk it needs",
        "deconflict check SITE.toml",
        "deconflict check SITE.toml --driven data/log      # how far maps are from what robots drive",
    )
    check_parser.add_argument("site", type=Path, metavar="SITE.toml", help="the site file")
    check_parser.add_argument(
        "--driven", nargs="+", default=[], type=Path, metavar="LOG", help="also compare vendors' maps with these logs"
    )
    check_parser.set_defaults(run=_check)


def _add_site(commands: Commands) -> None:
    site_parser = add_command(
        commands,
        "site",
        "write parts of a site file",
        "deconflict site new > SITE.toml",
        "deconflict site import hall.building.yaml >> SITE.toml",
        "deconflict site align data/log --site SITE.toml",
        "deconflict site suggest data/log --site SITE.toml",
    )
    site_parsers = site_parser.add_subparsers(dest="part", required=True, metavar="PART")
    add_site_new(site_parsers)
    _add_site_import(site_parsers)
    _add_site_align(site_parsers)
    suggest_parser = add_command(
        site_parsers,
        "suggest",
        "print resources at places where robots often stand, from recorded logs",
        "deconflict site suggest data/log --site SITE.toml",
    )
    add_logs(suggest_parser, "+", "the site file of the log, with the resources known already")
    suggest_parser.set_defaults(run=_site_suggest)


def _add_site_align(site_parsers: Commands) -> None:
    align_parser = add_command(
        site_parsers,
        "align",
        "print vendors' maps found from what their robots and others drive in the same aisles, from recorded logs",
        "deconflict site align data/log --site SITE.toml",
    )
    add_logs(align_parser, "+", "the site file, with the datums of the floors", needs_site=True)
    align_parser.set_defaults(run=_site_align)


def _add_site_import(site_parsers: Commands) -> None:
    import_parser = add_command(
        site_parsers,
        "import",
        "print sections of a site file from a LIF layout, an Open-RMF building file or an openTCS plant model",
        "deconflict site import hall.building.yaml >> SITE.toml",
    )
    import_parser.add_argument("file", type=Path, metavar="FILE", help="the file to read")
    import_parser.add_argument(
        "--width",
        type=number_in(*plan_reader.WIDTHS_M),
        default=plan_reader.WIDTH_M,
        metavar="M",
        help="width of lanes and places, metres (default: %(default)s)",
    )
    import_parser.add_argument(
        "--png", type=Path, metavar="FILE", help="also save a picture of the floors, places and lanes"
    )
    import_parser.set_defaults(run=_site_import)


def _add_descriptions(commands: Commands) -> None:
    schema_parser = add_command(
        commands,
        "schema",
        "print a JSON Schema, the OpenAPI or the AsyncAPI description",
        "deconflict schema advisory",
        "deconflict schema openapi > openapi.json",
    )
    schema_parser.add_argument("name", choices=sorted(DESCRIBED), help="what to describe")
    schema_parser.set_defaults(run=_schema)

    dashboards_parser = add_command(
        commands, "dashboards", "write Grafana dashboards and Prometheus rules", "deconflict dashboards dashboards"
    )
    dashboards_parser.add_argument("folder", type=Path, metavar="DIR", help="the directory to write them to")
    dashboards_parser.set_defaults(run=_dashboards)

    completion_parser = add_command(
        commands,
        "completion",
        "print the script that completes commands and options on Tab",
        "deconflict completion bash > ~/.local/share/bash-completion/completions/deconflict",
        "deconflict completion zsh > ~/.zfunc/_deconflict",
    )
    completion_parser.add_argument("shell", choices=SHELLS, help="the shell")
    completion_parser.set_defaults(run=_completion)


def _check(args: argparse.Namespace) -> int:
    return check(args.site, sys.stdout, serving_problems, disk_lines, files_of(args.driven) if args.driven else ())


def _site_import(args: argparse.Namespace) -> int:
    imported = plan_reader.imported_site(args.file, args.width)
    if args.png:
        try:
            from deconflict.settings.importers import plan_picture  # noqa: PLC0415 - only the picture needs matplotlib
        except ModuleNotFoundError as error:
            raise PlanError("--png: needs matplotlib; run pip install 'amr-deconflict[plot]'") from error
        plan_picture.save_picture(imported.plan, imported.site, args.png)
    sys.stdout.write(imported.text)
    sys.stderr.write("".join(f"{visible(line)}\n" for line in summary_lines(imported.plan, imported.site)))
    return 0


def _site_align(args: argparse.Namespace) -> int:
    from deconflict.settings.importers.proposed_maps import proposed_maps  # noqa: PLC0415 - loads numba

    files_of(args.logs)
    sys.stdout.write(proposed_maps(args.logs, site_file.load(args.site)))
    return 0


def _site_suggest(args: argparse.Namespace) -> int:
    from deconflict.contention.suggest_resources import suggested  # noqa: PLC0415 - loads numba

    files_of(args.logs)
    sys.stdout.write(suggested(args.logs, site_file.load(args.site) if args.site else site.DEFAULT))
    return 0


def _schema(args: argparse.Namespace) -> int:
    sys.stdout.write(json.dumps(DESCRIBED[args.name](), indent=2) + "\n")
    return 0


def _dashboards(args: argparse.Namespace) -> int:
    try:
        written = dashboards.write(args.folder)
    except OSError as error:
        raise LogError(f"{args.folder} can't be written to: {error.strerror}") from error
    sys.stdout.writelines(f"{path}\n" for path in written)
    return 0


def _completion(args: argparse.Namespace) -> int:
    import shtab  # noqa: PLC0415 - only this command needs it

    sys.stdout.write(shtab.complete(parser(), args.shell) + "\n")
    return 0


def main() -> int:
    """Run one command and return its exit code."""
    gc.set_threshold(*GC_THRESHOLDS)
    _open_closed_streams()
    args = parser().parse_args()
    begin_log(args.log)
    try:
        code = int(args.run(args))
        sys.stdout.flush()
    except BrokenPipeError:
        if not _output_is_closed():
            raise
        return 0
    except (
        site_file.SiteError,
        PlanError,
        PortTakenError,
        DataDirectoryError,
        SecretError,
        CertificateError,
        LogError,
        BoxError,
        UnfitFileError,
    ) as error:
        sys.stderr.write(f"deconflict: {visible_lines(str(error))}\n")
        return MISUSED
    except OSError as error:
        if error.filename is not None:
            why = f"{error.filename} can't be used: {error.strerror}; check its name, its owner and its disk"
        elif _output_fails():
            why = f"standard output can't be written: {error.strerror}"
        else:
            raise
        sys.stderr.write(f"deconflict: {visible_lines(why)}\n")
        return MISUSED
    return code


def _open_closed_streams() -> None:
    """Give a program that was started without some of its standard streams empty ones, so that no file takes their
    numbers."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    sys.stdin = sys.stdin or os.fdopen(0, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(1, "w", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", closefd=False)


def _output_fails() -> bool:
    """Whether standard output takes nothing more, as on a full disk. Then the rest of it is discarded."""
    try:
        os.write(sys.stdout.fileno(), b"\n")
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return True
    return False


def _output_is_closed() -> bool:
    """Whether nobody reads the output any more, as after `| head`. Then the rest of it is discarded."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)
    if not any(events & select.POLLERR for _, events in poll.poll(0)):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return True


if __name__ == "__main__":
    sys.exit(main())
