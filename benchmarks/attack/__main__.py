"""Attack the whole service beside honest robots: `python -m benchmarks.attack [ATTACK ...] [--seconds 30]`.

Fifty honest robots of two vendors cross each other's way at known times. The attacker is one vendor or one address, on
one core. A table has for each attack: how many meetings were told of two seconds ahead, and the latency of honest
messages, before, during and after it; the most memory of each role in terms of its usual, the disk, what health said,
restarts, how long after the attack everything was well again, and how long a restart on the data that is left takes.
`control` burns as much processor time and sends nothing. Everything stays on this machine.

The attacks with robots are `crowd` and `origin`; `large` (1,000 of `--size` metres that stand), `makers` (1,000 of 64
invented makers within 3 m) and `silent-crowd`, whose messages are made before they begin; and `maker-burst`, one burst
of 40,000 states of 3,000 makers at a broker (mosquitto). With `--turns N` each attack runs so often in turns with the
same scene without it, and for each limit a line says whether it held, during the attack and for a minute after it.
"""

import argparse
import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.attack.attack_run import ATTACKS, BURST, NONE, Plan, run
from benchmarks.attack.maker_burst import broker_is_installed
from benchmarks.attack.turns import report

HEADINGS = (
    "attack", "told before", "during", "after", "p50 / p99 ms before", "during", "after", "memory, of usual",
    "disk MB", "health", "restarts", "well after s", "healthy on its data s",
)  # fmt: skip


AFTER_S, AFTER_TURNS_S = 30.0, 60.0
"""How long honest robots are measured after an attack, and in turns."""


def row(result: dict[str, Any]) -> str:
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
    results: list[dict[str, Any]] = []
    if not args.turns:
        print("| " + " | ".join(HEADINGS) + " |\n" + "| --- " * len(HEADINGS) + "|", flush=True)
    for attack in args.attacks or ATTACKS:
        if attack == BURST and not broker_is_installed():
            print(f"{attack} is left out: install mosquitto, which is the broker that it needs")
            continue
        results += _in_turns(attack, plan, args.turns) if args.turns else [_result(attack, plan)]
        if not args.turns:
            print(row(results[-1]), flush=True)
        if args.json:
            args.json.write_text(json.dumps(results, indent=2) + "\n")


def _in_turns(attack: str, plan: Plan, turns: int) -> list[dict[str, Any]]:
    """The results of runs without and with an attack, in turns."""
    results = [_result(each, plan, attack) for _ in range(turns) for each in (NONE, attack)]
    print("\n".join(report(attack, results[::2], results[1::2])), flush=True)
    return results


def _result(attack: str, plan: Plan, scene: str = "") -> dict[str, Any]:
    data = Path(tempfile.mkdtemp(prefix="attack-"))
    try:
        return run(attack, plan, data, scene)
    finally:
        shutil.rmtree(data, ignore_errors=True)


if __name__ == "__main__":
    main()
