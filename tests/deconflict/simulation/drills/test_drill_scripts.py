"""Each drill through fleet and engine, its robots doing as they are advised or not: what is told, and what it is worth.

`tests/deconflict/simulation/drills/test_drill_run.py` plays the same through the whole service.
"""

from functools import cache

import pytest

from deconflict.advisories.situations.situation_lifecycle import SituationLifecycle
from deconflict.advisories.words.place_names import PlaceNames
from deconflict.contention.robots.place_geometry import PlaceGeometry
from deconflict.engine.engine import Engine
from deconflict.settings.fleet_factory import fleet_of
from deconflict.simulation.drills.drill_outcomes import DrillOutcome, DrillOutcomes
from deconflict.simulation.drills.drill_scripts import DRILLS, set_up_drills
from deconflict.simulation.drills.errands import STEP_S, ErrandGroup
from deconflict.simulation.drills.site_service import SERVICES, AdviceSource
from deconflict.simulation.vendors.dialects import DIALECTS
from ingest.measures.measures import Measures
from ingest.port.connection import Connection

NOW_S = 1_790_000_000.0
SECONDS = 60
SITUATIONS: AdviceSource = "situations"
HEEDED = [drill.name for drill in DRILLS if drill.heeds]


@cache
def played(*, ignored: bool, source: AdviceSource = "advisories") -> dict[str, DrillOutcome]:
    """What comes of all drills at once, by name."""
    site, setups = set_up_drills(ignored=ignored)
    everybody = ErrandGroup([errand for setup in setups for errand in setup.errands])
    outcomes = DrillOutcomes(DRILLS, setups)
    fleet, engine = fleet_of(site, Measures()), Engine(site)
    service = SERVICES[source](everybody, PlaceGeometry(site.resources, site.zones), NOW_S)
    situations = SituationLifecycle(PlaceNames.of(site).describe)
    lines = [Connection(row, vendor=driven.member.make.vendor.value) for row, driven in enumerate(everybody.errands)]
    for step in range(round(SECONDS / STEP_S)):
        now_s = NOW_S + step * STEP_S
        for row, errand in enumerate(everybody.errands):
            every = round(errand.member.make.report_every_s / STEP_S)
            if (step + 3 * row) % every == 0:
                for message in DIALECTS[errand.member.make.vendor].messages(
                    errand.robot(), now_s, introduce=step < every
                ):
                    assert fleet.receive(message, now_s, lines[row]) is None
        engine.receive(fleet.next_batch(now_s))
        for revision in situations.published(now_s, engine.step(now_s)):
            outcomes.add_revision(revision, service.pass_on(revision))
        everybody.step(STEP_S)
    return {outcome.drill: outcome for outcome in outcomes.now()}


@pytest.mark.parametrize("name", HEEDED)
def test_following_the_advice_ends_it_at_the_promised_cost(name: str) -> None:
    outcome = played(ignored=False)[name]
    assert outcome.lead_s
    assert outcome.lead_s > 5
    assert outcome.kept, outcome
    assert outcome.worst != "critical"
    assert "double_occupancy" not in outcome.kinds
    assert "blockage" not in outcome.kinds


@pytest.mark.parametrize("name", [drill.name for drill in DRILLS if drill.kind != "conflict"])
def test_advisories_and_advice_are_the_same_if_robots_ignore_them(name: str) -> None:
    heard, ignored = (played(ignored=each)[name] for each in (False, True))
    assert heard.told == ignored.told
    assert heard.lead_s == ignored.lead_s
    assert heard.advised
    assert heard.advised == ignored.advised


@pytest.mark.parametrize("name", ["aisle head-on", "swap", "ring of three"])
def test_a_ring_that_no_robot_breaks_is_a_deadlock(name: str) -> None:
    outcome = played(ignored=True)[name]
    assert not outcome.through
    assert outcome.ended == ""
    assert outcome.worst == "critical"


def test_a_robot_that_ignores_advice_enters_an_occupied_dock() -> None:
    assert "double_occupancy" in played(ignored=True)["dock taken"].kinds


@pytest.mark.parametrize("name", ["lift with a twin standing free", "charger queue"])
def test_ignored_advice_costs_what_it_would_have_saved(name: str) -> None:
    heard, ignored = (played(ignored=each)[name] for each in (False, True))
    assert ignored.late_s > heard.late_s + 3


def test_the_conflict_of_robots_that_ignore_advice_stays_open_until_they_have_passed() -> None:
    outcome = played(ignored=False)["robots that ignore advice"]
    assert "should wait" in outcome.advised
    assert outcome.passed_on == []
    assert outcome.worst == "critical"
    assert outcome.ended == "they have passed each other"


LEAST_SHARE = 0.9
"""Of what following every advisory saves, following situations only saves at least this."""


def test_following_only_situations_saves_nine_tenths() -> None:
    """A dock that is taken is left out: waiting before it saves no time, and situations do not advise it."""
    ignored, advisories, situations = (
        played(ignored=True),
        played(ignored=False),
        played(ignored=False, source=SITUATIONS),
    )
    saved_s = [
        sum(ignored[name].late_s - followed[name].late_s for name in HEEDED if name != "dock taken")
        for followed in (advisories, situations)
    ]
    assert saved_s[1] >= LEAST_SHARE * saved_s[0] > 100.0


@pytest.mark.parametrize("name", HEEDED)
def test_following_only_situations_resolves_it(name: str) -> None:
    outcome = played(ignored=False, source=SITUATIONS)[name]
    assert outcome.resolved, outcome
    assert outcome.passed_on or outcome.kind == "conflict" or name == "dock taken"
