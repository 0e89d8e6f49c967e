from math import hypot

import numpy as np

from deconflict.foresight.presence.live_robots import LiveRobots
from ingest.batch import Batch
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from tests.deconflict.engine.made_engine import LINE, NOW_S, SITE
from tests.helpers.saying import HALL, LOFT, robot, status

RNG = np.random.default_rng(5)
SPOTS = {f"R{n}": (*RNG.uniform(0, 40, 2).round(2).tolist(), HALL if n % 3 else LOFT) for n in range(60)}


def new_fleet() -> Fleet:
    return Fleet(VendorRegistry(()), FrameRegistry(SITE.datums, ()), SITE.reading, Measures(), Quarantine())


def batch(fleet: Fleet, names: list[str], now_s: float) -> Batch:
    """A batch of reports of these robots, standing at their places."""
    for name in names:
        x, y, datum = SPOTS[name]
        location = {"x": x, "y": y, "angle": {"x": 0, "y": 0, "z": 0, "w": 1}, "planarDatum": datum}
        assert fleet.receive(status(name, now_s, location=location), now_s, LINE) is None
    return fleet.next_batch(now_s)


def nearest(group: set[str], within_m: float, most: int, there: list[str]) -> list[str]:
    """The expected result, by looking at every robot."""
    away = []
    for name in set(there) - group:
        x, y, datum = SPOTS[name]
        if any(SPOTS[name][2] == datum for name in group):
            away.append((min(hypot(x - SPOTS[name][0], y - SPOTS[name][1]) for name in group), robot(name)))
    near = [uuid for away_m, uuid in sorted(away) if away_m <= within_m][:most]
    return sorted([*map(robot, group), *near])


def test_a_group_comes_with_the_nearest_robots_of_its_floors() -> None:
    live = LiveRobots()
    live.update(batch(new_fleet(), list(SPOTS), NOW_S))
    for group in ({"R1"}, {"R1", "R2"}, {"R0", "R7", "R30"}):
        for within_m, most in ((15.0, 100), (100.0, 5)):
            found = live.group_with_nearest({robot(name) for name in group}, within_m, most)
            assert found == nearest(group, within_m, most, list(SPOTS))
    assert live.group_with_nearest(set(), 15.0, 100) == []
    others = [name for name in SPOTS if name not in {"R2", "R40"}]
    found = live.group_with_nearest({robot("R1"), robot("R2")}, 100.0, 30, without={robot("R2"), robot("R40")})
    assert found == nearest({"R1", "R2"}, 100.0, 30, others)


def test_a_removed_robot_is_near_nobody_and_its_slot_is_reused() -> None:
    live, fleet, early = LiveRobots(), new_fleet(), [f"R{n}" for n in range(30)]
    live.update(batch(fleet, early, NOW_S))
    live.remove([robot(name) for name in early[5:]])
    live.update(batch(fleet, [f"R{n}" for n in range(28, 60)], NOW_S + 1))
    there = [*early[:5], *(f"R{n}" for n in range(28, 60))]
    assert live.group_with_nearest({robot("R1")}, 1e3, 100) == nearest({"R1"}, 1e3, 100, there)
    assert live.robots.keys() == {robot(name) for name in there}


def test_robots_that_are_set_aside_keep_their_reports_but_not_the_batches_of_others() -> None:
    live, fleet, names = LiveRobots(), new_fleet(), [f"R{n}" for n in range(50)]
    for number, name in enumerate(names):
        live.update(batch(fleet, [name, "R55"], NOW_S + number))
    before = {name: live.robots[robot(name)] for name in names}
    expected = {name: (known.name, known.event_s, float(known.forecast.x_m[0])) for name, known in before.items()}
    live.update(batch(fleet, ["R7"], NOW_S + 60))
    live.set_aside([robot(name) for name in names if name != "R7"])
    assert len({id(live.robots[robot(name)].batch) for name in names if name != "R7"}) == 1
    assert robot("R55") not in live.robots[robot("R3")].batch.robots
    found = {name: (known.name, known.event_s, float(known.forecast.x_m[0])) for name, known in before.items()}
    assert found.pop("R7")[1] == NOW_S + 60
    del expected["R7"]
    assert found == expected


def test_forecasts_of_several_batches_are_each_robots_newest() -> None:
    live, fleet = LiveRobots(), new_fleet()
    for now_s, names in ((NOW_S, ["R1", "R2", "R3"]), (NOW_S + 1, ["R2", "R4"])):
        live.update(batch(fleet, names, now_s))
    wanted = [robot(name) for name in ("R4", "R1", "R2", "R3")]
    keys, found = live.forecasts([*wanted, robot("nobody")])
    assert sorted(keys) == sorted(wanted)
    for row, key in enumerate(keys):
        name = next(name for name in SPOTS if robot(name) == key)
        forecasts = found.single(row)
        assert (forecasts.x_m[0], forecasts.y_m[0]) == SPOTS[name][:2]
        assert forecasts.t_s[0] == NOW_S + (name in ("R2", "R4"))
