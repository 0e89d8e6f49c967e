"""Claims through fleet and engine: what people are told of them, and for how long."""

from dataclasses import dataclass, field

from deconflict.engine.engine import Engine
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from deconflict_client.advisory import ADVISORY, AdvisoryState, AnyAdvisory, ClaimAdvisory
from ingest.batch import Batch
from ingest.fleet.owners.ownership_claims import HELD_S, NAMED_ROBOTS
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, Vendor
from tests.helpers.saying import HALL, identity, robot, status

NOW_S = 1_790_000_000.0
SITE = Site(
    datums=(Datum(id=HALL, name="Hall"),),
    vendors=(Vendor(name="Alder", robots=tuple(robot(f"A-{i}") for i in range(40))), Vendor(name="Mallory")),
)
ALDER, MALLORY = Connection(1, vendor="Alder"), Connection(2, vendor="Mallory")


@dataclass
class Service:
    """A fleet and an engine that steps twice a second."""

    now_s: float = NOW_S
    engine: Engine = field(default_factory=lambda: Engine(SITE))

    def __post_init__(self) -> None:
        self.fleet = fleet_of(SITE, Measures())

    def said(self, raw: bytes, connection: Connection) -> str | None:
        return self.fleet.receive(raw, self.now_s, connection)

    def goes_on(self, for_s: float) -> list[ClaimAdvisory]:
        advisories: list[AnyAdvisory] = []
        until_s = self.now_s + for_s
        while self.now_s < until_s:
            self.now_s += 0.5
            self.engine.receive(Batch.from_bytes(self.fleet.next_batch(self.now_s).to_bytes()))
            advisories += self.engine.step(self.now_s)
        assert all(ADVISORY.validate_json(advisory.model_dump_json()) == advisory for advisory in advisories)
        return [advisory for advisory in advisories if isinstance(advisory, ClaimAdvisory)]


def test_a_foreign_claim_has_an_advisory_until_it_ends() -> None:
    service = Service()
    service.said(identity("A-1", NOW_S), ALDER)
    service.said(status("A-1", NOW_S, 3.0, 4.0), ALDER)
    assert service.goes_on(5) == []
    assert service.said(status("A-1", service.now_s, 90.0, 90.0), MALLORY) == "uuid-of-another-vendor"
    advisories = service.goes_on(HELD_S + 10)
    assert [advisory.state for advisory in advisories] == [AdvisoryState.RAISED, AdvisoryState.CLEARED]
    raised = advisories[0]
    assert (raised.kind, raised.owner, raised.claimant, raised.claimed) == ("foreign_claim", "Alder", "Mallory", 1)
    assert (raised.robots, raised.names, raised.vendors) == ((robot("A-1"),), ("Alder A-1",), ("Alder",))
    assert raised.location
    assert (raised.location.datum, raised.location.x, raised.location.y) == (HALL, 3.0, 4.0)
    assert "Mallory reports Alder A-1" in raised.summary


def test_a_claim_of_a_robot_that_was_never_seen_has_no_location() -> None:
    service = Service()
    assert service.said(identity("A-1", NOW_S), MALLORY) == "uuid-of-another-vendor"
    (raised,) = service.goes_on(5)
    assert (raised.location, raised.names) == (None, (f"Alder {robot('A-1')[:8]}",))


def test_a_claim_of_many_robots_is_one_advisory_with_few_revisions() -> None:
    service, advisories = Service(), []
    for i in range(60):
        service.said(status(f"A-{i % 40}", service.now_s), MALLORY)
        advisories += service.goes_on(1)
    assert len({advisory.id for advisory in advisories}) == 1
    assert len(advisories) <= NAMED_ROBOTS + 3
    assert (len(advisories[-1].robots), advisories[-1].claimed >= 20) == (NAMED_ROBOTS, True)
    service.engine.measures.as_document()
    assert len(service.engine.measures.values["deconflict_advisories_open"]) == 1


def test_a_robot_in_two_places_has_an_advisory_until_one_falls_silent() -> None:
    service, advisories = Service(), []
    other = Connection(3, vendor="Alder")
    for i in range(12):
        service.said(status("A-1", service.now_s, 0.0 + i / 2), ALDER)
        advisories += service.goes_on(0.5)
        service.said(status("A-1", service.now_s, 80.0), other)
        advisories += service.goes_on(0.5)
    assert [(advisory.kind, advisory.state.value, advisory.robots) for advisory in advisories] == [
        ("two_places", "raised", (robot("A-1"),))
    ]
    for i in range(int(HELD_S) + 10):
        service.said(status("A-1", service.now_s, 6.0 + i / 2), ALDER)
        advisories += service.goes_on(1)
    assert [advisory.state.value for advisory in advisories] == ["raised", "cleared"]


def test_a_restored_claim_keeps_its_id() -> None:
    service = Service()
    service.said(status("A-1", NOW_S), MALLORY)
    (before,) = service.goes_on(5)
    again = Service(service.now_s, Engine(SITE, [before]))
    again.said(status("A-1", again.now_s), MALLORY)
    advisories = again.goes_on(HELD_S + 20)
    assert [(advisory.id, advisory.state.value) for advisory in advisories] == [(before.id, "cleared")]
