"""Places that are set, moved and removed in any order are found as if each were the only one."""

from math import inf

import numpy as np
import pytest

from deconflict.foresight.presence import believed_places
from deconflict.foresight.presence.believed_places import BelievedPlace, BelievedPlaces
from deconflict.foresight.presence.report_intervals import Legs, ReportIntervals
from deconflict.sweep.geometry.envelope_distances import signed_gap
from deconflict.sweep.robot_slots import RobotSlots
from ingest.batch import Batch, Floats
from tests.deconflict.foresight.presence.made_watch import NOW_S, Watch

SIDE_M, WITHIN_M, DRIVERS = 40.0, 0.4, 30
PLACE = BelievedPlace(5.0, 3.0, 0.0, 0, 0.5, 0.3, -inf, inf, 0.0)


def driven(*begins_m: tuple[float, float]) -> tuple[Batch, Legs]:
    """Robots that have each driven a metre along x, from these points."""
    watch, intervals = Watch(), ReportIntervals(RobotSlots())
    for watch.now_s in (0.0, 1.0):
        for number, (x_m, y_m) in enumerate(begins_m):
            watch.say(f"driver {number}", x_m + watch.now_s, y_m, 1.0)
        batch = watch.fleet.next_batch(NOW_S + watch.now_s, everything=False)
        legs, _ = intervals.add_batch(batch)
    return batch, legs


def found(places: BelievedPlaces, batch: Batch, legs: Legs) -> tuple[list[str], list[str]]:
    """The silent robots that others came near, and those through whose places they drove."""
    approaches = places.approached(batch, legs, WITHIN_M)
    return [approach.silent for approach in approaches], list(places.driven_through(batch, legs))


@pytest.mark.parametrize("seed", range(3))
def test_places_are_found_whatever_has_changed_before(seed: int) -> None:
    random, places, known = np.random.default_rng(seed), BelievedPlaces(), dict[str, BelievedPlace]()
    batch, legs = driven(*random.uniform(0, SIDE_M, (DRIVERS, 2)).tolist())
    count = 0
    for changes in (20, 20, 60, 1, 5, 20, 20, 150, 3):
        for name in random.integers(0, 200, changes).astype(str).tolist():
            if known.pop(name, None) and random.random() < 0.3:
                places.discard(name)
            else:
                x_m, y_m, half_m = random.uniform((0, 0, 0.2), (SIDE_M, SIDE_M, 0.8)).tolist()
                known[name] = PLACE._replace(x_m=x_m, y_m=y_m, half_length_m=half_m)
                places.set(name, known[name])
        near, through = set[str](), set[str]()
        for name, place in known.items():
            alone = BelievedPlaces()
            alone.set(name, place)
            is_near, is_through = found(alone, batch, legs)
            near.update(is_near)
            through.update(is_through)
        assert tuple(map(set, found(places, batch, legs))) == (near, through)
        count += len(through)
    assert count > 10


def test_places_are_found_in_the_order_in_which_they_were_set() -> None:
    places, (batch, legs) = BelievedPlaces(), driven((4.5, 3.0))
    names = list(map(str, range(100)))
    for name in names:
        places.set(name, PLACE)
    assert found(places, batch, legs) == (names, names)
    places.set("3", PLACE._replace(x_m=5.1))
    places.discard("4")
    places.set("4", PLACE)
    names = [*(name for name in names if name != "4"), "4"]
    assert found(places, batch, legs) == (names, names)


def test_a_place_is_found_after_all_were_removed() -> None:
    places, (batch, legs) = BelievedPlaces(), driven((4.5, 3.0))
    for _ in range(100):
        places.set("silent", PLACE)
        places.discard("silent")
    assert found(places, batch, legs) == ([], [])
    places.set("silent", PLACE)
    assert found(places, batch, legs) == (["silent"], ["silent"])


def test_on_a_long_way_places_beside_its_middle_hide_none_on_it_and_cost_little(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    batch, legs = driven((0.0, 3.0))
    legs = legs._replace(x_m=legs.x_m[:, :1] + [0.0, 20.0])
    places, looks = BelievedPlaces(), list[int]()
    for number in range(400):
        places.set(str(number), PLACE._replace(x_m=6.0 + 0.4 * (number % 20), y_m=5.0 + 0.2 * (number // 20)))
    for x_m in (1.0, 10.0, 19.0):
        places.set(f"at {x_m}", PLACE._replace(x_m=x_m))

    def counted(dx: Floats, *args: Floats) -> Floats:
        looks.append(dx.size)
        return signed_gap(dx, *args)

    monkeypatch.setattr(believed_places, "signed_gap", counted)
    assert found(places, batch, legs) == (["at 1.0", "at 10.0", "at 19.0"],) * 2
    assert max(looks) < 200
