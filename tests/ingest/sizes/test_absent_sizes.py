"""A robot whose size can't be read has all else that its identity says."""

import json
from typing import Any

import pytest

from ingest.fleet.fleet import Fleet
from ingest.fleet.robot import Robot
from ingest.settings import Model, Vendor
from tests.helpers import iso_saying, vda_saying
from tests.helpers.saying import identity, robot, status
from tests.ingest.fleet.made_fleet import LINE, NOW_S, counted, fleet

SIZES: dict[str, tuple[Any, ...]] = {
    "massrobotics": (None, "wide", {"x": 0, "y": 1}, {"x": 1.0}, {"x": float("nan"), "y": 1.0}, [], 7),
    "vda5050": (None, "wide", {"length": 0.0, "width": 1.0}, {"length": 1.0}, {"length": "?", "width": 1}, [], 7),
    "iso21423": (None, [], "wide", [{"x": 1.0, "y": 0.0}], [{"x": 1.0, "y": 0.0}] * 4, 7),
}


def tell(of: Fleet, language: str, size: Any, t_s: float) -> Robot:
    """Tell who a robot is and where."""
    if language == "massrobotics":
        report = json.loads(identity("A-1", t_s, manufacturerName="KIT", robotModel="Carrier"))
        assert of.receive(json.dumps(report | {"baseRobotEnvelope": size}).encode(), t_s, LINE) is None
        assert of.receive(status("A-1", t_s), t_s, LINE) is None
        return of.robots[robot("A-1")]
    if language == "vda5050":
        report = json.loads(vda_saying.factsheet(t_s))
        raw = json.dumps(report | {"physicalParameters": size}).encode()
        assert of.receive(raw, t_s, vda_saying.line("factsheet")) is None
        assert of.receive(vda_saying.state(t_s), t_s, vda_saying.line("state")) is None
        return next(iter(of.robots.values()))
    raw = iso_saying.identity(t_s, "KIT", imrModel="Carrier", imrFootprint=size)
    assert of.receive(raw, t_s, iso_saying.line("identity")) is None
    assert of.receive(iso_saying.odometry(t_s), t_s, iso_saying.line("odometry")) is None
    return of.robots[iso_saying.ROBOT]


def lengths_m(known: Robot) -> tuple[float, float]:
    assert known.forecast is not None
    return known.forecast.length_m, known.forecast.width_m


PROPER: dict[str, Any] = {
    "massrobotics": {"x": 2.0, "y": 0.5},
    "vda5050": {"length": 2.0, "width": 0.5},
    "iso21423": [{"x": x, "y": y} for x, y in ((1.0, 0.25), (-1.0, 0.25), (-1.0, -0.25), (1.0, -0.25))],
}
CASES = [(language, size) for language, sizes in SIZES.items() for size in sizes]


@pytest.mark.parametrize(("language", "size"), CASES)
def test_an_identity_without_a_size_says_the_rest(language: str, size: Any) -> None:
    of = fleet(default_envelope_m=(3.0, 1.5, 0.0))
    found = tell(of, language, size, NOW_S)
    assert (found.identity and found.identity.model, found.vendor) == ("Carrier", "KIT")
    assert lengths_m(found) == (3.0, 1.5)
    assert counted(of, "deviations_total")["KIT", "envelope-not-positive"] == 1


@pytest.mark.parametrize(("language", "size"), CASES)
def test_the_size_of_its_model_counts_and_else_the_one_that_it_last_said(language: str, size: Any) -> None:
    model = Model(envelope_m=(4.0, 1.0, 0.0))
    assert lengths_m(tell(fleet(Vendor(name="KIT", models={"Carrier": model})), language, size, NOW_S)) == (4.0, 1.0)
    of = fleet()
    assert lengths_m(tell(of, language, PROPER[language], NOW_S)) == (2.0, 0.5)
    assert lengths_m(tell(of, language, size, NOW_S + 1)) == (2.0, 0.5)
    assert ("KIT", "identity-changed") not in counted(of, "deviations_total")
