"""Attack the whole service beside honest robots: `python -m benchmarks.attack [ATTACK ...] [--seconds 30]`.

Fifty honest robots of two vendors cross each other's way at known times. The attacker is one vendor or one address, on
one core. A table has for each attack: how many meetings were told of two seconds ahead, and the latency of honest
messages, before, during and after it; the most memory of each role in terms of its usual, the disk, what health said,
restarts, how long after the attack everything was well again, and how long a restart on the data that is left takes.
`control` burns as much processor time and sends nothing. Everything stays on this machine.

The attacks with robots are `crowd` and `origin`; `large` (1,000 of `--size` metres that stand), `makers` (1,000 of 64
invented makers within 3 m) and `silent-crowd`, whose messages are made before they begin; and `maker-burst`, one burst
of 40,000 states of 3,000 makers at a broker (mosquitto). With `--turns N` attacks of one scene run so often in turns
with the scene without any, and for each limit a line says whether it held, during the attack and for a minute after it;
no run is started again on its data then.
"""

import argparse
import json
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path

from benchmarks.attack.attack_run import ATTACKS, BURST, NONE, Plan, run, scene_of
from benchmarks.attack.maker_burst import broker_is_installed
from benchmarks.attack.turns import Result, report

HEADINGS = (
    "attack", "told before", "during", "after", "p50 / p99 ms before", "during", "after", "memory, of usual",
    "disk MB", "health", "restarts", "well after s", "healthy on its data s",
)  # fmt: skip


AFTER_S, AFTER_TURNS_S = 30.0, 60.0
"""How long honest robots are measured after an attack, and in turns."""


def row(result: Result) -> str:
    """A row of the table."""
    phases = [result[phase] for phase in ("before", "during", "after")]
    memory = (f"{role} {used['most'] / used['usual']:.1f}" for role, used in sorted(result["memory_mb"].items()))
    cells = (
        result["attack"],
        *("{} of {}".format(*phase["told"]) for phase in phases),
        *("{p50_ms} / {p99_ms}".format(**phase) for phase in phases),
        ", ".join(memory),
        result["disk_mb"],
        ", ".join(f"{status} {looks}" for status, looks in sorted(result["health"].items())),
        sum(result["restarts"].values()),
        result["whole_after_s"],
        result["healthy_after_restart_s"],
    )
    return "| " + " | ".join(map(str, cells)) + " |"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("attacks", nargs="*", metavar="ATTACK", help=f"all, or some of: {', '.join(ATTACKS)}")
    arguments.add_argument("--robots", type=int, help="robots of an attack with robots")
    arguments.add_argument("--size", type=float, default=100.0, help="metres of large robots")
    arguments.add_argument("--seconds", type=float, default=30.0)
    arguments.add_argument("--pairs", type=int, default=25, help="pairs of honest robots")
    arguments.add_argument("--core", type=int, help="pin the attacker to this core")
    arguments.add_argument("--turns", type=int, help="so often with each attack, and as often without it")
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    if unknown := set(args.attacks) - set(ATTACKS):
        arguments.error(f"no attack is called {', '.join(sorted(unknown))}; expected some of {', '.join(ATTACKS)}")
    after_s = AFTER_TURNS_S if args.turns else AFTER_S
    plan = Plan(args.robots, args.size, args.pairs, seconds=args.seconds, after_s=after_s, core=args.core)
    attacks = [attack for attack in args.attacks or ATTACKS if attack != BURST or broker_is_installed()]
    if BURST in (args.attacks or ATTACKS) and BURST not in attacks:
        print(f"{BURST} is left out: install mosquitto, which is the broker that it needs")
    run_all = partial(_in_turns, turns=args.turns) if args.turns else _one_by_one
    results = []
    for result in run_all(attacks, plan):
        results.append(result)
        if args.json:
            args.json.write_text(json.dumps(results, indent=2) + "\n")


def _one_by_one(attacks: Sequence[str], plan: Plan) -> Iterator[Result]:
    """Run each attack once, and print a table."""
    print("| " + " | ".join(HEADINGS) + " |\n" + "| --- " * len(HEADINGS) + "|", flush=True)
    for attack in attacks:
        yield (result := _result(attack, plan))
        print(row(result), flush=True)


def _in_turns(attacks: Sequence[str], plan: Plan, turns: int) -> Iterator[Result]:
    """Run the attacks of each scene in turns with the scene alone, and print what held after each turn."""
    for scene, of_scene in groupby(sorted(attacks, key=scene_of), key=scene_of):
        results: dict[str, list[Result]] = {NONE: [], **{attack: [] for attack in of_scene}}
        for _ in range(turns):
            for attack, so_far in results.items():
                yield (result := _result(attack, plan, scene))
                so_far.append(result)
            without = results[NONE]
            lines = (line for attack in [*results][1:] for line in report(attack, without, results[attack]))
            print("\n".join(lines), flush=True)


def _result(attack: str, plan: Plan, scene: str = "") -> Result:
    data = Path(tempfile.mkdtemp(prefix="attack-"))
    try:
        return run(attack, plan, data, scene)
    finally:
        shutil.rmtree(data, ignore_errors=True)


if __name__ == "__main__":
    main()
