"""Trains in the engine: what meets a trailer alone is warned of."""

import pytest

from deconflict_client.advisory import AdvisoryState
from ingest.settings import Model, Trailers, Vendor
from tests.deconflict.engine.made_engine import SITE, Floor, eastward, northward

TUG = Model(trailers=Trailers(count=4, length_m=1.2, width_m=0.8, hitch_m=1.6))


@pytest.mark.parametrize(("models", "raised"), [({}, 0), ({"A1": TUG}, 1)])
def test_a_robot_that_only_trailers_would_meet_is_warned(models: dict[str, Model], raised: int) -> None:
    """B comes to the way of A when A is 6.5 m beyond, and its last trailer is there."""
    courses = {"A": northward(y=-6.0), "B": eastward(x=-12.5)}
    site = SITE.model_copy(update={"vendors": (Vendor(name="Acme", models=models),)})
    floor = Floor(courses, site=site, makers={"A": "Acme", "B": "Other"})
    floor.run(10)
    assert [each.state for each in floor.advisories].count(AdvisoryState.RAISED) == raised
