"""What is not of one place: one engine for all floors tells what the engine of one machine tells."""

from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from deconflict.advisories.finding_lifecycle import FindingAdvisory
from deconflict.cluster.judging.global_judge import GlobalJudge
from deconflict.engine.engine import Engine
from deconflict_client.advisory import AdvisoryState, AnyAdvisory, ClaimAdvisory, ConflictAdvisory
from ingest.batch import Batch
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.ownership_claims import HELD_S
from ingest.port.connection import Connection
from tests.deconflict.cluster.judging.made_fleet import fleet
from tests.deconflict.contention.scenes import NOW_S, Script
from tests.deconflict.roles.made_queues import SITE, scripts
from tests.helpers.saying import identity, robot, status

TICKS = 4
"""A second."""


@dataclass
class Floor:
    """The robots of a script at one ingest, and shared by two."""

    robots: dict[str, Script]
    whole: Fleet = field(default_factory=fleet)
    parts: tuple[Fleet, Fleet] = field(default_factory=lambda: (fleet(), fleet()))

    def tick(self, tick: int) -> tuple[Batch, list[Batch]]:
        """What the one tells of this tick, and each of the two."""
        t, line = tick / TICKS, Connection(1)
        for number, (name, script) in enumerate(self.robots.items()):
            for receiving_fleet in (self.whole, self.parts[number % 2]):
                if tick == 0:
                    receiving_fleet.receive(identity(name, NOW_S, manufacturerName=script.vendor), NOW_S, line)
                if tick % TICKS == 0:
                    receiving_fleet.receive(script.says(name, t), NOW_S + t, line)
        return self.whole.next_batch(NOW_S + t), [part.next_batch(NOW_S + t) for part in self.parts]


def others(advisories: list[AnyAdvisory]) -> list[FindingAdvisory]:
    return [advisory for advisory in advisories if not isinstance(advisory, ConflictAdvisory)]


def test_the_judge_publishes_what_a_single_machine_does_whichever_ingest_a_robot_uses() -> None:
    floor, engine, judge = Floor(scripts()), Engine(SITE), GlobalJudge(SITE)
    counted: Counter[tuple[str, str]] = Counter()
    for tick in range(TICKS * 70):
        whole, shared = floor.tick(tick)
        engine.receive(whole)
        judge.receive([Batch.from_bytes(batch.to_bytes()) for batch in shared])
        advisories = others(engine.step(NOW_S + tick / TICKS))
        assert judge.advance(NOW_S + tick / TICKS) == advisories
        counted.update((advisory.kind, advisory.state.value) for advisory in advisories)
    assert {("deadlock", "raised"), ("contention", "raised"), ("deadlock", "cleared")} <= counted.keys()
    assert judge.measures.values["deconflict_advisories_total"] == counted


def test_a_new_judge_continues_open_advisories_and_adopts_the_decisions_of_others() -> None:
    floor, first, second = Floor(scripts()), GlobalJudge(SITE), GlobalJudge(SITE)
    advisories: list[FindingAdvisory] = []
    for tick in range(TICKS * 70):
        now_s = NOW_S + tick / TICKS
        _, shared = floor.tick(tick)
        if tick == TICKS * 8:
            assert {revision.kind for revision in first.open()} == {"deadlock", "contention"}
            second = GlobalJudge(SITE, first.open())
            second.receive([part.snapshot(now_s) for part in floor.parts])
        judge = first if tick < TICKS * 8 else second
        judge.receive(shared)
        fresh = judge.advance(now_s)
        for advisory in fresh:
            judge.adopt(advisory)
        advisories += fresh
    lives: dict[str, list[FindingAdvisory]] = {}
    for advisory in advisories:
        lives.setdefault(advisory.id, []).append(advisory)
    assert Counter(life[0].kind for life in lives.values()) == {"deadlock": 1, "contention": 1}
    for life in lives.values():
        assert [revision.revision for revision in life] == list(range(1, len(life) + 1))


def test_an_overruling_revision_replaces_its_own() -> None:
    floor, first, other = Floor(scripts()), GlobalJudge(SITE), GlobalJudge(SITE)
    mine: list[FindingAdvisory] = []
    theirs: list[FindingAdvisory] = []
    for tick in range(TICKS * 6):
        _, shared = floor.tick(tick)
        first.receive(shared)
        mine += first.advance(NOW_S + tick / TICKS)
        if tick > TICKS:
            other.receive(shared)
            theirs += other.advance(NOW_S + tick / TICKS)
    assert {each.kind for each in mine} == {each.kind for each in theirs}
    assert not {each.id for each in mine} & {each.id for each in theirs}
    for each in theirs:
        first.adopt(each, overruled=True)
    assert {each.id for each in first.open()} == {each.id for each in other.open()}


