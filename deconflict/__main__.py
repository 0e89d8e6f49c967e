"""The command line and the composition root: the one place that sees ingest, deconflict and metrics together."""

import argparse
import asyncio
import gc
import json
import logging
import os
import signal
import sys
import threading
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from deconflict.operator.blackbox.start_state import BoxError
from deconflict.operator.http import access, api_descriptions, json_schemas
from deconflict.roles.service import cluster_problems, run_role, runtime_directory
from deconflict.roles.supervisor import PARTS, Supervisor
from deconflict.runtime.data_lock import DataTakenError, locked
from deconflict.runtime.logging_setup import FORMATS, VARIABLE
from deconflict.runtime.logging_setup import begin as begin_log
from deconflict.runtime.rpc import PortTakenError
from deconflict.runtime.systemd import Notifier
from deconflict.settings import site, site_file
from deconflict.settings.importers import plan_reader
from deconflict.settings.importers.plan import PlanError
from deconflict.settings.site_check import check
from deconflict.simulation.demo_site import ROBOTS, demo_site
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError
from metrics.commands import LogError, add_log_commands, files_of
from metrics.monitoring import dashboards
from metrics.monitoring.exposition import render

if TYPE_CHECKING:
    from deconflict.simulation.drills.drill_scripts import Drill

FAILED, MISUSED = 1, 2
GC_THRESHOLDS = (50_000, 20, 100)
"""Thresholds of Python's cyclic garbage collector. Reference cycles are rare here. A high threshold avoids scans of
millions of objects."""
DESCRIBED = json_schemas.SCHEMAS | {"openapi": api_descriptions.openapi, "asyncapi": api_descriptions.asyncapi}

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def parser() -> argparse.ArgumentParser:
    root = argparse.ArgumentParser(
        prog="deconflict",
        description="Traffic deconfliction for floors shared by robots of many vendors. Advisory, not safety rated.",
    )
    root.add_argument("--version", action="version", version=f"deconflict {version('amr-deconflict')}")
    kind = os.environ.get(VARIABLE, "text")
    root.add_argument(
        "--log",
        choices=FORMATS,
        default=kind if kind in FORMATS else "text",
        help=f"format of the log; the environment variable {VARIABLE} sets it too",
    )
    commands = root.add_subparsers(dest="command", required=True)
    _add_service(commands)
    _add_simulations(commands)
    _add_check(commands)
    _add_site(commands)
    _add_simulate(commands)
    add_log_commands(commands)
    _add_descriptions(commands)
    _add_role(commands)
    return root


def _add_service(commands: Commands) -> None:
    serve_parser = commands.add_parser("serve", help="run the service")
    serve_parser.add_argument(
        "site", nargs="?", type=Path, metavar="SITE.toml", help="the site file; without it, each datum is a floor"
    )
    _add_ports(serve_parser)
    serve_parser.add_argument("--data", type=Path, help="directory for recordings and advisories")
    serve_parser.add_argument(
        "--part", action="append", choices=list(PARTS), help="the part of a cluster to run here; may be repeated"
    )
    serve_parser.set_defaults(run=_serve)


def _add_simulations(commands: Commands) -> None:
    demo_parser = commands.add_parser("demo", help="run the service with simulated vendors on a bundled site")
    _add_simulated_world(demo_parser)
    demo_parser.add_argument(
        "--seconds", type=float, metavar="S", help="stop after this time; 60 if there is no terminal, else never"
    )
    _add_ports(demo_parser)
    demo_parser.add_argument(
        "--data", type=Path, help="directory to keep recordings and advisories; else they are discarded"
    )
    demo_parser.set_defaults(run=_demo)

    drill_parser = commands.add_parser(
        "drill", help="run scripted situations through the whole service, and score advice"
    )
    drill_parser.add_argument(
        "drills", nargs="*", metavar="NAME", type=_drill_named, help="the drills to run; without names, all"
    )
    drill_parser.add_argument("--ignore", action="store_true", help="let the simulated robots ignore all advice")
    drill_parser.add_argument(
        "--advice",
        choices=("advisories", "situations"),
        default="advisories",
        help="whose advice the simulated robots follow (default: advisories)",
    )
    drill_parser.set_defaults(run=_drill)


