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

from deconflict.operator.blackbox.start_state import BoxError
from deconflict.operator.http import access, api_descriptions, json_schemas
from deconflict.roles.service import cluster_problems, run_role, runtime_directory
from deconflict.roles.supervisor import PARTS, Supervisor
from deconflict.runtime.data_lock import DataTakenError, held
from deconflict.runtime.logging_setup import FORMATS, VARIABLE
from deconflict.runtime.logging_setup import begin as begin_log
from deconflict.runtime.rpc import PortTakenError
from deconflict.runtime.systemd import Notifier
from deconflict.settings import site
from deconflict.settings.importers import plan_reader
from deconflict.settings.importers.plan import PlanError
from deconflict.settings.site_check import check
from deconflict.simulation import demo
from deconflict.simulation.demo_site import demo_site
from deconflict.simulation.drills.drill_scripts import DRILLS
from deconflict.simulation.vendors.senders import simulate
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError
from metrics import commands as logs
from metrics.monitoring import dashboards
from metrics.monitoring.exposition import render

FAILED, MISUSED = 1, 2
COLLECTED_EVERY = (50_000, 20, 100)
"""Allocations between two searches for garbage in cycles, and searches between those of older objects. There are hardly
any cycles, and of ten thousand robots a million objects, which Python's own 700 had searched a sixth of the time."""
DESCRIBED = json_schemas.SCHEMAS | {"openapi": api_descriptions.openapi, "asyncapi": api_descriptions.asyncapi}


def parser() -> argparse.ArgumentParser:
    root = argparse.ArgumentParser(
        prog="deconflict",
        description="Traffic deconfliction for floors shared by robots of many vendors. Advisory, not safety rated.",
    )
    root.add_argument("--version", action="version", version=f"deconflict {version('amr-deconflict')}")
    kind = os.environ.get(VARIABLE, "text")
    root.add_argument(
        "--log", choices=FORMATS, default=kind if kind in FORMATS else "text", help=f"how to log; also {VARIABLE}"
    )
    commands = root.add_subparsers(dest="command", required=True)

    serve = commands.add_parser("serve", help="run the service")
    serve.add_argument("site", nargs="?", type=Path, metavar="SITE.toml", help="without it, each datum is a floor")
    _add_ports(serve)
    serve.add_argument("--data", type=Path, help="directory for recordings and advisories")
    serve.add_argument(
        "--part", action="append", choices=list(PARTS), help="of a cluster, run this here; may be repeated"
    )
    serve.set_defaults(run=_serve)

    show = commands.add_parser("demo", help="run the service with simulated vendors on a bundled site")
    show.add_argument("--robots", type=_positive, default=demo.ROBOTS, metavar="N")
    show.add_argument("--seconds", type=float, metavar="S", help="stop after this time; without a terminal, 60")
    show.add_argument("--seed", type=int, default=1)
    _add_ports(show)
    show.add_argument("--data", type=Path, help="keep recordings and advisories here; else they are discarded")
    show.set_defaults(run=_demo)

    practise = commands.add_parser("drill", help="short scripts through the whole service, and what advice is worth")
    practise.add_argument("names", nargs="*", metavar="NAME", choices=[[], *(one.name for one in DRILLS)])
    practise.add_argument("--ignore", action="store_true", help="nobody does as advised, to see what comes of it")
    practise.set_defaults(run=_drill)

    verify = commands.add_parser("check", help="check a site file and each vendor's fit to the common frame")
    verify.add_argument("site", type=Path, metavar="SITE.toml")
    verify.set_defaults(run=lambda args: check(args.site, sys.stdout))

    _add_site(commands)

    pretend = commands.add_parser("simulate", help="simulated vendors that talk to a running service")
    pretend.add_argument("--url", default="ws://127.0.0.1:3000", help="the service's robots' port")
    pretend.add_argument("--robots", type=_positive, default=demo.ROBOTS, metavar="N")
    pretend.add_argument("--seconds", type=float, metavar="S", help="stop after this time")
    pretend.add_argument("--seed", type=int, default=1)
    pretend.set_defaults(run=_simulate)

    logs.add(commands)

    describe = commands.add_parser("schema", help="print a JSON Schema, or OpenAPI or AsyncAPI")
    describe.add_argument("name", choices=sorted(DESCRIBED))
    describe.set_defaults(run=_schema)

    boards = commands.add_parser("dashboards", help="write Grafana dashboards and Prometheus rules")
    boards.add_argument("folder", type=Path, metavar="DIR")
    boards.set_defaults(run=_dashboards)

    role = commands.add_parser("role")
    role.add_argument("name")
    role.add_argument("runtime", type=Path)
    role.add_argument("data", type=Path)
    role.set_defaults(run=_role)
    return root


