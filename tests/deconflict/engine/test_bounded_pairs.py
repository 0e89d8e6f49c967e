"""Work in a pass is bounded whatever robots report: honest robots are warned as without the others, in as few pairs."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import pi

import numpy as np
import pytest

from deconflict.advisories.live_scene import MOST_VENDORS
from deconflict.engine.engine import Engine
from deconflict.foresight.probability.calibration import INTERACTION
from deconflict.foresight.probability.pair_table import has_robot_of
from deconflict.settings.fleet_factory import fleet_of
from deconflict.sweep.contact_intervals import PairConflicts
from deconflict_client.advisory import ConflictAdvisory
from ingest.batch import Pair
from ingest.measures.measures import OTHER, Measures
from ingest.port.connection import Connection
from ingest.settings import Vendor
from tests.deconflict.engine.made_engine import NOW_S, SITE, Course
from tests.helpers.saying import identity, points, robot, status

NAMED = SITE.model_copy(update={"vendors": (Vendor(name="Alder"),)})
HONEST_PAIRS, OTHERS, TICKS_A_S = 8, 150, 4
AT_ONE_ADDRESS, HONEST = Connection(1, "10.0.0.9"), Connection(2, "10.0.0.1")
MOST_BOXES = 3 * 9
"""Pairs of boxes for each robot that reported: three times what robots need at one on 25 m2."""


@dataclass
class Floor:
    """Honest robots that cross in pairs, and others that begin to report after `since_s`."""

    others: dict[str, tuple[str, Course, float]]
    """By name: maker, course and length."""
    since_s: float = 2.0
    silent_s: float = 1e9
    meet_s: float = 9.0
    """When the first two honest robots meet. The next ones do a second later, and so on."""
    restart_s: float = 1e9
    engine: Engine = field(default_factory=lambda: Engine(SITE))
    raised_s: dict[Pair, float] = field(default_factory=dict)
    boxes: list[float] = field(default_factory=list)
    """Of each pass, pairs of boxes for each robot that reported."""

    def run(self, until_s: float) -> None:
        fleet, found = fleet_of(SITE, Measures()), list[PairConflicts]()
        self.note_found(found)
        courses = {
            f"H-{n}{side}": ("Alder", crossing(n, side, self.meet_s), 0.0)
            for n in range(HONEST_PAIRS)
            for side in (0, 1)
        }
        for tick in range(round(until_s * TICKS_A_S)):
            t_s, reported = tick / TICKS_A_S, 0
            for number, (name, (maker, course, length_m)) in enumerate((courses | self.others).items()):
                is_honest = name in courses
                if (tick + number) % TICKS_A_S or not (is_honest or self.since_s <= t_s < self.silent_s):
                    continue
                reported += 1
                line, at_s = HONEST if is_honest else AT_ONE_ADDRESS, NOW_S + t_s
                size = {"baseRobotEnvelope": {"x": length_m, "y": length_m}} if length_m else {}
                fleet.receive(identity(name, at_s, manufacturerName=maker, **size), at_s, line)
                path = points(*((at_s + k, *course(t_s + k)) for k in range(1, 11)))
                fleet.receive(status(name, at_s, *course(t_s), path=path), at_s, line)
            if is_restart := t_s == self.restart_s:
                self.engine = Engine(SITE)
                self.note_found(found)
            self.engine.receive(fleet.next_batch(NOW_S + t_s, everything=is_restart))
            for revision in self.engine.step(NOW_S + t_s):
                if isinstance(revision, ConflictAdvisory):
                    self.raised_s.setdefault(revision.robots, t_s)
            self.boxes.append(found[-1].box_pairs / max(reported, 1))

    def note_found(self, found: list[PairConflicts]) -> None:
        """Add to `found` what each sweep of the engine finds."""
        sweep = self.engine._sweep.find_conflicts
        self.engine._sweep.find_conflicts = lambda *args: found.append(sweep(*args)) or found[-1]  # type: ignore[method-assign, func-returns-value]

    def honest_raised_s(self) -> dict[Pair, float]:
        pairs = [tuple(sorted((robot(f"H-{n}0"), robot(f"H-{n}1")))) for n in range(HONEST_PAIRS)]
        return {pair: self.raised_s[pair] for pair in pairs if pair in self.raised_s}


def crossing(n: int, side: int, meet_s: float) -> Course:
    """Two courses that cross once, `n` seconds after `meet_s`."""
    y, at_s = 12.0 * n, meet_s + n
    return (lambda t: (t - at_s, y, 0.0)) if side == 0 else (lambda t: (0.0, y + 0.3 + t - at_s, pi / 2))


def large(n: int) -> tuple[str, Course, float]:
    x, y = np.random.default_rng(n).uniform(-20, 100, 2).tolist()
    return "Mallory", lambda _: (x, y, 0.0), 100.0


def of_invented_makers(n: int) -> tuple[str, Course, float]:
    x, y = np.random.default_rng(n).uniform(-1.5, 1.5, 2).tolist()
    return f"Maker {n % 64}", lambda _: (x, y + 24.0, 0.0), 0.0


def on_one_spot(n: int) -> tuple[str, Course, float]:
    return "Mallory", lambda _: (0.0, 36.0, 0.0), 0.0


def fast(n: int) -> tuple[str, Course, float]:
    x, y, heading = np.random.default_rng(n).uniform((-50, -50, -pi), (50, 150, pi)).tolist()
    return "Mallory", lambda t: (x + 30 * np.cos(heading) * (t % 10), y + 30 * np.sin(heading) * (t % 10), heading), 0.0


def jumping(n: int) -> tuple[str, Course, float]:
    return "Mallory", lambda t: (*np.random.default_rng((n, int(4 * t))).uniform(-50, 150, 2).tolist(), 0.0), 0.0


KINDS: dict[str, tuple[Callable[[int], tuple[str, Course, float]], float, float]] = {
    "large": (large, 1e9, 3.0),
    "large, then silent": (large, 6.0, 3.0),
    "invented makers": (of_invented_makers, 1e9, 0.5),
    "invented makers, then silent": (of_invented_makers, 6.0, 0.5),
    "one spot": (on_one_spot, 1e9, 0.5),
    "one spot, then silent": (on_one_spot, 6.0, 0.5),
    "fast": (fast, 1e9, 0.5),
    "jumping": (jumping, 1e9, 3.0),
}
"""What they do, when they fall silent, and how much later honest pairs may be warned: robots in whose way others stand,
or seem to come, are rightly held for less likely to meet a third one."""


@pytest.fixture(scope="module")
def alone() -> Floor:
    floor = Floor({})
    floor.run(18.0)
    return floor


@pytest.mark.parametrize("kind", KINDS)
def test_honest_robots_are_warned_as_without_the_others_and_a_pass_examines_few_pairs(kind: str, alone: Floor) -> None:
    other, silent_s, late_s = KINDS[kind]
    floor = Floor({f"M-{n}": other(n) for n in range(OTHERS)}, silent_s=silent_s)
    floor.run(18.0)
    assert len(alone.honest_raised_s()) == HONEST_PAIRS
    late = {pair: at_s - alone.raised_s[pair] for pair, at_s in floor.honest_raised_s().items()}
    assert len(late) == HONEST_PAIRS
    assert max(late.values()) <= late_s
    assert all(at_s <= 9.0 + n - 2.0 for n, at_s in enumerate(floor.honest_raised_s().values()))
    busy = sorted(floor.boxes)[len(floor.boxes) // 10 : -len(floor.boxes) // 10]
    assert max(busy) <= MOST_BOXES + 40  # the spare boxes of a pass, for each of the few robots of one


FOLLOWERS = 12
"""Of each honest robot."""


def follower(n: int) -> tuple[str, Course, float]:
    """It reports from where an honest robot is, or a little beside."""
    honest, number = divmod(n, FOLLOWERS)
    course, beside_m = crossing(*divmod(honest, 2), MEET_AFTER_FOLLOWERS_S), 0.05 * (number - FOLLOWERS // 2)
    return "Alder", lambda t: (course(t)[0] + beside_m, course(t)[1] + beside_m, course(t)[2]), 0.0


MEET_AFTER_FOLLOWERS_S = 22.0


def test_robots_that_were_there_before_others_are_so_after_a_restart_of_the_engine() -> None:
    others = {f"H-F{n}": follower(n) for n in range(2 * HONEST_PAIRS * FOLLOWERS)}
    floor = Floor(others, since_s=11.0, meet_s=MEET_AFTER_FOLLOWERS_S, restart_s=14.0)
    floor.run(29.0)
    assert len(floor.honest_raised_s()) == HONEST_PAIRS
    for n, at_s in enumerate(floor.honest_raised_s().values()):
        assert at_s <= MEET_AFTER_FOLLOWERS_S + n - 2.0


def test_robots_that_are_compared_with_some_others_only_are_counted_and_listed() -> None:
    floor = Floor({f"M-{n}": on_one_spot(n) for n in range(20)})
    floor.run(6.0)
    listed = floor.engine.presence_document(NOW_S + 6.0)["partly_examined"]
    assert {robot(f"M-{n}") for n in range(20)} <= set(listed)
    floor.engine.measures.as_document()
    assert floor.engine.measures.values["deconflict_robots_partly_examined"]["Mallory",] == 20
    assert "Alder" not in {vendor for (vendor,) in floor.engine.measures.values["deconflict_robots_partly_examined"]}


def test_robots_that_are_not_examined_are_compared_with_nobody() -> None:
    engine, fleet = Engine(SITE), fleet_of(SITE, Measures())
    for t_s in np.arange(0.0, 6.0, 0.5).tolist():
        for name, x, vx in (("A", -6.0, 1.0), ("B", 6.0, -1.0)):
            at_s = NOW_S + t_s
            path = points(*((at_s + k, x + vx * (t_s + k), 0.0, 0.0) for k in range(1, 11)))
            fleet.receive(status(name, at_s, x + vx * t_s, 0.0, 0.0, path=path), at_s, Connection(1))
        batch = fleet.next_batch(NOW_S + t_s)
        engine.receive(replace(batch, examined=np.array([uuid == robot("A") for uuid in batch.robots])))
        assert engine.step(NOW_S + t_s) == []
    assert engine.live.robots.keys() == {robot("A")}


def test_vendors_that_a_source_may_have_invented_share_one_account() -> None:
    floor = Floor({f"M-{n}": of_invented_makers(n) for n in range(20)})
    floor.run(4.0)
    accounts = {floor.engine._scene.account(robot(f"M-{n}")) for n in range(20)}
    assert len(accounts) == MOST_VENDORS + 1
    assert OTHER in accounts
    assert floor.engine._scene.account(robot("H-00")) == "Alder"


def test_what_robots_of_vendors_that_the_site_does_not_name_do_counts_for_them_alone() -> None:
    """They cross each other's way far away from the honest ones, which nobody of the site does."""
    they_meet = {f"M-{n}{side}": ("Mallory", crossing(n + 40, side, -36.0), 0.0) for n in range(9) for side in (0, 1)}
    learned = []
    for others in ({}, they_meet):
        floor = Floor(others, engine=Engine(NAMED))
        floor.run(25.0)
        learned.append(floor.engine.foresight.learning)
    alone, beside = learned
    for name in ("calibration", "contact"):
        assert getattr(beside, name).of_all.weights.tolist() == getattr(alone, name).of_all.weights.tolist()
    assert len(beside.calibration.by_vendors) > len(alone.calibration.by_vendors)
    assert alone.calibration.of_all.weights.tolist() != INTERACTION.mean.tolist()


def test_nothing_is_learned_from_robots_that_report_what_cannot_be_true() -> None:
    floor = Floor({f"M-{n}": on_one_spot(n) for n in range(20)})
    floor.run(8.0)
    foresight = floor.engine.foresight
    crowded = foresight.robots.slots_of([robot(f"M-{n}") for n in range(20)])
    asked = foresight._candidates.worth_learning_from(foresight.pairs)
    assert has_robot_of(foresight.pairs["code"], crowded).any()
    assert not has_robot_of(asked["code"], crowded).any()
    assert len(asked) > 0