def _add_check(commands: Commands) -> None:
    check_parser = commands.add_parser(
        "check", help="check a site file, and the fit of each vendor's map to the site's frame"
    )
    check_parser.add_argument("site", type=Path, metavar="SITE.toml", help="the site file")
    check_parser.set_defaults(run=lambda args: check(args.site, sys.stdout))


def _add_simulate(commands: Commands) -> None:
    simulate_parser = commands.add_parser("simulate", help="run simulated vendors that report to a running service")
    simulate_parser.add_argument("--url", default="ws://127.0.0.1:3000", help="the service's robots' port")
    _add_simulated_world(simulate_parser)
    simulate_parser.add_argument("--seconds", type=float, metavar="S", help="stop after this time")
    simulate_parser.set_defaults(run=_simulate)


def _add_descriptions(commands: Commands) -> None:
    schema_parser = commands.add_parser("schema", help="print a JSON Schema, the OpenAPI or the AsyncAPI description")
    schema_parser.add_argument("name", choices=sorted(DESCRIBED), help="what to describe")
    schema_parser.set_defaults(run=_schema)

    dashboards_parser = commands.add_parser("dashboards", help="write Grafana dashboards and Prometheus rules")
    dashboards_parser.add_argument("folder", type=Path, metavar="DIR", help="the directory to write them to")
    dashboards_parser.set_defaults(run=_dashboards)


def _add_role(commands: Commands) -> None:
    role_parser = commands.add_parser("role", help="run one process of the service; the supervisor uses this command")
    role_parser.add_argument("name", help="receiver, engine or operator; in a cluster also feed or follower")
    role_parser.add_argument("runtime", type=Path, help="directory of the sockets and settings of the running service")
    role_parser.add_argument("data", type=Path, help="directory for recordings and advisories")
    role_parser.set_defaults(run=_role)


def _add_site(commands: Commands) -> None:
    site_parsers = commands.add_parser("site", help="write parts of a site file").add_subparsers(
        dest="part", required=True
    )
    import_parser = site_parsers.add_parser(
        "import", help="print sections of a site file from an Open-RMF building file or an openTCS plant model"
    )
    import_parser.add_argument("file", type=Path, metavar="FILE", help="the file to read")
    import_parser.add_argument(
        "--width", type=float, default=plan_reader.WIDTH_M, metavar="M", help="width of lanes and places, metres"
    )
    import_parser.set_defaults(run=_site_import)

    suggest_parser = site_parsers.add_parser(
        "suggest", help="print resources at places where robots often stand, from recorded logs"
    )
    suggest_parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="a file, or a directory of logs")
    suggest_parser.add_argument(
        "--site", type=Path, metavar="SITE.toml", help="the site file of the log, with the resources known already"
    )
    suggest_parser.set_defaults(run=_site_suggest)


def _add_ports(command: argparse.ArgumentParser) -> None:
    command.add_argument("--host", help="address that both ports listen on")
    command.add_argument("--open", action="store_true", help="allow access without credentials, also from a network")
    command.add_argument("--robots-port", type=int, metavar="PORT", help="port for the robots' messages")
    command.add_argument("--operator-port", type=int, metavar="PORT", help="port of the API, the stream and the page")


def _add_simulated_world(command: argparse.ArgumentParser) -> None:
    command.add_argument("--robots", type=_positive, default=ROBOTS, metavar="N", help="number of simulated robots")
    command.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the simulated traffic")


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number


def _drill_named(name: str) -> "Drill":
    from deconflict.simulation.drills.drill_scripts import DRILLS  # noqa: PLC0415 - loads the simulated world

    for drill in DRILLS:
        if drill.name == name:
            return drill
    raise argparse.ArgumentTypeError(f"no drill is named {name}; choose of {', '.join(drill.name for drill in DRILLS)}")


def _settings(args: argparse.Namespace, path: Path | None) -> site.Site:
    """The settings of the site file and the command line, which takes precedence."""
    settings = site_file.load(path) if path else site.DEFAULT
    receiver = {"host": args.host, "port": args.robots_port}
    operator = {"host": args.host, "port": args.operator_port}
    return settings.model_copy(
        update={
            "receiver": settings.receiver.model_copy(update=_given(receiver)),
            "operator": settings.operator.model_copy(update=_given(operator)),
        }
    )


