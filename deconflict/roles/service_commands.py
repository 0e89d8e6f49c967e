"""The commands that run the service: `serve`, `alive` and `prepare`; and `site new`, which listens like it."""

import argparse
import asyncio
import logging
import os
import signal
import sys
import threading
import time
from operator import attrgetter
from pathlib import Path
from typing import Any

from deconflict.roles.processes.alive_command import ask_ports
from deconflict.roles.processes.data_formats import refuse_newer
from deconflict.roles.processes.ports import port_number, refuse_taken
from deconflict.roles.processes.supervisor import PARTS, PORTS, Supervisor
from deconflict.roles.service import cluster_problems, runtime_directory
from deconflict.runtime.command_parsers import LONGEST_S, Commands, add_command, number_in
from deconflict.runtime.data_lock import create_data_directory, locked, said_if_late
from deconflict.runtime.kernel_preparation import ALL_PACKAGES, compile_kernels, report_on_terminal
from deconflict.runtime.systemd import Notifier
from deconflict.settings import site, site_file
from deconflict.settings.importers.heard_robots import HeardRobots, proposed_site
from deconflict.settings.importers.site_questions import SiteAnswers, asked
from deconflict_client.counted_nouns import count_of
from ingest.settings import ReceiverSettings


def add_service_commands(commands: Commands) -> None:
    """Add the commands to the command line."""
    serve_parser = add_command(
        commands,
        "serve",
        "run the service",
        "deconflict serve SITE.toml",
        "deconflict serve SITE.toml --host 0.0.0.0 --data /var/lib/deconflict",
        "deconflict serve        # without a site file every datum is a separate floor",
    )
    _add_served(serve_parser)
    _add_open(serve_parser)
    serve_parser.add_argument("--data", type=Path, help="directory for recordings and advisories")
    serve_parser.set_defaults(run=_serve)

    alive_parser = add_command(
        commands,
        "alive",
        "ask the ports of a service on this machine whether they answer; exit code 0 also if its health is not ok",
        "deconflict alive SITE.toml",
        "deconflict alive SITE.toml --part ingest      # with the same ports and parts as `serve`",
    )
    _add_served(alive_parser)
    alive_parser.set_defaults(run=_alive)

    prepare_parser = add_command(
        commands,
        "prepare",
        "compile the kernels, so that the first start of the service is quick",
        "deconflict prepare      # in the build of an image, or after an update",
    )
    prepare_parser.set_defaults(run=_prepare)


def _add_served(command: argparse.ArgumentParser) -> None:
    """What a service on this machine serves."""
    command.add_argument(
        "site", nargs="?", type=Path, metavar="SITE.toml", help="the site file; without it, each datum is a floor"
    )
    _add_addresses(command)
    command.add_argument(
        "--part", action="append", choices=list(PARTS), help="the part of a cluster that runs here; may be repeated"
    )


def add_ports(command: argparse.ArgumentParser) -> None:
    _add_addresses(command)
    _add_open(command)


def _add_open(command: argparse.ArgumentParser) -> None:
    command.add_argument("--open", action="store_true", help="allow access without credentials, also from a network")


def _add_addresses(command: argparse.ArgumentParser) -> None:
    command.add_argument("--host", help="address that both ports listen on; this machine only by default")
    command.add_argument(
        "--robots-port",
        type=port_number,
        metavar="PORT",
        help="port for the robots' messages; 3000 or as in the site file",
    )
    command.add_argument(
        "--operator-port",
        type=port_number,
        metavar="PORT",
        help="port of the API, the stream and the page; 8080 or as in the site file",
    )


def settings_of(args: argparse.Namespace, path: Path | None) -> site.Site:
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


def check_access(settings: site.Site, allow_open: bool) -> None:
    """Raises if credentials can't be used, or a port is open to a network without credentials and without --open."""
    from deconflict.operator.http import access  # noqa: PLC0415 - `serve` and its supervisor run on without it

    access.verify_credentials(settings)
    problems = access.exposed_ports(settings)
    if problems and not allow_open:
        raise site_file.SiteError([*problems, "or start with --open, if everybody on that network may read and write"])
    for problem in problems:
        logging.getLogger("deconflict").warning("%s", problem)


def serving_problems(settings: site.Site) -> list[str]:
    """A sentence for each reason why this machine can't serve a site. Raises `SecretError` and `CertificateError`."""
    from deconflict.operator.http import access  # noqa: PLC0415 - `serve` and its supervisor run on without it

    access.verify_credentials(settings)
    return cluster_problems(settings.cluster, ())


def _checked_settings(args: argparse.Namespace) -> site.Site:
    """The settings, checked. Raises `SiteError`, `SecretError` and `CertificateError`."""
    settings = settings_of(args, args.site)
    problems = site_file.fit_problems(settings)
    if problems:
        raise site_file.SiteError(problems)
    check_access(settings, args.open)
    return settings


