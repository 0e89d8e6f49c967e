"""Drives robots through the fleet and the engine of the service, in simulated time."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from time import process_time
from typing import Any, NamedTuple

import numpy as np

from benchmarks.drawn_floors.floor import HONEST
from benchmarks.drawn_floors.motion import DOCK_M, HALL, LANE_M, START_S, Robot, Sent
from deconflict.advice.deferred_answers import Answer, PendingAnswer
from deconflict.engine.engine import Engine
from deconflict.runtime.learned_state import Part
from deconflict.settings.fleet_factory import fast_fleet_of
from deconflict.settings.shared_places import Polygon, Resource, Zone
from deconflict.settings.site import DEFAULT, Site
from deconflict.sweep.broadphase import Pairs
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict.sweep.incremental import Sweeper
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ConflictAdvisory, Severity
from ingest.batch import Batch, Floats, Pair
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, Vendor
from metrics.scoring.warnings.warning_judge import WarningJudge
from metrics.truth import encounters
from metrics.truth.encounters import STRETCH
from metrics.truth.recorded_motion import SampledMotion
from metrics.truth.separations import Separations

DOCK: Polygon = tuple((DOCK_M[0] + x_m, DOCK_M[1] + y_m) for x_m, y_m in ((-2, -2), (2, -2), (2, 2), (-2, 2)))
LANE: Polygon = tuple(
    (x_m, y_m + side_m) for side_m, ends_m in ((-1, LANE_M), (1, LANE_M[::-1])) for x_m, y_m in ends_m
)
SITE = DEFAULT.model_copy(
    update={
        "datums": (Datum(id=HALL, name="Hall"),),
        "vendors": tuple(Vendor(name=maker) for maker in HONEST),
        "resources": (Resource(kind="dock", id="dock", datum=HALL, polygon=DOCK),),
        "zones": (Zone(kind="aisle", id="lane", datum=HALL, polygon=LANE, axis=LANE_M),),
    }
)
LONGEST_PASS_S, LONGEST_DRIVE_S = 5.0, 120.0
"""A drive is given up after a pass, or passes in all, that take so much processor time."""
SEVERITIES = tuple(Severity)


class Work(NamedTuple):
    """What one pass cost and did."""

    pass_s: float
    """Processor time."""
    swept_pairs: int
    """Pairs of robots of which the sweep examined boxes."""
    box_pairs: int
    """Of one second each: ten of two robots that stand beside each other."""
    segment_pairs: int
    advanced_pairs: int
    fcl_calls: int
    foreseen_pairs: int
    """Pairs whose probability is computed: not those that are only remembered."""
    open_conflicts: int
    judged_pairs: int
    """Pairs that were near at a moment, by the newest look of the judge: it looks at many moments together."""

    @property
    def pairs(self) -> int:
        """Examined pairs of robots: of the sweep, of the probabilities, and of the judge."""
        return self.swept_pairs + self.foreseen_pairs + self.judged_pairs


@dataclass(slots=True)
class Warned:
    """One conflict advisory from its first revision on. Times are seconds since the start of the floor."""

    raised_s: float
    severity: Severity
    """The highest so far."""
    cleared_s: float = np.inf
    at_m: tuple[float, float] = (np.nan, np.nan)
    """Where the newest revision says that they meet."""


@dataclass(slots=True)
class Drive:
    """What a drive gave."""

    work: list[Work] = field(default_factory=list)
    warnings: dict[Pair, list[Warned]] = field(default_factory=dict)
    failed: str = ""
    """Why it was given up."""
    learned: dict[str, Part] = field(default_factory=dict)
    """What the engine had learned in the end."""
    not_examined: int = 0
    """Robots that the newest batches marked as not examined."""

    def column(self, name: str) -> Floats:
        return np.array([getattr(each, name) for each in self.work], np.float64)


def drive(
    robots: Sequence[Robot],
    sent: Sequence[Sent],
    seconds: float,
    passes_a_second: int = 5,
    learned: Mapping[str, Part] | None = None,
    site: Site = SITE,
) -> Drive:
    """Feed messages as they arrive, and make a pass at every tick, with all that the engine's process does in one.
    `learned` is what the engine knows before."""
    found, sweeps, examined, near = Drive(), list[PairConflicts](), list[Pairs](), [0]
    fleet, engine = fast_fleet_of(site, Measures()), Engine(site, submit=_without_advice, learned=learned)
    judge = WarningJudge(site.conflict.clearance_m, site.conflict.clear_margin_m, Measures())
    connections = [_connection(number, robot) for number, robot in enumerate(robots)]
    message, ticks_s = 0, np.arange(int(seconds * passes_a_second) + 1) / passes_a_second
    unexamined: dict[str, bool] = {}
    with _swept(sweeps), _examined(examined), _judged(near):
        for _, now_s in pairwise(ticks_s.tolist()):
            while message < len(sent) and sent[message].at_s <= now_s:
                at_s, robot, raw = sent[message]
                fleet.receive(raw, START_S + at_s, connections[robot])
                message += 1
            batch = _next_batch(fleet, START_S + now_s)
            if (marks := getattr(batch, "examined", None)) is not None:
                unexamined |= dict(zip(batch.robots, (~marks).tolist(), strict=True))
            began_s = process_time()
            bands_m = engine.foresight.ledger.bands_of(batch)
            engine.receive(batch)
            revisions = engine.step(START_S + now_s)
            engine.advise(START_S + now_s)
            waiting = engine.foresight.following_advice(START_S + now_s)
            judge.add(START_S + now_s, batch, bands_m, revisions, waiting, engine.claims.partly_examined())
            pass_s = process_time() - began_s
            _note(found.warnings, revisions, now_s)
            swept = sweeps.pop()
            work = swept.box_pairs, swept.segment_pairs, swept.advanced_pairs, swept.fcl_calls
            tables = int(engine.foresight.pairs["watched"].sum()), len(engine.conflicts())
            found.work.append(Work(pass_s, _number_of_pairs(examined), *work, *tables, near[-1] // STRETCH))
            found.failed = _failure(found, now_s)
            if found.failed:
                break
    found.learned = engine.learned()
    found.not_examined = sum(unexamined.values())
    return found


def _failure(found: Drive, now_s: float) -> str:
    if found.work[-1].pass_s > LONGEST_PASS_S:
        return f"a pass at second {now_s:.1f} took {found.work[-1].pass_s:.1f} s"
    spent_s = sum(each.pass_s for each in found.work)
    return f"passes up to second {now_s:.1f} took {spent_s:.0f} s" if spent_s > LONGEST_DRIVE_S else ""


def _next_batch(fleet: Fleet, now_s: float) -> Batch:
    return Batch.from_bytes(fleet.next_batch(now_s).to_bytes())


def _connection(number: int, robot: Robot) -> Connection:
    """Honest robots name their vendor in the path. Others name a maker in their messages only."""
    if robot.is_honest:
        return Connection(number + 1, robot.source, f"/{robot.maker}", robot.maker)
    return Connection(number + 1, robot.source)


def _note(warnings: dict[Pair, list[Warned]], revisions: Sequence[AnyAdvisory], now_s: float) -> None:
    for revision in revisions:
        if not isinstance(revision, ConflictAdvisory):
            continue
        of_pair = warnings.setdefault(revision.robots, [])
        if revision.state is AdvisoryState.RAISED or not of_pair:
            of_pair.append(Warned(now_s, revision.severity))
        newest = of_pair[-1]
        newest.severity = max(newest.severity, revision.severity, key=SEVERITIES.index)
        newest.at_m = revision.location.x, revision.location.y
        if revision.state is AdvisoryState.CLEARED:
            newest.cleared_s = now_s


@contextmanager
def _swept(sweeps: list[PairConflicts]) -> Iterator[None]:
    """Keep what every sweep finds, with the work that it counts."""
    find_conflicts = Sweeper.find_conflicts

    def kept(self: Sweeper, *args: Any, **named: Any) -> PairConflicts:
        sweeps.append(find_conflicts(self, *args, **named))
        return sweeps[-1]

    setattr(Sweeper, "find_conflicts", kept)  # noqa: B010 - mypy does not let a method be assigned
    try:
        yield
    finally:
        setattr(Sweeper, "find_conflicts", find_conflicts)  # noqa: B010


@contextmanager
def _examined(examined: list[Pairs]) -> Iterator[None]:
    """Keep the pairs of boxes that every sweep examines."""
    contacts = getattr(Sweeper, "_contacts")  # noqa: B009

    def kept(self: Sweeper, pairs: Pairs, *args: Any) -> Any:
        examined.append(pairs.copy())
        return contacts(self, pairs, *args)

    setattr(Sweeper, "_contacts", kept)  # noqa: B010
    try:
        yield
    finally:
        setattr(Sweeper, "_contacts", contacts)  # noqa: B010


def _number_of_pairs(examined: list[Pairs]) -> int:
    """How many pairs of robots these pairs of boxes are of. They are forgotten."""
    codes = np.concatenate([pairs["a"].astype(np.int64) << 32 | pairs["b"] for pairs in examined])
    examined.clear()
    return len(np.unique(codes))


@contextmanager
def _judged(near: list[int]) -> Iterator[None]:
    """Keep how many near pairs the judge looks at."""
    separations = getattr(encounters, "separations")  # noqa: B009

    def counted(sampled: SampledMotion, within_m: float, most: float) -> Separations:
        near.append(int(most))
        found: Separations = separations(sampled, within_m, most)
        near[-1] = len(found.a)
        return found

    setattr(encounters, "separations", counted)  # noqa: B010
    try:
        yield
    finally:
        setattr(encounters, "separations", separations)  # noqa: B010


class _Unanswered:
    """An answer that does not come."""

    def done(self) -> bool:
        return False

    def result(self) -> Answer:
        raise NotImplementedError


def _without_advice(_: Callable[[], Answer]) -> PendingAnswer:
    """Works out no advice: in the service a thread of its own does, and no pass waits for it."""
    return _Unanswered()
