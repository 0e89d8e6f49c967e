"""Whose waiting counts more is asked to wait less, in holds and in slots, as the site file says."""

import pytest

from deconflict.advice.priorities import Priorities
from deconflict.engine.engine import Engine
from deconflict.settings.shared_places import Resource
from deconflict_client.advisory import ContentionAdvisory
from ingest.settings import Model, Vendor
from tests.deconflict.advice.made_near import until_advised
from tests.deconflict.contention.scenes import Scene, Script, raised, resource, site
from tests.deconflict.engine.made_engine import SITE, Floor, eastward, northward
from tests.helpers.saying import robot


@pytest.mark.parametrize(
    ("vendor", "yields"),
    [
        (Vendor(name="Alder", priority=3.0), "B"),
        (Vendor(name="Basalt", priority=3.0), "A"),
        (Vendor(name="Basalt", participant="person"), "A"),
        (Vendor(name="Basalt", participant="person", priority=0.5), "A"),
        (Vendor(name="Alder", models={"A1": Model(priority=3.0)}), "B"),
    ],
)
def test_of_two_that_cross_the_one_with_the_lower_priority_holds(vendor: Vendor, yields: str) -> None:
    """Both come at the same time; what is known of earlier burdens says otherwise. People on foot never yield."""
    floor = Floor(
        {"A": eastward(x=-12.0), "B": northward(y=-12.0)},
        site=SITE.model_copy(update={"vendors": (vendor,)}),
        makers={"B": "Basalt"},
    )
    against = {"A": {"Alder": 60.0}, "B": {"Basalt": 60.0}}
    floor.engine = Engine(floor.site, burdens_s=against[yields])
    advisory, _ = until_advised(floor)
    assert advisory.recommendation
    (hold,) = advisory.recommendation.holds
    assert hold.robot == robot(yields)


def charger() -> Resource:
    return resource("c1", 0, 0, kind="charger", service_s=60.0)


@pytest.mark.parametrize(("priority", "first"), [(1.0, "B"), (5.0, "C")])
def test_a_later_robot_goes_first_if_its_priority_is_higher(priority: float, first: str) -> None:
    """The charger is free when B comes; C comes five seconds later."""
    floor = site(charger(), vendors=(Vendor(name="Basalt", priority=priority),))
    robots = {
        "B": Script([(0, 30, 10)], [(40, 0, 0)], state=lambda _: "waitingExternalEvent"),
        "C": Script([(0, 30, 20)], [(45, 0, 0)], state=lambda _: "waitingExternalEvent", vendor="Basalt"),
    }
    (advisory,) = raised(Scene(floor, robots).run(4), "contention")
    assert isinstance(advisory, ContentionAdvisory)
    assert advisory.recommendation
    assert advisory.recommendation.slots[0].robot == robot(first)


def test_priority_is_the_models_then_the_vendors_then_the_usual_one() -> None:
    vendors = Priorities([Vendor(name="Alder", priority=2.0, models={"A1": Model(priority=4.0), "A2": Model()})])
    assert [vendors.of("Alder", model) for model in ("A1", "A2", "A3")] == [4.0, 2.0, 2.0]
    assert vendors.of("Basalt", "A1") == 1.0