def _serve(args: argparse.Namespace) -> int:
    settings = _checked_settings(args)
    if args.site is None:
        logging.getLogger("deconflict").warning("no site file: every datum is taken as a floor of its own")
    if problems := cluster_problems(settings.cluster, args.part or ()):
        raise site_file.SiteError(problems)
    data = args.data or Path(settings.store.directory)
    late, stop = said_if_late(data), threading.Event()
    create_data_directory(data)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    parts, manager = args.part or tuple(PARTS), Notifier(os.environ)
    with locked(data, parts), runtime_directory() as name:
        refuse_newer(data)
        late.cancel()
        refuse_taken(settings, [role for part in parts for role in PARTS[part] if role in PORTS])
        supervisor = Supervisor(settings, data, Path(name), lambda: _checked_settings(args), parts, manager)
        signal.signal(signal.SIGHUP, lambda *_: supervisor.reloader.request())
        supervisor.run(stop)
    return 0


def _alive(args: argparse.Namespace) -> int:
    return ask_ports(settings_of(args, args.site), args.part or PARTS)


def _prepare(_: argparse.Namespace) -> int:
    compile_kernels(ALL_PACKAGES, report_on_terminal)
    return 0


def add_site_new(parts: Commands) -> None:
    """Add the command that listens to robots and proposes a site file."""
    new_parser = add_command(
        parts,
        "new",
        "listen to the robots for a while, ask a few questions, and print a site file of what was heard",
        "deconflict site new > SITE.toml",
        "deconflict site new --seconds 120 --host 0.0.0.0 --open > SITE.toml",
    )
    new_parser.add_argument(
        "--seconds",
        type=number_in(0, LONGEST_S),
        default=60.0,
        metavar="S",
        help="how long to listen; 0 only asks (default: %(default)s)",
    )
    new_parser.add_argument("--host", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    new_parser.add_argument(
        "--robots-port",
        type=port_number,
        default=3000,
        metavar="PORT",
        help="port for the robots (default: %(default)s)",
    )
    new_parser.add_argument("--open", action="store_true", help="listen to a network, too, without credentials")
    new_parser.set_defaults(run=_site_new)


def _site_new(args: argparse.Namespace) -> int:
    settings = site.Site(receiver=ReceiverSettings(host=args.host, port=args.robots_port))
    check_access(settings, args.open)
    heard = HeardRobots(asyncio.run(_heard(settings, args.seconds)) if args.seconds else [])
    is_person_there = sys.stdin.isatty() and sys.stderr.isatty()
    answers = asked(_ask, heard.by_vendor, heard.site_datums()) if is_person_there else SiteAnswers()
    if not heard.by_vendor and not answers.expected:
        raise site_file.SiteError([_nobody(args)])
    sys.stdout.write(proposed_site(heard, answers))
    return 0


def _nobody(args: argparse.Namespace) -> str:
    """Why no site can be proposed."""
    if args.seconds:
        return f"no robot connected to ws://{args.host}:{args.robots_port}/; see docs/access.md"
    return "no vendor was named, and with --seconds 0 none is heard"


def _ask(question: str, default: str) -> str:
    """Ask on standard error: standard output is the site file. The end of the input is an empty answer."""
    sys.stderr.write(f"{question}{f' [{default}]' if default else ''}: ")
    sys.stderr.flush()
    return sys.stdin.readline().strip() or default


async def _heard(settings: site.Site, seconds: float) -> list[dict[str, Any]]:
    """The robots that reported within a time."""
    from deconflict.roles.receiver_role import ReceiverRole  # noqa: PLC0415 - the supervisor needs no role
    from ingest.fleet import fleet_report  # noqa: PLC0415 - the supervisor needs no fleet

    refuse_taken(settings, ["receiver"])
    with runtime_directory() as name:
        role, stop = ReceiverRole(settings, Path(name), Path(name) / "log"), asyncio.Event()
        running = asyncio.create_task(role.run(stop))
        opened = asyncio.create_task(role.ready.wait())
        await asyncio.wait({running, opened}, return_when=asyncio.FIRST_COMPLETED)
        opened.cancel()
        if not running.done():
            sys.stderr.write(
                f"listening on {settings.receiver.host}, port {settings.receiver.port}, for {seconds:g} s\n"
            )
            await asyncio.sleep(seconds)
        stop.set()
        await running
        robots = sorted(role.fleet.robots.values(), key=attrgetter("uuid"))
        sys.stderr.write(f"{count_of(len(robots), 'robot was', 'robots were')} heard\n")
        return [fleet_report.robot_document(role.fleet, robot, time.time()) for robot in robots]
