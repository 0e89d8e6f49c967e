"""The demo: the whole service, simulated vendors that connect to it over real sockets, and a live table."""

import asyncio
import json
import signal
import sys
import threading
import time
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager, closing, suppress
from errno import EADDRINUSE
from functools import partial
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import httpx
from rich.console import Console
from rich.live import Live
from rich.text import Text
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from deconflict.operator.ledger.loss_ledger import LossLedger
from deconflict.operator.ledger.loss_questions import LossQuestion
from deconflict.roles.engine_link.tick_times import IDLE_TICK_S
from deconflict.roles.processes.ports import PortTakenError, listen_at
from deconflict.roles.processes.supervisor import PARTS, PORTS, Supervisor
from deconflict.roles.service import runtime_directory
from deconflict.runtime.data_lock import create_data_directory, locked
from deconflict.runtime.rpc import AsyncCaller, LinkDownError
from deconflict.settings.site import LossSettings, Site
from deconflict.simulation.demo.demo_floor import FollowingFloor
from deconflict.simulation.demo.demo_view import DemoView, advisory_line, summary, tables
from deconflict.simulation.vendors.broker_sender import LANGUAGES, DirectSender
from deconflict.simulation.vendors.senders import simulate
from deconflict_client.advisory import AdvisoryState
from deconflict_client.client import Client, ClientError
from deconflict_client.situations import REVISION, is_advisory
from ingest.languages.visible_text import visible
from ingest.port.brokers.mqtt_source import MqttSource

SECONDS_WITHOUT_TERMINAL = 60.0
START_WITHIN_S = 60.0
"""For its ports to open; the engine may take longer."""
REFRESH_S = 0.5
SOURCES = tuple(MqttSource(name=vendor, host="", language=language) for vendor, language in LANGUAGES.items())
"""Where the service hears the vendors that do not speak MassRobotics."""


def demo(site: Site, floor: FollowingFloor, seconds: float | None, data: Path | None, *, as_json: bool) -> int:
    """Run the demo. It ends `seconds` after the engine is up, or after a minute if there is no terminal.

    Prints what happened in sentences, and its figures as JSON if asked to or without a terminal.
    """
    console = Console()
    if seconds is None and not console.is_terminal:
        seconds = SECONDS_WITHOUT_TERMINAL
    site = _on_free_ports(site, console).model_copy(update={"mqtt_sources": SOURCES})
    with (
        TemporaryDirectory(prefix="deconflict-demo-") as discarded,
        runtime_directory() as runtime,
        ExitStack() as held,
    ):
        kept = data or Path(discarded)
        create_data_directory(kept)
        held.enter_context(locked(kept, PARTS))
        lost_before_s = _lost_to_others_s(kept)
        stop = threading.Event()
        supervisor = threading.Thread(target=Supervisor(site, kept, Path(runtime)).run, args=(stop,))
        supervisor.start()
        try:
            view = asyncio.run(_show(site, Path(runtime), console, floor, seconds))
        except TimeoutError:
            sys.stderr.write(f"deconflict: the service did not start within {START_WITHIN_S:.0f} s; its log says why\n")
            return 1
        finally:
            stop.set()
            supervisor.join()
        figures = view.result() | {"lost_to_others_s": round(_lost_to_others_s(kept) - lost_before_s, 1)}
    for line in (*summary(figures), *floor.report()):
        console.print(line, soft_wrap=True)
    if as_json or not console.is_terminal:
        sys.stdout.write(json.dumps(figures | floor.result()) + "\n")
    return 0


def _lost_to_others_s(data: Path) -> float:
    """The sum of the ledger, which the page shows, too."""
    with closing(LossLedger(data, LossSettings())) as ledger:
        return ledger.ask(LossQuestion(0.0, inf)).total.lost_s


def _on_free_ports(site: Site, console: Console) -> Site:
    """The site with every occupied port replaced by a free one. Prints each replacement.

    Raises `PortTakenError` if no port of a host can be used.
    """
    sections = {}
    with ExitStack() as listeners:
        for name in PORTS:
            wanted = getattr(site, name)
            try:
                listening = listen_at(name, wanted)
            except PortTakenError as error:
                if error.errno != EADDRINUSE:
                    raise
                listening = listen_at(name, wanted.model_copy(update={"port": 0}))
            port = listeners.enter_context(listening).getsockname()[1]
            if wanted.port not in (0, port):
                console.print(f"Port {wanted.port} is in use. The {name} listens on {port} instead.")
            sections[name] = wanted.model_copy(update={"port": port})
    return site.model_copy(update=sections)


