"""Attack the whole service beside honest robots: `python -m benchmarks.attack crowd [--robots 220] [--seconds 30]`.

Fifty honest robots of two vendors cross each other's way at known times. The attacker is one vendor on one core. For
the time before, during and after the attack the benchmark prints how many meetings were told of two seconds ahead, and
the latency of honest messages; then memory by role, disk, restarts, health, and how long a restart on the data that is
left takes until the service is healthy.
"""

import argparse
import json
import shutil
import tempfile
import time
from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from benchmarks.attack.measuring import Samples, Subscriber, disk_mb, health, honest_latency
from benchmarks.attack.senders import sending
from benchmarks.endtoend import Running, service, since

SETTLE_S, AROUND_S = 15.0, 30.0
"""How long honest robots are heard before anything is measured, and how long they are measured before and after."""
ATTACKS = ("none", "crowd", "origin")
HEALTHY_WITHIN_S = 120.0


def run(attack: str, robots: int, seconds: float, pairs: int, core: int | None, data: Path) -> dict[str, Any]:
    """One attack on a new service, and a restart on its data."""
    with service(data_directory=data) as running:
        subscriber, samples, start_s = Subscriber(_stream(running), pairs), Samples(running), time.time()
        with sending(running.url, "honest", 2 * pairs, start_s):
            time.sleep(SETTLE_S)
            phases = {"before": _phase(running, AROUND_S)}
            with nullcontext() if attack == "none" else sending(running.url, attack, robots, start_s, core):
                phases["during"] = _phase(running, seconds)
            phases["after"] = _phase(running, AROUND_S)
        subscriber.stop()
        samples.stop()
        for phase in phases.values():
            phase["told"] = subscriber.told(start_s, pairs, *phase.pop("between_s"))
        restarts = {role.role: role.restarts for role in running.roles}
    return {
        "attack": attack,
        "robots": robots if attack != "none" else 0,
        **phases,
        "revisions": subscriber.revisions,
        "largest_revision_bytes": subscriber.largest_bytes,
        "memory_mb": {
            role: {"usual": used[len(used) // 8], "most": max(used)} for role, used in samples.memory_mb.items()
        },
        "disk_mb": max(samples.disk_mb, disk_mb(data)),
        "restarts": restarts,
        "health": dict(Counter(status for _, status in samples.health)),
        "healthy_after_restart_s": _restart_s(data),
    }


def _phase(running: Running, seconds: float) -> dict[str, Any]:
    """Let the service run; the latency of honest messages, and from when to when it was."""
    began_s, before = time.time(), honest_latency(running)
    time.sleep(seconds)
    waits = since(before, honest_latency(running))
    return {
        "p50_ms": round(waits.quantile(0.5) * 1000),
        "p99_ms": round(waits.quantile(0.99) * 1000),
        "between_s": (began_s, time.time()),
    }


def _restart_s(data: Path) -> float | None:
    """Seconds until a service on this data is healthy; None if it never is."""
    began_s = time.monotonic()
    with service(data_directory=data) as running:
        while time.monotonic() < began_s + HEALTHY_WITHIN_S:
            if health(running.face) == "ok":
                return round(time.monotonic() - began_s, 1)
            time.sleep(0.1)
    return None


def _stream(running: Running) -> str:
    return f"ws://{running.face}/advisories/stream"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("attacks", nargs="+", choices=ATTACKS)
    arguments.add_argument("--robots", type=int, default=220)
    arguments.add_argument("--seconds", type=float, default=30.0)
    arguments.add_argument("--pairs", type=int, default=25, help="pairs of honest robots")
    arguments.add_argument("--core", type=int, help="pin the attacker to this core")
    arguments.add_argument("--json", type=Path)
    args = arguments.parse_args()
    results = []
    for attack in args.attacks:
        data = Path(tempfile.mkdtemp(prefix="attack-"))
        results.append(run(attack, args.robots, args.seconds, args.pairs, args.core, data))
        print(json.dumps(results[-1], indent=2), flush=True)
        shutil.rmtree(data, ignore_errors=True)
    if args.json:
        args.json.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
