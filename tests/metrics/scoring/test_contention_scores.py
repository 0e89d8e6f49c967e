"""Logs in which it is known by construction what became of advisories on contention."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from deconflict.settings.shared_places import Resource, Zone
from ingest.languages import timestamps
from ingest.recording.log_reader import LogReader
from metrics.replay.replay import replay
from metrics.report.html_report import page
from metrics.truth.resource_use import ResourceUse
from tests.deconflict.contention.queues.made_driver import Driver
from tests.deconflict.contention.scenes import LINE, NOW_S, Scene, Script, aisle, resource, site
from tests.helpers.saying import identity

CHARGER = resource("c1", 0, 0, kind="charger", service_s=100.0)


def log_of(path: Path, robots: dict[str, Script], until_s: int) -> Path:
    raws = [(0.0, identity(name, NOW_S, manufacturerName=script.vendor)) for name, script in robots.items()]
    raws += [(float(t), script.says(name, t)) for t in range(until_s) for name, script in robots.items()]
    path.write_text(
        "".join(f'{{"received":"{timestamps.write(NOW_S + t + 0.05)}","message":{raw.decode()}}}\n' for t, raw in raws)
    )
    return path


def run(folder: Path, robots: dict[str, Script], until_s: int, *places: Resource | Zone) -> dict[str, Any]:
    reader = LogReader()
    return replay(reader, reader.read([log_of(folder / "log.jsonl", robots, until_s)]), site(*places), [0.3])


def scored(
    folder: Path, robots: dict[str, Script], until_s: int, *places: Resource | Zone
) -> dict[str, dict[str, Any]]:
    return {row["kind"]: row for row in run(folder, robots, until_s, *places)["contention"]}


def state_until(t_s: float) -> Any:
    return lambda t: "charging" if t < t_s else "navigating"


def charges(leaves_s: float) -> Script:
    """It is at the charger, and leaves."""
    knots = [(0.0, 0.0, 0.0), (leaves_s, 0.0, 0.0), (leaves_s + 20, -20.0, 0.0), (400.0, -20.0, 0.0)]
    return Script(knots, state=state_until(leaves_s))


def comes(enters_s: float, *, says: bool = True) -> Script:
    """It is 2.5 m before the charger after 20 s, stands there as long as it must, and goes in."""
    knots = [(0.0, 22.5, 0.0), (20.0, 2.5, 0.0), (enters_s - 2, 2.5, 0.0), (enters_s, 0.3, 0.0), (400.0, 0.3, 0.0)]
    goals = [(22.0, 0.0, 0.0)] if says else ()
    return Script(knots, goals, state=lambda t: "navigating" if says or t >= enters_s - 2 else "idle")


def test_a_predicted_queue_came_true_with_its_lead_time(tmp_path: Path) -> None:
    document = scored(tmp_path, {"A": charges(60), "B": comes(66)}, 130, CHARGER)["contention"]
    assert (document["alerts"], document["censored"], document["precision"]) == (1, 0, 1.0)
    assert (document["happened"], document["recall"], document["recall_any"]) == (1, 1.0, 1.0)
    # told within two looks, 20 s before it came to stand
    assert 16 <= document["lead_time_s"]["median"] <= 20
    # 100 s were thought to be left of the charging, and it was 41 s after B came
    assert document["wait_error_s"] == pytest.approx(80 - 41, abs=5)


def test_a_predicted_queue_that_does_not_happen_is_false(tmp_path: Path) -> None:
    document = scored(tmp_path, {"A": charges(12), "B": comes(22)}, 130, CHARGER)["contention"]
    assert (document["alerts"], document["precision"], document["happened"]) == (1, 0.0, 0)
    assert (document["recall"], document["lead_time_s"]) == (None, None)


def test_a_queue_of_a_robot_without_announcements_is_missed(tmp_path: Path) -> None:
    document = scored(tmp_path, {"A": charges(60), "B": comes(66, says=False)}, 130, CHARGER)["contention"]
    assert (document["alerts"], document["happened"], document["recall"]) == (0, 1, 0.0)
    assert document["precision"] is None


def test_outcomes_after_the_end_of_the_log_are_not_scored(tmp_path: Path) -> None:
    document = scored(tmp_path, {"A": charges(60), "B": comes(66)}, 15, CHARGER)["contention"]
    assert (document["alerts"], document["censored"], document["precision"]) == (1, 1, None)


def test_a_double_occupancy_has_an_advisory_while_it_lasts(tmp_path: Path) -> None:
    crowd = {
        "A": Script([(0.0, -0.6, 0.0)], state=lambda _: "idle"),
        "B": Script([(0.0, 10.0, 0.6), (10.0, 0.6, 0.6), (40.0, 0.6, 0.6), (50.0, 10.0, 0.6)]),
    }
    document = scored(tmp_path, crowd, 90, CHARGER)["double_occupancy"]
    assert (document["alerts"], document["precision"], document["happened"]) == (1, 1.0, 1)
    # nobody foretells it; it is seen within a few seconds
    assert (document["recall"], document["recall_any"]) == (0.0, 1.0)
    assert -5 <= document["lead_time_s"]["median"] < 0


@pytest.mark.parametrize("gives_way", [False, True])
def test_two_robots_face_to_face_in_a_lane_are_a_predicted_deadlock(tmp_path: Path, gives_way: bool) -> None:
    east, west = [(0.0, -20.0, 0.0), (40.0, 20.0, 0.0)], [(0.0, 20.0, 0.0), (40.0, -20.0, 0.0)]
    stops = [(0.0, -20.0, 0.0), (18.0, -2.0, 0.0), (100.0, -2.0, 0.0)]
    backs = [(0.0, 20.0, 0.0), (18.0, 2.0, 0.0), (20.0, 2.0, 0.0), (36.0, 20.0, 0.0)]
    robots = {
        "A": Script(east if gives_way else stops, [(40.0, 20.0, 0.0)], means=east),
        "B": Script(backs if gives_way else [*backs[:2], (100.0, 2.0, 0.0)], [(40.0, -20.0, 0.0)], means=west),
    }
    document = scored(tmp_path, robots, 90, aisle("lane", -10, 10))["deadlock"]
    assert (document["precision"], document["happened"], document["recall"]) == (0.0 if gives_way else 1.0, None, None)
    assert gives_way or document["lead_time_s"]["median"] > 0


def test_a_robot_that_is_held_up_stands_behind_the_blocker(tmp_path: Path) -> None:
    blocker = Script([(0.0, 0.0, 0.0)], state=lambda _: "idle")
    way = [(0.0, -15.0, 0.0), (30.0, -15.0, 0.0), (50.0, 5.0, 0.0)]
    held = Script([*way[:2], (43.0, -2.0, 0.0), (90.0, -2.0, 0.0)], means=way, vendor="Corvid")
    passing = Script([*way[:2], (43.0, -2.0, 0.0), (45.0, -2.0, 3.0), (60.0, 15.0, 3.0)], means=way, vendor="Corvid")
    assert scored(tmp_path, {"A": blocker, "B": held}, 120)["blockage"]["precision"] == 1.0
    assert scored(tmp_path, {"A": blocker, "B": passing}, 120)["blockage"]["precision"] == 0.0


@pytest.mark.parametrize(("z_m", "waits", "crowds"), [(0.0, 1, 1), (5.0, 0, 0)])
def test_nobody_waits_for_a_robot_above_it_nor_makes_a_crowd_with_it(
    tmp_path: Path, z_m: float, waits: int, crowds: int
) -> None:
    above = replace(charges(90), z_m=z_m)
    two = scored(tmp_path, {"A": above, "B": comes(66)}, 130, CHARGER)
    assert two.get("contention", {"happened": 0})["happened"] == waits
    assert two.get("double_occupancy", {"happened": 0})["happened"] == crowds
    assert bool(two) is bool(waits), "nor is anything said of it"


def test_what_is_said_of_a_place_is_held_against_who_came_when(tmp_path: Path) -> None:
    found = run(tmp_path, {"A": charges(60), "B": comes(66)}, 130, CHARGER)
    rows = {place["ahead_up_to_s"]: place for place in found["places"]}
    # A was thought to charge for 100 s, so that B was said to have room at 104 s, and it came at 66 s
    assert rows[120.0]["said"] > 0
    assert (rows[120.0]["came"], rows[120.0]["late"]) == (1.0, 0.0)
    assert rows[120.0]["off_median_s"] == pytest.approx(104 - 65, abs=2.0)
    assert (rows[60.0]["entries"], rows[60.0]["foretold"]) == (1, 1.0)
    assert rows[30.0]["full_said"] > 5
    assert rows[30.0]["full_precision"] >= 0.9
    (queue,) = [row for row in found["contention"] if row["kind"] == "contention"]
    assert queue["by_ahead"] == [{"ahead_up_to_s": 30.0, "alerts": 1, "precision": 1.0}]


def test_reports_half_a_minute_apart_of_a_robot_that_stands_are_of_one_stay() -> None:
    resource_use, fleet = ResourceUse([CHARGER], ()), Scene(site(CHARGER), {}).fleet
    for t in (0.0, 5.0, 35.0, 65.0, 100.0):
        fleet.receive(Script([(0, 9 if t == 0 else 0, 0)]).says("A", t), NOW_S + t, LINE)
        resource_use.add_batch(fleet.next_batch(NOW_S + t))
    resource_use.finish()
    assert [(new_entry.place, new_entry.t_s - NOW_S) for new_entry in resource_use.new_entries()] == [("c1", 5.0)]
    assert (resource_use.stays_s("c1") - NOW_S).tolist() == [[5.0, 100.0]]


@pytest.mark.parametrize(("names_at_s", "waits"), [(0, [0.0]), (40, [40.0]), (57, [])])
def test_a_robot_that_stands_far_away_waits_for_a_place_since_it_named_it(names_at_s: int, waits: list[float]) -> None:
    resource_use, fleet = ResourceUse([CHARGER], ()), Scene(site(CHARGER), {}).fleet
    far = [(0.0, 50.0, 0.0), (60.0, 50.0, 0.0), (70.0, 60.0, 0.0)]
    for t in range(70):
        goals = [(99.0, 0.0, 0.0)] if t >= names_at_s else ()
        fleet.receive(Script([(0.0, 0.0, 0.0)]).says("A", t), NOW_S + t, LINE)
        fleet.receive(Script(far, goals).says("B", t), NOW_S + t, LINE)
        resource_use.add_batch(fleet.next_batch(NOW_S + t))
    resource_use.finish()
    assert [wait.span.from_s - NOW_S for wait in resource_use.waits] == waits


def test_a_charger_that_a_robot_will_need_is_foretold_before_it_says_so(tmp_path: Path) -> None:
    def level(t: float) -> float:
        return 26.0 - 0.01 * t

    # B goes to the charger after 400 s, at 22 %, finds it taken, and has it after 610 s
    way = [
        (0.0, 25.0, 0.0),
        (400.0, 25.0, 0.0),
        (420.0, 3.0, 0.0),
        (606.0, 3.0, 0.0),
        (610.0, 0.3, 0.0),
        (700.0, 0.3, 0.0),
    ]
    names = Driver(way, [(425.0, 0.0, 0.0)], level=level, lasts_s=2600.0)
    silent = replace(names, destinations=(), state=lambda _: "idle")

    @dataclass
    class Needs(Script):
        def says(self, name: str, t: float, start_s: float = NOW_S) -> bytes:
            return (silent if t < 400 else names).says(name, t, start_s)

    found = run(tmp_path, {"A": charges(600), "B": Needs(way)}, 700, CHARGER.model_copy(update={"service_s": 900.0}))
    rows = {place["ahead_up_to_s"]: place for place in found["places"]}
    assert (rows[300.0]["entries"], rows[300.0]["foretold"]) == (1, 1.0)
    assert (rows[900.0]["need_came"], rows[30.0]["need_came"]) == (1.0, 0.0)
    assert rows[900.0]["need_likely"] > 0.9
    (queue,) = [row for row in found["contention"] if row["kind"] == "contention"]
    assert (queue["alerts"], queue["precision"]) == (1, 1.0)
    assert (queue["happened"], queue["recall"]) == (1, 1.0), "it stands far away when it names the charger: no wait yet"
    assert queue["by_ahead"] == [{"ahead_up_to_s": 900.0, "alerts": 1, "precision": 1.0}]
    assert queue["lead_time_s"]["median"] > 300


def test_the_report_has_the_sections_about_shared_places(tmp_path: Path) -> None:
    html = page(run(tmp_path, {"A": charges(60), "B": comes(66)}, 130, CHARGER), "Replay")
    for head in ("Contention, double", "Forecasts for shared places", "Errors of announced arrivals"):
        assert head in html


def test_without_advisories_and_events_there_are_no_figures(tmp_path: Path) -> None:
    assert scored(tmp_path, {"A": Script([(0.0, 30.0, 0.0), (60.0, 90.0, 0.0)])}, 60, CHARGER) == {}
