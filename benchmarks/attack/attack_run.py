"""One attack on a service of its own, and what honest robots get before, during and after it."""

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.attack import maker_burst
from benchmarks.attack.floods import FLOODS, Target, flooding
from benchmarks.attack.measuring import Samples, Subscriber, disk_mb, honest_latency, is_well
from benchmarks.attack.senders import sending
from benchmarks.attack.swarms import ROBOTS, SWARMS, swarming
from benchmarks.broker_offer import broker, sources
from benchmarks.endtoend import Running, service, since
from ingest.measures.measures import Histogram

NONE, BURST = "none", "maker-burst"
PLAIN, BROKER = "plain", "with a broker"
CROWDS = ("crowd", "origin")
ATTACKS = (NONE, *CROWDS, *FLOODS, *SWARMS, BURST)
MOST_ROBOTS = 220
"""Of a crowd, if it is not said."""
HEALTHY_WITHIN_S = 120.0
GOOD_P99_MS = 250
LOOK_S = 1.0


@dataclass(frozen=True, slots=True)
class Plan:
    """How long and with how many robots an attack runs."""

    robots: int | None = None
    """Of an attack with robots, if not its usual number."""
    size_m: float = 100.0
    """Of large robots."""
    pairs: int = 25
    """Of honest robots."""
    settle_s: float = 15.0
    """How long honest robots are heard before anything is measured."""
    around_s: float = 30.0
    """How long they are measured before the attack."""
    seconds: float = 30.0
    """How long the attack takes."""
    after_s: float = 30.0
    """How long they are measured after it."""
    core: int | None = None
    """To which the attacker is pinned."""


def run(attack: str, plan: Plan, data: Path, scene: str = "") -> dict[str, Any]:
    """One attack on a new service, and a restart on its data; in a `scene` without the restart."""
    with _scene(scene or scene_of(attack), data) as running:
        subscriber, samples, start_s = Subscriber(_stream(running), plan.pairs), Samples(running), time.time()
        with sending(running.url, "honest", 2 * plan.pairs, start_s):
            time.sleep(plan.settle_s)
            phases = {"before": _phase(running, plan.around_s)}
            usual = {role: used[-1] for role, used in samples.memory_mb.items()}
            with attacking(running, attack, plan, start_s):
                phases["during"] = _phase(running, plan.seconds)
            phases["after"], whole_after_s = _after(running, plan.after_s)
        subscriber.stop()
        samples.stop()
        for phase in phases.values():
            phase["told"] = subscriber.told(start_s, plan.pairs, *phase.pop("between_s"))
        restarts = {role.role: role.restarts for role in running.roles}
    return {
        "attack": attack,
        **phases,
        "whole_after_s": whole_after_s,
        "revisions": subscriber.revisions,
        "largest_revision_bytes": subscriber.largest_bytes,
        "memory_mb": {
            role: {"usual": usual.get(role, 0.0), "most": max(used)} for role, used in samples.memory_mb.items()
        },
        "disk_mb": max(samples.disk_mb, disk_mb(data)),
        "restarts": restarts,
        "health": dict(Counter(status for _, status in samples.health)),
        "canary_s": max((latency_s for _, latency_s in samples.canary_s), default=0.0),
        **({} if scene else {"healthy_after_restart_s": _restart_s(data)}),
    }


def scene_of(attack: str) -> str:
    """The scene of an attack: with a broker if it goes there."""
    return BROKER if attack == BURST else PLAIN


@contextmanager
def _scene(scene: str, data: Path) -> Iterator[Running]:
    """The service that is attacked, and a broker if that is in the scene."""
    changes = {"mqtt_sources": sources(["vda5050"])} if scene == BROKER else None
    with broker() if scene == BROKER else nullcontext(), service(data_directory=data, changes=changes) as running:
        yield running


def attacking(running: Running, attack: str, plan: Plan, start_s: float) -> AbstractContextManager[None]:
    """The attack, until the block ends. The honest robots began at `start_s`."""
    if attack == NONE:
        return nullcontext()
    if attack in FLOODS:
        return flooding(Target(running.url.removeprefix("ws://"), running.face), attack, plan.core)
    if attack in SWARMS:
        robots = SWARMS[attack](plan.robots or ROBOTS[attack], plan.size_m, plan.seconds)
        return swarming(running.url, robots, plan.seconds, plan.core)
    if attack == BURST:
        return maker_burst.bursting(plan.core)
    return sending(running.url, attack, plan.robots or MOST_ROBOTS, start_s, plan.core)


def _phase(running: Running, seconds: float) -> dict[str, Any]:
    """Let the service run; the latency of honest messages, and from when to when it was."""
    began_s, before = time.time(), honest_latency(running)
    time.sleep(seconds)
    return _latency(since(before, honest_latency(running))) | {"between_s": (began_s, time.time())}


def _latency(waits: Histogram) -> dict[str, Any]:
    return {"p50_ms": round(waits.quantile(0.5) * 1000), "p99_ms": round(waits.quantile(0.99) * 1000)}


def _after(running: Running, seconds: float) -> tuple[dict[str, Any], float | None]:
    """A phase, and seconds from its begin until health is ok and a second's latency good; None if that never comes."""
    began_s, whole_after_s, before = time.time(), None, honest_latency(running)
    latest = before
    while time.time() < began_s + seconds:
        time.sleep(LOOK_S)
        earlier, latest = latest, honest_latency(running)
        is_good = _latency(since(earlier, latest))["p99_ms"] <= GOOD_P99_MS and is_well(running.face)
        if is_good and whole_after_s is None:
            whole_after_s = round(time.time() - began_s, 1)
    return _latency(since(before, latest)) | {"between_s": (began_s, time.time())}, whole_after_s


def _restart_s(data: Path) -> float | None:
    """Seconds until a service on this data is healthy; None if it never is."""
    began_s = time.monotonic()
    with service(data_directory=data) as running:
        while time.monotonic() < began_s + HEALTHY_WITHIN_S:
            if is_well(running.face):
                return round(time.monotonic() - began_s, 1)
            time.sleep(0.1)
    return None


def _stream(running: Running) -> str:
    return f"ws://{running.face}/advisories/stream"
