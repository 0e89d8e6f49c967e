"""One floor driven to its end, and figures of many side by side."""

import json
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.closed_loop.halls.believed import Believed
from benchmarks.closed_loop.halls.ground.floors import hall_of
from benchmarks.closed_loop.halls.motion.vendors import ALL_FOLLOW, VENDORS, Compliance
from benchmarks.closed_loop.halls.scores import Figures
from benchmarks.closed_loop.halls.world import HallWorld
from deconflict.adviser import Adviser

NONE, ALONE, ONE_PLAN = "none", "alone", "one_plan"
ADVISERS = (NONE, "this", "believed")
_T95 = (np.nan, 12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26)
"""Of Student's distribution, by degrees of freedom."""


@dataclass(frozen=True)
class Run:
    """One floor. `adviser` is one of ADVISERS, or ALONE or ONE_PLAN for a reference without advice."""

    floor: str
    habit: str
    seed: int
    adviser: str = NONE
    compliance: Compliance = ALL_FOLLOW
    minutes: float = 7.0


def driven(run: Run) -> Figures:
    if run.adviser == ALONE:
        return _mean([_driven(run, only=vendor) for vendor in range(len(VENDORS))])
    return _driven(run)


def _driven(run: Run, only: int = -1) -> Figures:
    is_one = run.adviser == ONE_PLAN
    world = HallWorld(hall_of(run.floor, run.seed), run.seed, run.habit, run.compliance, only=only, one_plan=is_one)
    adviser = {"this": Adviser, "believed": Believed}.get(run.adviser, _Nobody)()
    while world.time_s < 60 * run.minutes:
        advise(world, adviser)
        for _ in range(10):
            world.step()
    return world.figures()


def advise(world: HallWorld, adviser: Any) -> None:
    """What happens once a second: reports and answers to the adviser, its requests to the robots."""
    for name, answer, why in world.answers():
        adviser.answer(name, answer, why)
    for request in adviser.hear(world.now_s, world.heard()):
        world.ask(request)


class _Nobody:
    def hear(self, now_s: float, messages: object) -> list[Any]:  # noqa: ARG002
        return []

    def answer(self, name: str, answer: str, why: str) -> None:
        pass


def _mean(figures: Sequence[Figures]) -> Figures:
    rows = [asdict(each) for each in figures]
    found: dict[str, Any] = {
        k: float(np.mean([row[k] for row in rows])) for k, v in rows[0].items() if not isinstance(v, dict)
    }
    for name in ("verbs", "answers"):
        counts: Counter[str] = Counter()
        for row in rows:
            counts.update(row[name])
        found[name] = dict(counts)
    vendors = {vendor for row in rows for vendor in row["mps_by_vendor"]}
    by_vendor = {v: [row["mps_by_vendor"][v] for row in rows if v in row["mps_by_vendor"]] for v in sorted(vendors)}
    return Figures(**found, mps_by_vendor={v: float(np.mean(values)) for v, values in by_vendor.items()})


def side_by_side(runs: Sequence[Run], jobs: int) -> dict[str, list[Figures]]:
    """By adviser: the figures of each seed, in order."""
    if jobs == 1:
        made = [driven(run) for run in runs]
    else:
        with ProcessPoolExecutor(jobs) as pool:
            made = list(pool.map(driven, runs))
    found: dict[str, list[Figures]] = {}
    for run, figures in zip(runs, made, strict=True):
        found.setdefault(run.adviser, []).append(figures)
    return found


def table(found: dict[str, list[Figures]]) -> str:
    """Means over seeds, with the paired difference in m/s to no advice and its 95 % interval."""
    head = "| adviser | m/s | to none | gap | errands/h | standoff s | encounters/robot-h | wall s | body s "
    head += "| rescues | requests/robot-h | by vendor |"
    lines = [head, "|" + " --- |" * (head.count("|") - 1)]
    none = np.array([each.mps for each in found.get(NONE, [])])
    one_mps = np.mean([each.mps for each in found[ONE_PLAN]]) if ONE_PLAN in found else np.nan
    for name, figures in found.items():
        mps, mean = np.array([each.mps for each in figures]), _mean(figures)
        gap = (mps.mean() - none.mean()) / (one_mps - none.mean()) if len(none) and name != NONE else np.nan
        difference = paired_difference(mps - none) if len(none) == len(mps) and name != NONE else ""
        vendors = ", ".join(f"{vendor} {value:.2f}" for vendor, value in mean.mps_by_vendor.items())
        share = "" if np.isnan(gap) else f"{gap:.0%}"
        lines.append(
            f"| {name} | {mean.mps:.3f} | {difference} | {share} | {mean.errands_per_hour:.0f} "
            f"| {mean.standoff_s:.0f} | {mean.encounters_per_robot_hour:.1f} | {mean.wall_s:.1f} | {mean.body_s:.1f} "
            f"| {mean.rescues:.1f} | {mean.requests_per_robot_hour:.1f} | {vendors} |"
        )
    for name, figures in found.items():
        if mean_answers := _mean(figures).answers:
            lines.append(
                f"{name}: verbs {json.dumps(_mean(figures).verbs)}; answers {json.dumps(mean_answers, sort_keys=True)}"
            )
    return "\n".join(lines)


def paired_difference(values: Any) -> str:
    """The mean of paired differences, with its 95 % interval if there are several."""
    if len(values) < 2:
        return f"{values.mean():+.3f}"
    half = _T95[min(len(values) - 1, len(_T95) - 1)] * values.std(ddof=1) / np.sqrt(len(values))
    return f"{values.mean():+.3f} ({values.mean() - half:+.3f} to {values.mean() + half:+.3f})"
