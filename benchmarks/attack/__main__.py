"""Attack the whole service beside honest robots: `python -m benchmarks.attack [ATTACK ...] [--seconds 30]`.

Fifty honest robots of two vendors cross each other's way at known times. The attacker is one vendor or one address, on
one core. A table has for each attack: how many meetings were told of two seconds ahead, and the latency of honest
messages, before, during and after it; the most memory of each role in terms of its usual, the disk, what health said,
restarts, how long after the attack everything was well again, and how long a restart on the data that is left takes.
`control` burns as much processor time and sends nothing. Everything stays on this machine.
"""

import argparse
import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.attack.attack_run import ATTACKS, Plan, run

HEADINGS = (
    "attack", "told before", "during", "after", "p50 / p99 ms before", "during", "after", "memory, of usual",
    "disk MB", "health", "restarts", "well after s", "healthy on its data s",
)  # fmt: skip


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
    arguments.add_argument("--robots", type=int, default=220, help="robots of a crowd")
    arguments.add_argument("--seconds", type=float, default=30.0)
    arguments.add_argument("--pairs", type=int, default=25, help="pairs of honest robots")
    arguments.add_argument("--core", type=int, help="pin the attacker to this core")
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    if unknown := set(args.attacks) - set(ATTACKS):
        arguments.error(f"no attack is called {', '.join(sorted(unknown))}; expected some of {', '.join(ATTACKS)}")
    print("| " + " | ".join(HEADINGS) + " |\n" + "| --- " * len(HEADINGS) + "|", flush=True)
    plan, results = Plan(args.robots, args.pairs, seconds=args.seconds, core=args.core), []
    for attack in args.attacks or ATTACKS:
        data = Path(tempfile.mkdtemp(prefix="attack-"))
        results.append(run(attack, plan, data))
        print(row(results[-1]), flush=True)
        shutil.rmtree(data, ignore_errors=True)
    if args.json:
        args.json.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
