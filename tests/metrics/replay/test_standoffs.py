"""Two robots of two vendors that stand before a free crossing, each for the other: what people are told, and what it
costs."""

from dataclasses import replace
from math import hypot
from pathlib import Path
from random import Random

import pytest

from deconflict_client.advisory import AdvisoryState, DeadlockAdvisory
from tests.metrics.replay.made_standoffs import MASSROBOTICS, VDA5050, Standoff, found_in

GOES_S = 45.0


def drawn(number: int) -> Standoff:
    """An instance: angle, distances, sizes, times, and either language."""
    draw = Random(number)
    length_m = draw.uniform(0.8, 1.4)
    clear_m = length_m / 2 + 0.9
    stops_s = draw.randint(9, 13)
    return Standoff(
        angle_deg=draw.choice((-1, 1)) * draw.uniform(65.0, 115.0),
        before_m=(draw.uniform(clear_m, 2.9), draw.uniform(clear_m, 2.9)),
        size_m=(length_m, draw.uniform(0.5, 0.8)),
        stops_s=(stops_s, stops_s + draw.randint(0, 4)),
        goes_s=(GOES_S, GOES_S + 8),
        language=(MASSROBOTICS, VDA5050)[number % 2],
    )


@pytest.mark.parametrize("number", range(8))
def test_people_are_told_who_goes_first_and_the_wait_is_booked(number: int, tmp_path: Path) -> None:
    standoff = drawn(number)
    found = found_in(standoff, tmp_path, 75, has_zone=True)
    (raised_s, raised), *_, (cleared_s, cleared) = found.of_kind("deadlock")
    assert isinstance(raised, DeadlockAdvisory)
    assert raised_s - max(standoff.stops_s) <= 15.0
    assert len(raised.robots) == len(raised.cycle) == 2
    assert hypot(raised.location.x, raised.location.y) < 2.5, "where the ways cross"
    assert raised.recommendation
    wait, first = raised.recommendation.actions
    assert (wait.action, first.action) == ("wait", "go_first")
    assert {wait.robot, first.robot} == set(raised.robots)
    assert raised.summary.endswith(f"{first.name} should go first")
    assert cleared.state is AdvisoryState.CLEARED
    assert GOES_S < cleared_s < GOES_S + 15.0
    assert any(situation.situation_kind == "deadlock" and situation.advice for _, situation in found.situations)
    assert not found.of_kind("double_occupancy"), "both bodies are outside"
    for row, vendor in enumerate(standoff.vendors):
        assert found.lost_s(vendor) >= GOES_S - max(standoff.stops_s) - 3.0
        assert {loss.by_vendor for loss in found.losses if loss.vendor == vendor} == {standoff.vendors[1 - row]}


@pytest.mark.parametrize("language", [MASSROBOTICS, VDA5050])
def test_a_mutual_wait_is_said_once_while_nothing_changes(language: str, tmp_path: Path) -> None:
    found = found_in(Standoff(language=language, before_m=(2.6, 2.4)), tmp_path, 100)
    assert [advisory.state for _, advisory in found.of_kind("deadlock")] == [AdvisoryState.RAISED]
    late = [situation for at_s, situation in found.situations if at_s > 50.0]
    assert not late, "its advice stands"


@pytest.mark.parametrize(
    "standoff",
    [
        Standoff(vendors=("Alder", "Alder")),
        Standoff(goes_s=(15.0, 21.0)),
        Standoff(angle_deg=0.0, before_m=(2.0, 9.0)),
        Standoff(before_m=(2.0, -4.0), stops_s=(14.0, 10.0)),
    ],
    ids=["one vendor", "short", "one behind the other", "one has passed"],
)
@pytest.mark.parametrize("language", [MASSROBOTICS, VDA5050])
def test_no_mutual_wait_is_made_of_anything_else(standoff: Standoff, language: str, tmp_path: Path) -> None:
    found = found_in(replace(standoff, language=language), tmp_path, 45)
    assert not found.of_kind("deadlock")