def test_the_judge_publishes_the_same_crowd_as_a_single_machine() -> None:
    robots = {f"M-{n}": Script([(0, 0.0, 0.0), (6, 0.0, 0.0), (7, 0.0, 5.0 * n)], vendor="Mallory") for n in range(20)}
    floor, engine, judge = Floor(robots), Engine(SITE), GlobalJudge(SITE)
    states = []
    for tick in range(TICKS * 20):
        whole, shared = floor.tick(tick)
        engine.receive(whole)
        judge.receive(shared)
        advisories = others(engine.step(NOW_S + tick / TICKS))
        assert judge.advance(NOW_S + tick / TICKS) == advisories
        states += [advisory.state.value for advisory in advisories if advisory.kind == "crowd"]
    assert (states[0], states[-1], len(states) <= 3) == ("raised", "cleared", True)


def claimed(at: dict[int, list[bytes]], seconds: float) -> list[ClaimAdvisory]:
    """What two ingests come to where every second each hears what it is given, as of its start."""
    judge, fleets, advisories = GlobalJudge(SITE), (fleet(), fleet()), []
    for tick in range(round(TICKS * seconds)):
        now_s = NOW_S + tick / TICKS
        for number, messages in at.items():
            for raw in messages if tick % TICKS == number else ():
                fleets[number].receive(raw, now_s, Connection(1))
        judge.receive([fleet.next_batch(now_s) for fleet in fleets])
        advisories += judge.advance(now_s)
    return [advisory for advisory in advisories if isinstance(advisory, ClaimAdvisory)]


def test_a_robot_that_two_vendors_report_at_different_ingests_is_a_claim() -> None:
    messages = {
        number: [identity("A", NOW_S, manufacturerName=vendor), status("A", NOW_S, 3.0, number)]
        for number, vendor in enumerate(("Alder", "Mallory"))
    }
    (raised,) = claimed(messages, 8)
    assert (raised.kind, raised.owner, raised.claimant) == ("foreign_claim", "Alder", "Mallory")
    assert raised.robots == (robot("A"),)
    assert raised.location
    assert (raised.location.x, raised.location.y) == (3.0, 0.0)


def test_a_robot_at_an_ingest_that_does_not_know_it_yet_is_no_claim() -> None:
    messages = {0: [identity("A", NOW_S), status("A", NOW_S, 3.0)], 1: [status("A", NOW_S, 3.0)]}
    assert claimed(messages, 8) == []


def test_a_robot_in_two_places_at_two_ingests_is_a_claim() -> None:
    messages = {number: [identity("A", NOW_S), status("A", NOW_S, 60.0 * number)] for number in range(2)}
    (raised,) = claimed(messages, 8)
    assert (raised.kind, raised.owner) == ("two_places", "Alder")


def test_a_claim_of_one_ingest_stands_as_long_as_at_the_ingest() -> None:
    ingest, judge, advisories = fleet(), GlobalJudge(SITE), []
    owner, other = Connection(1, vendor="Alder"), Connection(2, vendor="Mallory")
    ingest.receive(identity("A", NOW_S), NOW_S, owner)
    ingest.receive(status("A", NOW_S), NOW_S, owner)
    assert ingest.receive(status("A", NOW_S + 1), NOW_S + 1, other) == "uuid-of-another-vendor"
    for tick in range(TICKS * round(HELD_S + 10)):
        now_s = NOW_S + 1 + tick / TICKS
        judge.receive([ingest.next_batch(now_s)])
        advisories += judge.advance(now_s)
    assert [advisory.state for advisory in advisories] == [AdvisoryState.RAISED, AdvisoryState.CLEARED]
    assert 0 <= advisories[1].updated_at.timestamp() - NOW_S - 1 - HELD_S <= 8


def test_the_judge_leaves_out_robots_that_are_not_examined() -> None:
    judge, (whole, _) = GlobalJudge(SITE), Floor(scripts()).tick(0)
    examined = np.arange(len(whole)) > 0
    judge.receive([replace(whole, examined=examined)])
    assert judge._live.robots.keys() == set(whole.robots[1:])