def _given(values: dict[str, object]) -> dict[str, object]:
    return {name: value for name, value in values.items() if value is not None}


def _serve(args: argparse.Namespace) -> int:
    settings = _checked_settings(args)
    if args.site is None:
        logging.getLogger("deconflict").warning("no site file: every datum is taken as a floor of its own")
    if problems := cluster_problems(settings.cluster, args.part or ()):
        raise site_file.SiteError(problems)
    data = args.data or Path(settings.store.directory)
    data.mkdir(parents=True, exist_ok=True)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    parts, manager = args.part or tuple(PARTS), Notifier(os.environ)
    with locked(data, parts), runtime_directory() as name:
        supervisor = Supervisor(settings, data, Path(name), lambda: _checked_settings(args), parts, manager)
        signal.signal(signal.SIGHUP, lambda *_: supervisor.reloader.request())
        supervisor.run(stop)
    return 0


def _checked_settings(args: argparse.Namespace) -> site.Site:
    """The settings, checked. Raises `SiteError`, `SecretError` and `CertificateError`."""
    settings = _settings(args, args.site)
    problems = site_file.fit_problems(settings)
    if problems:
        raise site_file.SiteError(problems)
    _check_access(settings, args.open)
    return settings


def _check_access(settings: site.Site, allow_open: bool) -> None:
    """Raises if credentials can't be used, or a port is open to a network without credentials and without --open."""
    access.verify_credentials(settings)
    problems = access.exposed_ports(settings)
    if problems and not allow_open:
        raise site_file.SiteError([*problems, "or start with --open, if everybody on that network may read and write"])
    for problem in problems:
        logging.getLogger("deconflict").warning("%s", problem)


def _demo(args: argparse.Namespace) -> int:
    from deconflict.simulation import demo  # noqa: PLC0415 - loads the simulated world

    settings = _settings(args, demo_site())
    _check_access(settings, args.open)
    return demo.demo(settings, args.robots, args.seconds, args.seed, args.data)


def _drill(args: argparse.Namespace) -> int:
    from deconflict.simulation.drills import drill_run  # noqa: PLC0415 - loads the engine
    from deconflict.simulation.drills.drill_scripts import DRILLS  # noqa: PLC0415 - loads the simulated world

    return drill_run.drill(args.drills or DRILLS, render, ignored=args.ignore, source=args.advice)


def _site_import(args: argparse.Namespace) -> int:
    sys.stdout.write(plan_reader.imported_toml(args.file, args.width))
    return 0


def _site_suggest(args: argparse.Namespace) -> int:
    from deconflict.contention.suggest_resources import suggested  # noqa: PLC0415 - loads numba

    files_of(args.logs)
    sys.stdout.write(suggested(args.logs, site_file.load(args.site) if args.site else site.DEFAULT))
    return 0


def _simulate(args: argparse.Namespace) -> int:
    from deconflict.simulation.vendors.senders import simulate  # noqa: PLC0415 - loads the simulated world

    async def run() -> dict[str, int]:
        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop.set)
        return await simulate(args.url, args.robots, args.seconds, args.seed, stop=stop)

    sys.stdout.write(json.dumps(asyncio.run(run())) + "\n")
    return 0


def _schema(args: argparse.Namespace) -> int:
    sys.stdout.write(json.dumps(DESCRIBED[args.name](), indent=2) + "\n")
    return 0


def _dashboards(args: argparse.Namespace) -> int:
    for path in dashboards.write(args.folder):
        sys.stdout.write(f"{path}\n")
    return 0


def _role(args: argparse.Namespace) -> int:
    run_role(args.name, args.runtime, args.data, render)
    return 0


def main() -> int:
    """Run one command and return its exit code."""
    gc.set_threshold(*GC_THRESHOLDS)
    args = parser().parse_args()
    begin_log(args.log)
    try:
        return int(args.run(args))
    except (
        site_file.SiteError,
        PlanError,
        PortTakenError,
        DataTakenError,
        SecretError,
        CertificateError,
        LogError,
        BoxError,
    ) as error:
        sys.stderr.write(f"deconflict: {error}\n")
        return MISUSED


if __name__ == "__main__":
    sys.exit(main())
