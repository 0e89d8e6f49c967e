"""Kill each thing of a cluster under traffic: `python -m benchmarks.cluster_drill [--phases quiet nats-gone]`.

Three machines, each with all parts and a NATS server, run on this one from the files of `deploy/cluster`, with TLS
everywhere. Pairs of robots cross each other's way by the clock, so each meeting is known. A subscriber at each face
notes when it is warned. A row of the table is one phase: a fault, its repair, and what follows. The exit code is 1 if a
bound is broken.
"""

import argparse
import asyncio
import json
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.cluster_drill.crossing_pairs import GAP_S, CrossingPair, Entrance, crossing, made_pairs
from benchmarks.cluster_drill.drill_phases import PHASES, DrillPhase
from benchmarks.cluster_drill.drill_scores import HEADINGS, PhaseScore, cells, differences, score
from benchmarks.cluster_drill.drilled_machines import MACHINES, TOKENS, DrilledMachines
from benchmarks.cluster_drill.watched_face import WatchedFace

WHOLE_WITHIN_S, SETTLE_S = 180.0, 1.5 * GAP_S
Times = tuple[float, float, float]
"""When a phase began, was repaired, and ended."""


async def drill(phases: list[DrillPhase], pair_count: int, folder: Path) -> dict[str, Any]:
    """Run all phases. Returns the figures and the bounds that are broken."""
    machines = DrilledMachines(folder)
    tasks: list[asyncio.Task[None]] = []
    try:
        machines.start_all()
        faces = [
            WatchedFace(machines.face_address(m), TOKENS["CONTROL_ROOM_TOKEN"], str(machines.ca)) for m in MACHINES
        ]
        await _whole(machines, faces)
        tasks = [asyncio.create_task(face.run()) for face in faces]
        pairs, start_s = made_pairs(pair_count, MACHINES), time.time()
        with crossing(pairs, _entrance(machines, start_s)):
            await asyncio.sleep(SETTLE_S)
            times = [await _passed(phase, machines) for phase in phases]
            scores = [score(phase, pairs, faces, start_s, *at) for phase, at in zip(phases, times, strict=True)]
        different = await differences(faces)
        return _result(scores, pairs, faces, different)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        machines.end()


def _entrance(machines: DrilledMachines, start_s: float) -> Entrance:
    tokens = {"Alder": TOKENS["ALDER_TOKEN"], "Corvid": TOKENS["CORVID_TOKEN"]}
    urls = {machine: machines.robots_address(machine) for machine in MACHINES}
    return Entrance(urls, tokens, machines.ca, start_s)


async def _whole(machines: DrilledMachines, faces: list[WatchedFace]) -> None:
    """Wait until every machine is up. Exits if one of them ends, or never is."""
    until_s = time.monotonic() + WHOLE_WITHIN_S
    while not all([await face.is_whole() for face in faces]):
        if ended := machines.ended():
            raise SystemExit("\n".join(ended))
        if time.monotonic() > until_s:
            raise SystemExit("the machines do not start; run `deconflict prepare` first")
        await asyncio.sleep(0.5)


async def _passed(phase: DrillPhase, machines: DrilledMachines) -> Times:
    began_s = time.time()
    phase.break_it(machines)
    await asyncio.sleep(phase.held_s)
    phase.mend_it(machines)
    repaired_s = time.time()
    await asyncio.sleep(phase.after_s)
    print(f"{phase.name} is over", file=sys.stderr, flush=True)
    return began_s, repaired_s, time.time()


def _result(
    scores: list[PhaseScore], pairs: list[CrossingPair], faces: list[WatchedFace], different: int
) -> dict[str, Any]:
    doubled = sum(len(face.doubled) for face in faces)
    broken = [f"{each.phase}: {text}" for each in scores for text in each.broken]
    broken += [f"{doubled} revisions came twice with another content"] if doubled else []
    broken += [f"{different} advisories differ between the faces at the end"] if different else []
    return {
        "pairs": len(pairs),
        "phases": [asdict(each) for each in scores],
        "doubled_revisions": doubled,
        "differences": different,
        "lost_positions": [face.lost_positions for face in faces],
        "broken": broken,
    }


def _print(result: dict[str, Any]) -> None:
    print("| " + " | ".join(HEADINGS) + " |\n" + "| --- " * len(HEADINGS) + "|")
    for phase in result["phases"]:
        print("| " + " | ".join(map(str, cells(PhaseScore(**phase)))) + " |")
    print(
        f"revisions doubled: {result['doubled_revisions']}; "
        f"advisories that differ between faces: {result['differences']}; "
        f"positions lost at each face: {result['lost_positions']}"
    )
    for text in result["broken"]:
        print(f"BROKEN {text}")


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
    _print(result)
    if args.json:
        args.json.write_text(json.dumps(result, indent=2) + "\n")
    return 1 if result["broken"] else 0


if __name__ == "__main__":
    sys.exit(main())
