"""`deconflict drill`: the whole service on a floor of drills, with robots that do as they are advised.

It shows that each kind of advisory comes ahead of time, and that following what it advises ends it at the promised
cost: the robots speak over sockets, and a service of the site follows the stream and tells them what to do.
"""

import asyncio
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from deconflict.client import Client
from deconflict.contention.robots.place_geometry import Geometry
from deconflict.operator.http.api_sources import Exposition
from deconflict.roles.service import run_in_one_process
from deconflict.simulation.drills.drill_outcomes import Outcome, Outcomes, documents
from deconflict.simulation.drills.drill_scripts import Drill, party, staged
from deconflict.simulation.drills.errands import STEP_S, Party
from deconflict.simulation.drills.site_service import SiteService
from deconflict.simulation.vendors.dialects import DIALECTS
from deconflict.simulation.vendors.senders import OWN_PATH, Line, call

LONGEST_S = 120.0


def drill(drills: Sequence[Drill], exposition: Exposition, *, ignored: bool) -> int:
    """Run drills at once; 0 where all advice that was followed kept its promise. With `ignored` nobody follows any."""
    console = Console()
    does = "nobody does as advised" if ignored else "robots do as they are advised"
    console.print(f"{len(drills)} drills at once, about a minute; {does}")
    with TemporaryDirectory(prefix="deconflict-drill-") as data:
        outcomes = asyncio.run(played(drills, Path(data), exposition, ignored=ignored))
    console.print(_table(outcomes))
    sys.stdout.write(json.dumps(documents(outcomes)) + "\n")
    kept = [one.kept for one, each in zip(outcomes, drills, strict=True) if each.heeds]
    return 0 if ignored or all(kept) else 1


async def played(
    drills: Sequence[Drill], data: Path, exposition: Exposition, *, ignored: bool = False
) -> list[Outcome]:
    """What comes of these drills, once all robots are through and told, or after two minutes."""
    site, stages = staged(drills, ignored=ignored)
    everybody, outcomes = party(stages), Outcomes(drills, stages)
    async with run_in_one_process(site, data, exposition) as (receiver, operator):
        start_s = time.time()
        service = SiteService(everybody, Geometry(site.resources, site.zones), start_s)
        robots_url, url = f"ws://127.0.0.1:{receiver.receiver.port}", f"http://127.0.0.1:{operator.port}"
        playing = asyncio.create_task(_play(everybody, robots_url, start_s))
        following = asyncio.create_task(_follow(url, service, outcomes))
        try:
            while not outcomes.over() and time.time() < start_s + LONGEST_S:
                await asyncio.wait({playing, following}, timeout=0.5, return_when=asyncio.FIRST_EXCEPTION)
                for one in (playing, following):
                    if one.done():
                        one.result()
        finally:
            playing.cancel()
            following.cancel()
            await asyncio.gather(playing, following, return_exceptions=True)
    return outcomes.now()


async def _follow(url: str, service: SiteService, outcomes: Outcomes) -> None:
    async with Client(url) as client:
        async for advisory in client.follow(after=0):
            outcomes.take(advisory, passed_on=service.take(advisory))


async def _play(everybody: Party, url: str, start_s: float) -> None:
    """Let time pass as the clock does, and let everybody report in turn, each over a connection of its own."""
    lines = [Line(one.member.make.vendor) for one in everybody.errands]
    rng = np.random.default_rng(1)
    calls = [
        asyncio.create_task(call(url + (f"/{one.vendor}" if one.vendor in OWN_PATH else ""), one, rng)) for one in lines
    ]
    try:
        step = 0
        while True:
            await asyncio.sleep(max(start_s + step * STEP_S - time.time(), 0.0))
            _report(everybody, lines, step, start_s + step * STEP_S)
            everybody.step(STEP_S)
            step += 1
    finally:
        for one in calls:
            one.cancel()
        await asyncio.gather(*calls, return_exceptions=True)


def _report(everybody: Party, lines: Sequence[Line], step: int, now_s: float) -> None:
    for row, (errand, line) in enumerate(zip(everybody.errands, lines, strict=True)):
        every = round(errand.member.make.report_every_s / STEP_S)
        if line.up and (step + 3 * row) % every == 0:
            introduce = row not in line.introduced
            line.introduced.add(row)
            line.put(DIALECTS[line.vendor].messages(errand.robot(), now_s, introduce=introduce))


def _table(outcomes: Sequence[Outcome]) -> Table:
    table = Table(title="Drills", expand=True)
    for column in ("drill", "told ahead", "advice", "promised", "cost", "ended"):
        table.add_column(column)
    for one in outcomes:
        lead = "-" if one.lead_s is None else f"{one.kind}, {one.lead_s:.0f} s"
        advice = one.advised.split(";")[-1].strip() or "-"
        table.add_row(one.drill, lead, advice, f"{one.promised_s:g} s", f"{one.late_s:g} s", one.ended or "no")
    return table
