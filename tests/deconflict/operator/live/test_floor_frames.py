import json
from typing import Any

import numpy as np
import pytest

from deconflict.operator.live import floor_frames as module
from deconflict.operator.live.floor_frames import FloorFrames
from deconflict.settings.fleet_factory import fleet_of
from deconflict.settings.site import Site
from ingest.fleet.fleet import Fleet
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, Model, Trailers, Vendor
from tests.helpers.saying import HALL, LOFT, identity, points, robot, status

NOW_S = 1_792_000_000.0
LINE = Connection(1)


@pytest.fixture
def fleet() -> Fleet:
    return fleet_of(Site(), Measures())


def frame(picture: FloorFrames, version: int) -> dict[str, Any]:
    return json.loads(picture.since(version))


def moved(fleet: Fleet, *names: str, at_s: float = NOW_S, x: float = 0.0) -> None:
    for name in names:
        fleet.receive(status(name, at_s, x), at_s, LINE)


def test_a_row_has_the_poses_of_the_batch(fleet: Fleet) -> None:
    path = points((NOW_S + 2, 4.0, 1.0, 0.0), (NOW_S + 4, 4.0, 3.0, 1.5))
    fleet.receive(status("A-1", NOW_S, 2.0, 1.0, path=path), NOW_S + 0.25, LINE)
    batch, picture = fleet.next_batch(NOW_S + 0.3), FloorFrames()
    picture.add_batch(batch, whole=True)
    document = frame(picture, 0)
    (row,) = document["robots"]
    assert row[:6] == [robot("A-1"), batch.vendors[0], batch.names[0], "navigating", 0, "path"]
    assert (document["floors"], document["now_s"], document["whole"]) == ([HALL], NOW_S + 0.3, True)
    assert row[7] == NOW_S + 0.25
    knots, forecasts = np.reshape(row[11], (-1, 4)), batch.forecasts
    expected = np.stack([forecasts.t_s - batch.event_s[0], forecasts.x_m, forecasts.y_m, forecasts.yaw_rad], axis=1)
    assert np.abs(knots - expected).max() < 0.006
    assert row[9:11] == [forecasts.length_m[0], forecasts.width_m[0]]
    assert row[12] == "robot"


def test_a_row_has_the_shape_of_a_robot_that_is_no_rectangle() -> None:
    model = Model(shape="circle", diameter_m=0.8)
    fleet = fleet_of(Site(vendors=(Vendor(name="Alder", models={"A1": model}),)), Measures())
    fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    moved(fleet, "A-1", "B-1")
    picture = FloorFrames()
    picture.add_batch(fleet.next_batch(NOW_S), whole=True)
    rows = {row[0]: row for row in frame(picture, 0)["robots"]}
    assert rows[robot("A-1")][13:] == [[[0.4, 0.0, 0.0]], []]
    assert rows[robot("B-1")][13:] == []


def test_a_row_has_the_trailers_of_a_train_along_its_path() -> None:
    pulled = Trailers(count=2, length_m=1.2, width_m=0.8, hitch_m=1.5)
    fleet = fleet_of(Site(vendors=(Vendor(name="Alder", models={"A1": Model(trailers=pulled)}),)), Measures())
    fleet.receive(identity("A-1", NOW_S), NOW_S, LINE)
    fleet.receive(status("A-1", NOW_S, 2.0, 1.0, path=points((NOW_S + 10, 12.0, 1.0, 0.0))), NOW_S, LINE)
    picture = FloorFrames()
    picture.add_batch(fleet.next_batch(NOW_S), whole=True)
    (row,) = frame(picture, 0)["robots"]
    shape, (first, second) = row[13:]
    assert shape == []
    assert (first[:2], second[2:6], second[-4:]) == ([1.2, 0.8], [0.0, -1.0, 1.0, 0.0], [10.0, 9.0, 1.0, 0.0])


def test_the_row_ends_where_the_robot_leaves_the_floor() -> None:
    fleet = fleet_of(Site(datums=(Datum(id=HALL, name="Hall"), Datum(id=LOFT, name="Loft"))), Measures())
    path = points((NOW_S + 2, 1.0, 0.0, 0.0), (NOW_S + 4, 9.0, 9.0, 0.0))
    path[1]["planarDatumUUID"] = LOFT
    fleet.receive(status("A-1", NOW_S, path=path), NOW_S, LINE)
    picture = FloorFrames()
    picture.add_batch(fleet.next_batch(NOW_S), whole=True)
    (row,) = frame(picture, 0)["robots"]
    assert max(row[11][1::4]) < 9.0


def test_a_frame_holds_what_changed_since_the_version_and_no_more(fleet: Fleet) -> None:
    picture = FloorFrames()
    moved(fleet, "A-1", "A-2", "A-3")
    picture.add_batch(fleet.next_batch(NOW_S), whole=True)
    moved(fleet, "A-2", at_s=NOW_S + 1, x=1.0)
    picture.add_batch(fleet.next_batch(NOW_S + 1), whole=False)
    moved(fleet, "A-3", at_s=NOW_S + 2, x=1.0)
    picture.add_batch(fleet.next_batch(NOW_S + 2), whole=False)
    changed = {since: {row[0] for row in frame(picture, since)["robots"]} for since in range(4)}
    everybody = {robot("A-1"), robot("A-2"), robot("A-3")}
    assert changed == {0: everybody, 1: everybody - {robot("A-1")}, 2: {robot("A-3")}, 3: set()}


def test_following_frame_by_frame_is_the_same_as_the_whole(fleet: Fleet) -> None:
    picture, known, version = FloorFrames(), dict[str, Any](), 0
    for step in range(30):
        names = [f"A-{i}" for i in range(8) if (step * 7 + i * 3) % 5 == 0]
        moved(fleet, *names, at_s=NOW_S + step * 40, x=float(step))
        picture.add_batch(fleet.next_batch(NOW_S + step * 40), whole=step == 0)
        if step % 3 == 0:
            document = frame(picture, version)
            known = {} if document["whole"] else known
            known |= {row[0]: row for row in document["robots"]}
            known = {uuid: row for uuid, row in known.items() if uuid not in document["gone"]}
            version = picture.version
            assert known == {row[0]: row for row in frame(picture, 0)["robots"]}
    assert known


def test_a_forgotten_robot_is_in_the_next_frame_and_in_no_later_one(fleet: Fleet) -> None:
    picture = FloorFrames()
    moved(fleet, "A-1")
    picture.add_batch(fleet.next_batch(NOW_S), whole=True)
    late_s = NOW_S + fleet.reading.forget_after_s + 1
    picture.add_batch(fleet.next_batch(late_s), whole=False)
    assert frame(picture, 1)["gone"] == [robot("A-1")]
    assert frame(picture, 2)["gone"] == []
    assert len(picture) == 0


def test_a_page_that_missed_too_many_departures_gets_the_whole_floor(
    fleet: Fleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_GONE", 1)
    picture = FloorFrames()
    moved(fleet, "A-1", "A-2")
    picture.add_batch(fleet.next_batch(NOW_S), whole=True)
    late_s = NOW_S + fleet.reading.forget_after_s + 1
    moved(fleet, "A-3", at_s=late_s)
    picture.add_batch(fleet.next_batch(late_s), whole=False)
    picture.add_batch(fleet.next_batch(late_s), whole=False)
    assert (frame(picture, 1)["whole"], frame(picture, 2)["whole"]) == (True, False)
    assert [row[0] for row in frame(picture, 1)["robots"]] == [robot("A-3")]
