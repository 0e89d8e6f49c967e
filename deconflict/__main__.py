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
from metrics import commands as logs
from metrics.monitoring import dashboards
from metrics.monitoring.exposition import render

if TYPE_CHECKING:
    from deconflict.simulation.drills.drill_scripts import Drill

FAILED, MISUSED = 1, 2
COLLECTED_EVERY = (50_000, 20, 100)
"""Thresholds of Python's cyclic garbage collector. Reference cycles are rare here, and ten thousand robots have a
million objects: with Python's own threshold of 700 the collector took a sixth of the time."""
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
    logs.add(commands)
    _add_descriptions(commands)
    _add_role(commands)
    return root


def _add_service(commands: Commands) -> None:
    serve = commands.add_parser("serve", help="run the service")
    serve.add_argument(
        "site", nargs="?", type=Path, metavar="SITE.toml", help="the site file; without it, each datum is a floor"
    )
    _add_ports(serve)
    serve.add_argument("--data", type=Path, help="directory for recordings and advisories")
    serve.add_argument(
        "--part", action="append", choices=list(PARTS), help="the part of a cluster to run here; may be repeated"
    )
    serve.set_defaults(run=_serve)


def _add_simulations(commands: Commands) -> None:
    show = commands.add_parser("demo", help="run the service with simulated vendors on a bundled site")
    show.add_argument("--robots", type=_positive, default=ROBOTS, metavar="N")
    show.add_argument(
        "--seconds", type=float, metavar="S", help="stop after this time; 60 if there is no terminal, else never"
    )
    show.add_argument("--seed", type=int, default=1)
    _add_ports(show)
    show.add_argument("--data", type=Path, help="directory to keep recordings and advisories; else they are discarded")
    show.set_defaults(run=_demo)

    practise = commands.add_parser("drill", help="run scripted situations through the whole service, and score advice")
    practise.add_argument("drills", nargs="*", metavar="NAME", type=_drill_named)
    practise.add_argument("--ignore", action="store_true", help="let the simulated robots ignore all advice")
    practise.set_defaults(run=_drill)


def _add_check(commands: Commands) -> None:
    verify = commands.add_parser(
        "check", help="check a site file, and the fit of each vendor's map to the site's frame"
    )
    verify.add_argument("site", type=Path, metavar="SITE.toml")
    verify.set_defaults(run=lambda args: check(args.site, sys.stdout))


def _add_simulate(commands: Commands) -> None:
    pretend = commands.add_parser("simulate", help="run simulated vendors that report to a running service")
    pretend.add_argument("--url", default="ws://127.0.0.1:3000", help="the service's robots' port")
    pretend.add_argument("--robots", type=_positive, default=ROBOTS, metavar="N")
    pretend.add_argument("--seconds", type=float, metavar="S", help="stop after this time")
    pretend.add_argument("--seed", type=int, default=1)
    pretend.set_defaults(run=_simulate)


def _add_descriptions(commands: Commands) -> None:
    describe = commands.add_parser("schema", help="print a JSON Schema, the OpenAPI or the AsyncAPI description")
    describe.add_argument("name", choices=sorted(DESCRIBED))
    describe.set_defaults(run=_schema)

    boards = commands.add_parser("dashboards", help="write Grafana dashboards and Prometheus rules")
    boards.add_argument("folder", type=Path, metavar="DIR")
    boards.set_defaults(run=_dashboards)


def _add_role(commands: Commands) -> None:
    role = commands.add_parser("role")
    role.add_argument("name")
    role.add_argument("runtime", type=Path)
    role.add_argument("data", type=Path)
    role.set_defaults(run=_role)


def _add_site(commands: Commands) -> None:
    plans = commands.add_parser("site", help="write parts of a site file").add_subparsers(dest="part", required=True)
    importer = plans.add_parser(
        "import", help="print sections of a site file from an Open-RMF building file or an openTCS plant model"
    )
    importer.add_argument("file", type=Path, metavar="FILE")
    importer.add_argument(
        "--width", type=float, default=plan_reader.WIDTH_M, metavar="M", help="width of lanes and places, metres"
    )
    importer.set_defaults(run=_site_import)

    propose = plans.add_parser("suggest", help="print resources at places where robots often stand, from recorded logs")
    propose.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="a file, or a directory of logs")
    propose.add_argument(
        "--site", type=Path, metavar="SITE.toml", help="the site file of the log, with the resources known already"
    )
    propose.set_defaults(run=_site_suggest)


def _add_ports(command: argparse.ArgumentParser) -> None:
    command.add_argument("--host", help="address that both ports listen on")
    command.add_argument("--open", action="store_true", help="allow access without credentials, also from a network")
    command.add_argument("--robots-port", type=int, metavar="PORT")
    command.add_argument("--operator-port", type=int, metavar="PORT")


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

    return drill_run.drill(args.drills or DRILLS, render, ignored=args.ignore)


def _site_import(args: argparse.Namespace) -> int:
    sys.stdout.write(plan_reader.imported_toml(args.file, args.width))
    return 0


def _site_suggest(args: argparse.Namespace) -> int:
    from deconflict.contention.suggest_resources import suggested  # noqa: PLC0415 - loads numba

    logs.files_of(args.logs)
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
    gc.set_threshold(*COLLECTED_EVERY)
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
        logs.LogError,
        BoxError,
    ) as error:
        sys.stderr.write(f"deconflict: {error}\n")
        return MISUSED


if __name__ == "__main__":
    sys.exit(main())
