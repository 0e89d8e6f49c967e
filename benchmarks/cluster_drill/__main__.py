"""Kill each thing of a cluster under traffic: `python -m benchmarks.cluster_drill [--phases quiet nats-gone]`.

Three machines, each with all parts and a NATS server, run on this one from the files of `deploy/cluster`, with TLS
everywhere. Pairs of robots cross each other's way by the clock, so each meeting is known. A subscriber at each face
notes when it is warned. A row of the table is one phase: a fault, its repair, and what follows. The exit code is 1 if a
bound is broken.
"""

import argparse
import asyncio
import json
import os
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.cluster_drill.cluster_view import ClusterView
from benchmarks.cluster_drill.crossing_pairs import GAP_S, CrossingPair, made_pairs
from benchmarks.cluster_drill.drill_phases import PHASES, DrillPhase
from benchmarks.cluster_drill.drill_scores import HEADINGS, PassedPhase, PhaseScore, differences, score
from benchmarks.cluster_drill.drilled_machines import MACHINES, TOKENS, DrilledMachines
from benchmarks.cluster_drill.reporting import Entrance, reporting
from benchmarks.cluster_drill.watched_face import WatchedFace

WHOLE_WITHIN_S, SETTLE_S = 180.0, 1.5 * GAP_S


async def drill(phases: Sequence[DrillPhase], pair_count: int, folder: Path) -> dict[str, Any]:
    """Run all phases. Returns the figures and the bounds that are broken."""
    machines = DrilledMachines(folder)
    pairs = made_pairs(pair_count, MACHINES)
    async with _started(machines) as view, _watched(machines) as faces:
        start_s = time.time()
        with reporting(pairs, _entrance(machines, start_s)):
            await asyncio.sleep(SETTLE_S)
            passed = [await _passed(phase, machines, view) for phase in phases]
            scores = [score(each, pairs, faces, start_s) for each in passed]
        return _result(scores, pairs, faces, await differences(faces))


@asynccontextmanager
async def _started(machines: DrilledMachines) -> AsyncIterator[ClusterView]:
    """All machines run until the block ends. They start one after another, so it is known whose engine is which."""
    os.environ.update(TOKENS)
    view = ClusterView(machines.site_file(MACHINES[0]), machines.nats_ca)
    try:
        machines.start_servers()
        async with asyncio.timeout(WHOLE_WITHIN_S):
            await view.open()
            for machine in MACHINES:
                machines.start_machine(machine)
                await view.wait_for_engine(machine)
        yield view
    finally:
        await view.close()
        machines.end()


@asynccontextmanager
async def _watched(machines: DrilledMachines) -> AsyncIterator[list[WatchedFace]]:
    """Subscribers of all faces until the block ends. Exits if a machine ends, or is never whole."""
    token, until_s = TOKENS["CONTROL_ROOM_TOKEN"], time.monotonic() + WHOLE_WITHIN_S
    faces = [WatchedFace(machines.face_address(machine), token, machines.ca) for machine in MACHINES]
    while not all([await face.is_whole() for face in faces]):
        if ended := machines.ended():
            raise SystemExit("\n".join(ended))
        if time.monotonic() > until_s:
            raise SystemExit("the machines do not start; run `deconflict prepare` first")
        await asyncio.sleep(0.5)
    tasks = [asyncio.create_task(face.run()) for face in faces]
    try:
        yield faces
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _entrance(machines: DrilledMachines, start_s: float) -> Entrance:
    tokens = {"Alder": TOKENS["ALDER_TOKEN"], "Corvid": TOKENS["CORVID_TOKEN"]}
    urls = {machine: machines.robots_address(machine) for machine in MACHINES}
    return Entrance(urls, machines.broker_port, tokens, machines.ca, start_s)


async def _passed(phase: DrillPhase, machines: DrilledMachines, view: ClusterView) -> PassedPhase:
    began_s = time.time()
    async with phase.fault(machines, view) as stopped:
        await asyncio.sleep(phase.held_s)
    mended_s = time.time()
    await asyncio.sleep(phase.after_s)
    print(f"{phase.name} is over", file=sys.stderr, flush=True)
    return PassedPhase(phase, stopped, began_s, mended_s, time.time(), round(os.getloadavg()[0], 1))


def _result(
    scores: Sequence[PhaseScore], pairs: Sequence[CrossingPair], faces: Sequence[WatchedFace], different: int
) -> dict[str, Any]:
    doubled = sum(len(face.doubled) for face in faces)
    broken = [text for each in scores for text in each.broken()]
    broken += [f"{doubled} revisions came twice with another content"] if doubled else []
    broken += [f"{different} advisories differ between the faces at the end"] if different else []
    print("| " + " | ".join(HEADINGS) + " |\n" + "| --- " * len(HEADINGS) + "|")
    for each in scores:
        print("| " + " | ".join(map(str, each.cells())) + " |")
    print(f"{doubled} revisions came twice, {different} advisories differ between the faces at the end")
    for text in broken:
        print(f"BROKEN {text}")
    return {
        "pairs": len(pairs),
        "phases": [asdict(each) for each in scores],
        "doubled_revisions": doubled,
        "differences": different,
        "lost_positions": [face.lost_positions for face in faces],
        "broken": broken,
    }


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--phases", nargs="+", choices=PHASES, default=list(PHASES), metavar="PHASE")
    arguments.add_argument("--pairs", type=int, default=12)
    arguments.add_argument("--keep", type=Path, help="directory for logs and data, which are removed otherwise")
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    with tempfile.TemporaryDirectory(prefix="cluster-drill-") as name:
        folder = args.keep or Path(name)
        folder.mkdir(parents=True, exist_ok=True)
        result = asyncio.run(drill([PHASES[phase] for phase in args.phases], args.pairs, folder))
    if args.json:
        args.json.write_text(json.dumps(result, indent=2) + "\n")
    return 1 if result["broken"] else 0


if __name__ == "__main__":
    sys.exit(main())
