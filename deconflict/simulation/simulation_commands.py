"""The commands with simulated vendors: `demo`, `drill` and `simulate`."""

import argparse
import asyncio
import json
import signal
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from deconflict.operator.http.api_sources import Exposition
from deconflict.roles.processes.ports import LAST_PORT
from deconflict.roles.service_commands import add_ports, check_access, settings_of
from deconflict.runtime.command_parsers import LONGEST_S, MISUSED, Commands, add_command, number_in, whole_in
from deconflict.simulation.demo.demo_site import ROBOTS, demo_site

if TYPE_CHECKING:
    from deconflict.settings.site import Site
    from deconflict.simulation.demo.demo_floor import FollowingFloor
    from deconflict.simulation.drills.drill_scripts import Drill

MOST_ROBOTS = 100_000
LAST_SEED = (1 << 32) - 1


def add_simulation_commands(commands: Commands, exposition: Exposition) -> None:
    """Add the commands to the command line. `exposition` writes the metrics."""
    demo_parser = add_command(
        commands,
        "demo",
        "run the service with simulated vendors on a bundled site",
        "deconflict demo",
        "deconflict demo --robots 60 --seconds 120 --data build/demo",
        "deconflict demo --robots 60 --advice      # what does following the advice save?",
        "deconflict demo --scene standoffs --seconds 840    # what does advice save that ends standoffs?",
    )
    _add_simulated_world(demo_parser)
    demo_parser.add_argument(
        "--seconds",
        type=number_in(0, LONGEST_S),
        metavar="S",
        help="stop so long after the engine is ready; 60 without a terminal, else never",
    )
    demo_parser.add_argument(
        "--scene",
        choices=("warehouse", "standoffs"),
        default="warehouse",
        help="warehouse (the default), or standoffs: robots stand for each other, with advice off and on in turns",
    )
    demo_parser.add_argument(
        "--advice",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="let the robots follow the advice of situations, and show what that saves; by default they ignore it",
    )
    add_ports(demo_parser)
    demo_parser.add_argument(
        "--data", type=Path, help="directory to keep recordings and advisories; else they are discarded"
    )
    demo_parser.add_argument(
        "--json", action="store_true", help="end with the figures as JSON, as always without a terminal"
    )
    demo_parser.set_defaults(run=_demo)
    _add_drill(commands, exposition)
    _add_simulate(commands)


def _add_drill(commands: Commands, exposition: Exposition) -> None:
    drill_parser = add_command(
        commands,
        "drill",
        "run scripted situations through the whole service, and score advice",
        "deconflict drill",
        "deconflict drill --advice situations",
        "deconflict drill --ignore       # the same, with robots that ignore all advice",
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
    drill_parser.set_defaults(run=partial(_drill, exposition))


def _add_simulate(commands: Commands) -> None:
    simulate_parser = add_command(
        commands,
        "simulate",
        "run simulated vendors that report to a running service",
        "deconflict simulate --robots 24",
        "deconflict simulate --url ws://127.0.0.1:3000 --robots 200 --seconds 60",
        "deconflict simulate --broker 127.0.0.1:1883",
    )
    simulate_parser.add_argument(
        "--url", default="ws://127.0.0.1:3000", help="the service's robots' port (default: %(default)s)"
    )
    simulate_parser.add_argument(
        "--broker",
        type=_broker,
        metavar="HOST[:PORT]",
        help="an MQTT broker, where Basalt speaks VDA 5050 and Alder ISO 21423; the service needs it in its site file",
    )
    _add_simulated_world(simulate_parser)
    simulate_parser.add_argument(
        "--seconds", type=number_in(0, LONGEST_S), metavar="S", help="stop after this time; else at Ctrl-C"
    )
    simulate_parser.set_defaults(run=_simulate)


def _add_simulated_world(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--robots",
        type=whole_in(1, MOST_ROBOTS),
        default=ROBOTS,
        metavar="N",
        help="number of simulated robots (default: %(default)s)",
    )
    command.add_argument(
        "--seed",
        type=whole_in(0, LAST_SEED),
        default=1,
        metavar="N",
        help="seed of the simulated traffic (default: %(default)s)",
    )


def _broker(text: str) -> tuple[str, int]:
    host, _, port = text.partition(":")
    if not host:
        raise argparse.ArgumentTypeError(f"{text!r} is no broker; give HOST or HOST:PORT")
    return host, whole_in(1, LAST_PORT)(port or "1883")


def _drill_named(name: str) -> "Drill":
    from deconflict.simulation.drills.drill_scripts import DRILLS  # noqa: PLC0415 - loads the simulated world

    for drill in DRILLS:
        if drill.name == name:
            return drill
    raise argparse.ArgumentTypeError(f"no drill is named {name}; choose of {', '.join(drill.name for drill in DRILLS)}")


def _demo(args: argparse.Namespace) -> int:
    from deconflict.simulation.demo.demo_run import demo  # noqa: PLC0415 - loads the simulated world

    if args.advice and args.scene == "standoffs":
        sys.stderr.write("deconflict: leave out --advice: the scene standoffs turns advice off and on by itself\n")
        return MISUSED
    settings = settings_of(args, demo_site())
    check_access(settings, args.open)
    return demo(*_demo_scene(args, settings), args.seconds, args.data, as_json=args.json)


def _demo_scene(args: argparse.Namespace, site: "Site") -> "tuple[Site, FollowingFloor]":
    """The site and the robots of the scene that was chosen."""
    from deconflict.simulation.demo.demo_floor import DemoFloor, with_halls  # noqa: PLC0415 - loads the simulated world
    from deconflict.simulation.demo.standoff_floor import StandoffFloor  # noqa: PLC0415 - loads the simulated world
    from deconflict.simulation.demo.standoff_hall import standoff_site  # noqa: PLC0415 - loads the simulated world

    if args.scene == "standoffs":
        return standoff_site(site, args.robots), StandoffFloor(args.robots, args.seed)
    return with_halls(site, args.robots), DemoFloor(args.robots, args.seed, follows_advice=args.advice)


def _drill(exposition: Exposition, args: argparse.Namespace) -> int:
    from deconflict.simulation.drills import drill_run  # noqa: PLC0415 - loads the engine
    from deconflict.simulation.drills.drill_scripts import DRILLS  # noqa: PLC0415 - loads the simulated world

    return drill_run.drill(args.drills or DRILLS, exposition, ignored=args.ignore, source=args.advice)


def _simulate(args: argparse.Namespace) -> int:
    from deconflict.simulation.vendors.broker_sender import BrokerSender  # noqa: PLC0415 - loads the simulated world
    from deconflict.simulation.vendors.senders import RobotFloor, simulate, warehouse  # noqa: PLC0415 - loads the simulated world

    async def run() -> dict[str, int]:
        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, stop.set)
        floor = RobotFloor(*warehouse(args.robots, args.seed))
        host, port = args.broker or ("", 0)
        on_broker = partial(BrokerSender, host=host, port=port) if args.broker else None
        return await simulate(args.url, floor, args.seconds, on_broker=on_broker, stop=stop)

    sent = asyncio.run(run())
    sys.stdout.write(json.dumps(sent) + "\n")
    if any(sent.values()):
        return 0
    sys.stderr.write(f"deconflict: nothing was sent: no service answers at {args.url}\n")
    return MISUSED
