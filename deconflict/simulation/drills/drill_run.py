"""`deconflict drill`: the whole service on a floor of drills, with robots that follow its advice.

It shows that each kind of advisory is raised ahead of time, and that following its advice ends the conflict at the
predicted cost. The robots connect over sockets. A site service follows the stream and passes the advice on to them.
"""

import asyncio
import json
import sys
import time
from collections.abc import Sequence
from operator import attrgetter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.operator.http.api_sources import Exposition
from deconflict.roles.service import run_in_one_process
from deconflict.simulation.drills.drill_outcomes import DrillOutcome, DrillOutcomes, documents
from deconflict.simulation.drills.drill_scripts import Drill, set_up_drills
from deconflict.simulation.drills.errands import STEP_S, ErrandGroup
from deconflict.simulation.drills.site_service import SERVICES, AdviceSource, SiteService, SituationService
from deconflict.simulation.vendors.dialects import DIALECTS
from deconflict.simulation.vendors.senders import OWN_PATH, Sender, call
from deconflict_client.client import Client

LONGEST_S = 120.0


def drill(
    drills: Sequence[Drill], exposition: Exposition, *, ignored: bool, source: AdviceSource = "advisories"
) -> int:
    """Run drills at the same time. With `ignored` no robot follows advice.

    Returns 0 if all followed advice had the predicted cost; if situations were followed, whose advice predicts no cost,
    if all drills were resolved.
    """
    console = Console()
    behaviour = "robots ignore the advice" if ignored else f"robots follow the advice of {source}"
    console.print(f"{len(drills)} drills at once, about a minute; {behaviour}")
    with TemporaryDirectory(prefix="deconflict-drill-") as data:
        outcomes = asyncio.run(played(drills, Path(data), exposition, ignored=ignored, source=source))
    console.print(_table(outcomes))
    sys.stdout.write(json.dumps(documents(outcomes)) + "\n")
    is_good = attrgetter("kept" if source == "advisories" else "resolved")
    kept = [is_good(outcome) for outcome, script in zip(outcomes, drills, strict=True) if script.heeds]
    return 0 if ignored or all(kept) else 1


async def played(
    drills: Sequence[Drill],
    data: Path,
    exposition: Exposition,
    *,
    ignored: bool = False,
    source: AdviceSource = "advisories",
) -> list[DrillOutcome]:
    """The outcomes of these drills, once all robots have finished and all advisories are cleared, or after two
    minutes."""
    site, setups = set_up_drills(drills, ignored=ignored)
    errands = ErrandGroup([errand for setup in setups for errand in setup.errands])
    outcomes = DrillOutcomes(drills, setups)
    async with run_in_one_process(site, data, exposition) as (receiver, operator):
        start_s = time.time()
        service = SERVICES[source](errands, PlaceGeometry(site.resources, site.zones), start_s)
        robots_url, url = f"ws://127.0.0.1:{receiver.receiver.port}", f"http://127.0.0.1:{operator.port}"
        playing = asyncio.create_task(_play(errands, robots_url, start_s))
        following = asyncio.create_task(_follow(url, service, outcomes))
        try:
            while not outcomes.over() and time.time() < start_s + LONGEST_S:
                await asyncio.wait({playing, following}, timeout=0.5, return_when=asyncio.FIRST_EXCEPTION)
                for task in (playing, following):
                    if task.done():
                        task.result()
        finally:
            playing.cancel()
            following.cancel()
            await asyncio.gather(playing, following, return_exceptions=True)
    return outcomes.now()


async def _follow(url: str, service: SiteService | SituationService, outcomes: DrillOutcomes) -> None:
    async with Client(url) as client:
        async for revision in client.follow(after=0, kinds=("advisory", "situation")):
            outcomes.add_revision(revision, service.pass_on(revision))


async def _play(errands: ErrandGroup, url: str, start_s: float) -> None:
    """Advance the errands with the clock, and let each robot report in turn over its own connection."""
    senders = [Sender(errand.member.make.vendor) for errand in errands.errands]
    rng = np.random.default_rng(1)
    connections = [
        asyncio.create_task(call(url + (f"/{sender.vendor}" if sender.vendor in OWN_PATH else ""), sender, rng))
        for sender in senders
    ]
    try:
        step = 0
        while True:
            await asyncio.sleep(max(start_s + step * STEP_S - time.time(), 0.0))
            _report(errands, senders, step, start_s + step * STEP_S)
            errands.step(STEP_S)
            step += 1
    finally:
        for connection in connections:
            connection.cancel()
        await asyncio.gather(*connections, return_exceptions=True)


def _report(errands: ErrandGroup, senders: Sequence[Sender], step: int, now_s: float) -> None:
    for row, (errand, sender) in enumerate(zip(errands.errands, senders, strict=True)):
        every = round(errand.member.make.report_every_s / STEP_S)
        if sender.up and (step + 3 * row) % every == 0:
            introduce = row not in sender.introduced
            sender.introduced.add(row)
            sender.enqueue(DIALECTS[sender.vendor].messages(errand.robot(), now_s, introduce=introduce))


def _table(outcomes: Sequence[DrillOutcome]) -> Table:
    table = Table(title="Drills", expand=True)
    for column in ("drill", "raised ahead", "advice", "predicted cost", "cost", "ended"):
        table.add_column(column)
    for outcome in outcomes:
        lead = "-" if outcome.lead_s is None else f"{outcome.kind}, {outcome.lead_s:.0f} s"
        table.add_row(
            outcome.drill,
            lead,
            outcome.asked or "-",
            f"{outcome.promised_s:g} s",
            f"{outcome.late_s:g} s",
            outcome.ended or "no",
        )
    return table