def _add_site(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    plans = commands.add_parser("site", help="make parts of a site file").add_subparsers(dest="part", required=True)
    take = plans.add_parser("import", help="from an Open-RMF building file or an openTCS plant model, to paste")
    take.add_argument("file", type=Path, metavar="FILE")
    take.add_argument(
        "--width", type=float, default=plan_reader.WIDTH_M, metavar="M", help="of lanes and places, metres"
    )
    take.set_defaults(run=_site_import)

    propose = plans.add_parser("suggest", help="resources where robots of a recorded log keep standing, to paste")
    propose.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="a file, or a directory of logs")
    propose.add_argument(
        "--site", type=Path, metavar="SITE.toml", help="how to read the log, and what is known already"
    )
    propose.set_defaults(run=_site_suggest)


def _add_ports(command: argparse.ArgumentParser) -> None:
    command.add_argument("--host", help="address that both ports listen on")
    command.add_argument("--open", action="store_true", help="let everybody in, also from a network")
    command.add_argument("--robots-port", type=int, metavar="PORT")
    command.add_argument("--operator-port", type=int, metavar="PORT")


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number


def _settings(args: argparse.Namespace, path: Path | None) -> site.Site:
    """The site file with what the command line says instead."""
    settings = site.load(path) if path else site.DEFAULT
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
    settings = _sound(args)
    if args.site is None:
        logging.getLogger("deconflict").warning("no site file: every datum is taken as a floor of its own")
    if told := cluster_problems(settings.cluster, args.part or ()):
        raise site.SiteError(told)
    data = args.data or Path(settings.store.directory)
    data.mkdir(parents=True, exist_ok=True)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    parts, manager = args.part or tuple(PARTS), Notifier(os.environ)
    with held(data, parts), runtime_directory() as name:
        supervisor = Supervisor(settings, data, Path(name), lambda: _sound(args), parts, manager)
        signal.signal(signal.SIGHUP, lambda *_: supervisor.reloader.ask())
        supervisor.run(stop)
    return 0


def _sound(args: argparse.Namespace) -> site.Site:
    """The settings that the service may run with. Raises where it may not."""
    settings = _settings(args, args.site)
    problems = site.problems(settings)
    if problems:
        raise site.SiteError(problems)
    _guard(settings, args.open)
    return settings


def _guard(settings: site.Site, asked: bool) -> None:
    """Raises where credentials can't be used, or where a port is open to a network without any unasked."""
    access.verify(settings)
    told = access.exposed(settings)
    if told and not asked:
        raise site.SiteError([*told, "or start with --open, if everybody on that network may speak and read"])
    for one in told:
        logging.getLogger("deconflict").warning("%s", one)


def _demo(args: argparse.Namespace) -> int:
    settings = _settings(args, demo_site())
    _guard(settings, args.open)
    return demo.demo(settings, args.robots, args.seconds, args.seed, args.data)


def _drill(args: argparse.Namespace) -> int:
    from deconflict.simulation.drills import drill_run  # noqa: PLC0415 - brings the engine

    drills = [one for one in DRILLS if one.name in (args.names or [one.name])]
    return drill_run.drill(drills, render, ignored=args.ignore)


def _site_import(args: argparse.Namespace) -> int:
    sys.stdout.write(plan_reader.imported(args.file, args.width))
    return 0


def _site_suggest(args: argparse.Namespace) -> int:
    from deconflict.contention.suggest_resources import suggested  # noqa: PLC0415 - brings numba

    logs.files_of(args.logs)
    sys.stdout.write(suggested(args.logs, site.load(args.site) if args.site else site.DEFAULT))
    return 0


def _simulate(args: argparse.Namespace) -> int:
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
    """Run one command; its exit code."""
    gc.set_threshold(*COLLECTED_EVERY)
    args = parser().parse_args()
    begin_log(args.log)
    try:
        return int(args.run(args))
    except (
        site.SiteError,
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