async def _show(site: Site, runtime: Path, console: Console, floor: FollowingFloor, seconds: float | None) -> DemoView:
    stop, loop, view = asyncio.Event(), asyncio.get_running_loop(), DemoView()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    operator = AsyncCaller(runtime, "operator")
    console.print("Starting the service …")
    await _until_ports_open(operator, stop)
    if stop.is_set():
        return view
    _print_addresses(site, console, floor)
    limit = _stop_later(operator, floor, view, console, seconds, stop)
    async with _background(_follow(site, floor, view, console), _measure(operator, floor, view), limit):
        simulating = asyncio.create_task(
            simulate(_robots_url(site), floor, None, on_broker=partial(DirectSender, runtime=runtime), stop=stop)
        )
        if console.is_terminal:
            with Live(console=console, screen=False, auto_refresh=False) as live:
                while not simulating.done():
                    live.update(tables(view, floor.sentence()), refresh=True)
                    await asyncio.wait({simulating}, timeout=REFRESH_S)
        await simulating
        await asyncio.sleep(IDLE_TICK_S)
        view.measure(json.loads(await operator.call("measures")))
    return view


@asynccontextmanager
async def _background(*work: Any) -> AsyncIterator[None]:
    tasks = [asyncio.create_task(coroutine) for coroutine in work]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _until_ports_open(operator: AsyncCaller, stop: asyncio.Event) -> None:
    """Raises `TimeoutError`."""
    async with asyncio.timeout(START_WITHIN_S):
        while not stop.is_set():
            with suppress(LinkDownError):
                if json.loads(await operator.call("health"))["roles"]["receiver"] == "up":
                    return
            await asyncio.sleep(0.05)


async def _stop_later(
    operator: AsyncCaller,
    floor: FollowingFloor,
    view: DemoView,
    console: Console,
    seconds: float | None,
    stop: asyncio.Event,
) -> None:
    """Show how far the engine is, say when it is up, and stop `seconds` after that."""
    while not stop.is_set():
        with suppress(LinkDownError):
            health = json.loads(await operator.call("health"))
            if health["roles"]["engine"] == "up":
                break
            if health["preparing"] and view.preparing is None and not console.is_terminal:
                console.print("Robots move. The engine is being prepared, once on this machine: a minute or two")
            view.preparing = health["preparing"]
        await asyncio.sleep(REFRESH_S)
    if view.preparing and not console.is_terminal:
        console.print("The engine is ready: conflicts are predicted from now on")
    view.preparing = None
    floor.begin()
    if seconds is not None:
        await asyncio.sleep(seconds)
        stop.set()


def _robots_url(site: Site) -> str:
    return f"ws://{site.receiver.host}:{site.receiver.port}"


def _print_addresses(site: Site, console: Console, floor: FollowingFloor) -> None:
    robots = len(floor.world) + len(floor.annex.members)
    face = f"{site.operator.host}:{site.operator.port}"
    lines = (
        Text(f"{visible(site.name)}: {robots} simulated {floor.who} connect to {_robots_url(site)}"),
        Text(f"Open http://{face}/ to see the floor and the predictions", "bold"),
        f"Advisories  http://{face}/advisories   stream ws://{face}/advisories/stream",
        f"Robots      http://{face}/robots       metrics http://{face}/metrics",
    )
    for line in lines:
        console.print(line, soft_wrap=True)


async def _follow(site: Site, floor: FollowingFloor, view: DemoView, console: Console) -> None:
    """Follow the stream as a site service does: from the last sequence number, again after every lost connection."""
    seen = 0
    while True:
        url = f"ws://{site.operator.host}:{site.operator.port}/advisories/stream?after={seen}"
        url += "&kinds=situation,advisory,advice" if floor.follows_advice else ""
        try:
            async with connect(url) as stream:
                async for message in stream:
                    revision = REVISION.validate_json(message)
                    seen = revision.seq
                    floor.pass_on(revision, time.time())
                    await _answer(site, floor)
                    if not is_advisory(revision):
                        continue
                    view.add_advisory(revision)
                    if not console.is_terminal and revision.state is not AdvisoryState.UPDATED:
                        console.print(advisory_line(revision), soft_wrap=True)
        except (OSError, ConnectionClosed):
            await asyncio.sleep(REFRESH_S)


async def _answer(site: Site, floor: FollowingFloor) -> None:
    """Send what robots answer to what is asked of them. An answer to what has ended meanwhile is refused."""
    answers = floor.take_answers()
    if answers:
        async with Client(f"http://{site.operator.host}:{site.operator.port}") as client:
            for answer in answers:
                with suppress(ClientError, httpx.HTTPError):
                    await client.answer(answer.advice_id, answer.answer, why=answer.why, name="demo")


async def _measure(operator: AsyncCaller, floor: FollowingFloor, view: DemoView) -> None:
    while True:
        with suppress(LinkDownError):
            view.measure(json.loads(await operator.call("measures")))
            if floor.follows_advice:
                await operator.call("notice", floor.sentence().encode())
        await asyncio.sleep(2 * REFRESH_S)
