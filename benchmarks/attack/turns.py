"""An attack in turns with the same scene without it, and a verdict on each limit."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from statistics import median
from typing import Any

PHASES = ("during", "after")
"""The phases that count: an attack may do its harm once it has ended."""
MOST_FEWER, MOST_LATENCY, MOST_MEMORY = 1 / 50, 1.5, 2.0
"""The part of the meetings that may be missed besides those that are missed without the attack; the most p99 latency,
in terms of that without it; and the most memory of the engine, in terms of its usual."""

Result = dict[str, Any]
"""What `attack_run.run` gives."""


def report(attack: str, without: Sequence[Result], beside: Sequence[Result]) -> Iterator[str]:
    """Lines on as many runs without the attack as with it."""
    yield f"{attack}, {len(beside)} runs in turns with the same scene without it:"
    for phase in PHASES:
        yield (
            f"  {phase}: warned of 2 s ahead {_of(_warned(without, [phase]))} without, {_of(_warned(beside, [phase]))} "
            f"with; p99 {_p99s(without, phase)} ms without, {_p99s(beside, phase)} ms with"
        )
    memory = (_texts(map(_memory, results)) for results in (without, beside))
    yield "  engine's memory, in terms of its usual: {} without, {} with".format(*memory)
    yield f"  slowest canary, s: {_canaries(without)} without, {_canaries(beside)} with"
    yield f"  health: {_health(without)} without, {_health(beside)} with"
    yield f"  restarts: {_restarts(without)} without, {_restarts(beside)} with"
    yield from _verdicts(without, beside)


def _verdicts(without: Sequence[Result], beside: Sequence[Result]) -> Iterator[str]:
    missed = [1 - warned / max(meetings, 1) for warned, meetings in (_warned(without), _warned(beside))]
    yield (
        f"  {_held(missed[1] <= missed[0] + MOST_FEWER)}: missed meetings {missed[1]:.1%}, without the attack "
        f"{missed[0]:.1%}, at most 1 in 50 more"
    )
    for phase in PHASES:
        usual_ms, p99_ms = (median(result[phase]["p99_ms"] for result in results) for results in (without, beside))
        yield (
            f"  {_held(p99_ms <= MOST_LATENCY * usual_ms)}: p99 {phase} {p99_ms:g} ms, without the attack "
            f"{usual_ms:g} ms, at most {MOST_LATENCY:g} times"
        )
    most = max(map(_memory, beside))
    yield f"  {_held(most < MOST_MEMORY)}: the engine's memory is {most:.2f} times its usual, below {MOST_MEMORY:g}"


def _held(holds: bool) -> str:
    return "HELD" if holds else "BROKEN"


def _warned(results: Sequence[Result], phases: Sequence[str] = PHASES) -> tuple[int, int]:
    """Meetings that were warned of, and all."""
    counts = [result[phase]["told"] for result in results for phase in phases]
    return sum(warned for warned, _ in counts), sum(meetings for _, meetings in counts)


def _of(counts: tuple[int, int]) -> str:
    return "{} of {}".format(*counts)


def _p99s(results: Sequence[Result], phase: str) -> str:
    return ", ".join(str(result[phase]["p99_ms"]) for result in results)


def _memory(result: Result) -> float:
    used = result["memory_mb"]["engine"]
    return float(used["most"] / used["usual"])


def _canaries(results: Sequence[Result]) -> str:
    return _texts(result["canary_s"] for result in results)


def _texts(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.2f}" for value in values)


def _health(results: Sequence[Result]) -> str:
    looks: Counter[str] = Counter()
    for result in results:
        looks.update(result["health"])
    return ", ".join(f"{status} {number}" for status, number in sorted(looks.items()))


def _restarts(results: Sequence[Result]) -> int:
    return sum(sum(result["restarts"].values()) for result in results)
