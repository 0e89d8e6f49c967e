from math import isinf
from typing import Any

import pytest

from ingest.batch import Basis
from ingest.languages.front_ends import FRONT_ENDS, language_of_topic
from ingest.languages.model import NO_PATH, Rejection, Status, Update
from ingest.languages.timestamps import write
from ingest.languages.tolerance import tolerant_json
from ingest.languages.tolerance.heard import RESTARTED, STEPPED_BACK
from ingest.languages.vda5050.vda_front_end import VdaFrontEnd
from tests.helpers.vda_saying import node, order, position, state, state_3, topic, under_way, vda, visualization
from tests.ingest.languages.vda5050.made_vda import Listener, T


def test_the_same_manufacturer_and_serial_number_are_the_same_robot_whatever_the_prefix() -> None:
    front_end = VdaFrontEnd()
    robot = front_end.sender("uagv/v2/KIT/0001/state")
    assert robot == front_end.sender("vda5050/v3/KIT/0001/order")
    assert robot != front_end.sender("uagv/v2/KIT/0002/state")
    assert robot is not None
    assert (robot.manufacturer, robot.serial) == ("KIT", "0001")


def test_a_topic_has_the_language_of_its_form() -> None:
    assert language_of_topic(topic("state")) == "vda5050"
    assert language_of_topic("KIT/0001/zoneSet") == "vda5050"
    for other in ("", "state", "KIT/state", "a/b/temperature", "uagv/v2//0001/state"):
        assert language_of_topic(other) is None
        assert all(each.sender(other) is None for each in FRONT_ENDS.values()) or other.endswith("temperature")


def test_a_message_that_comes_again_changes_nothing() -> None:
    listener = Listener()
    listener.hears("state", state(T))
    before = listener.memory
    again = listener.hears("state", state(T))
    assert isinstance(again, Update)
    assert again.findings == ("message-repeated",)
    assert listener.memory is before


def test_an_older_message_that_comes_later_changes_nothing() -> None:
    listener = Listener()
    listener.hears("state", state(T + 1, 5.0))
    late = listener.hears("state", state(T, 4.0))
    assert late.findings == ("message-reordered",)
    assert listener.status_after(("state", state(T + 2, 6.0))).x == 6.0


def test_a_robot_whose_clock_was_set_back_is_heard() -> None:
    listener = Listener()
    listener.hears("state", state(T, 1.0, headerId=7))
    assert listener.status_after(("visualization", visualization(T - 3600, 2.0, 0.0))).x == 2.0
    placed = listener.hears("state", state(T - 3600, 3.0, headerId=8))
    assert isinstance(placed, Status)
    assert (placed.x, placed.stamp_s, placed.findings) == (3.0, T - 3600, ())


@pytest.mark.parametrize("back_s", [1.0, 3600.0, 3e8])
def test_a_robot_whose_clock_was_set_back_is_placed_by_each_message(back_s: float) -> None:
    listener = Listener()
    listener.hears("visualization", visualization(T, 1.0, 0.0, headerId=70))
    listener.hears("state", state(T, 1.0, headerId=7))
    for step in range(1, 4):
        t_s = T - back_s + step / 10
        moved = listener.hears("state", state(t_s, 1.0 + step, headerId=7 + step))
        assert isinstance(moved, Status)
        assert (moved.x, moved.findings) == (1.0 + step, ())
        moved = listener.hears("visualization", visualization(t_s, 1.5 + step, 0.0, headerId=70 + step))
        assert isinstance(moved, Status)


def test_a_robot_that_counts_anew_with_an_older_clock_is_heard_after_some_messages() -> None:
    listener = Listener()
    listener.hears("state", state(T, 1.0, headerId=5000))
    older = [listener.hears("state", state(T - 3600 + s, 2.0 + s, headerId=s)) for s in range(RESTARTED)]
    assert {message.findings for message in older[:-1]} == {("message-reordered",)}
    assert isinstance(older[-1], Status)
    assert listener.status_after(("state", state(T - 3500, 50.0, headerId=RESTARTED))).x == 50.0


@pytest.mark.parametrize("number", [None, 0])
def test_a_robot_that_does_not_count_its_messages_is_heard_after_a_stamp_too_far_ahead(number: int | None) -> None:
    listener = Listener()
    listener.hears("state", state(T + 3600, 1.0, headerId=number))
    placed = [listener.hears("state", state(T + s, 3.0 + s, headerId=number)) for s in range(STEPPED_BACK)]
    assert [isinstance(message, Status) for message in placed] == [False] * (STEPPED_BACK - 1) + [True]
    assert listener.status_after(("state", state(T + 9, 9.0, headerId=number))).x == 9.0


def test_the_same_message_written_anew_is_repeated() -> None:
    listener = Listener()
    raw = state(T, 1.0, headerId=7)
    listener.hears("state", raw)
    assert listener.hears("state", raw.replace(b": ", b":")).findings == ("message-repeated",)


def test_other_poses_with_a_number_and_a_time_that_do_not_change_are_used() -> None:
    listener = Listener()
    for x in (1.0, 2.0, 3.0):
        moved = listener.status_after(("visualization", visualization(T, x, 0.0, headerId=1)))
        assert (moved.x, "stamp-unchanged" in moved.findings) == (x, x > 1.0)
    anew = visualization(T, 3, 0, headerId=1).replace(b": ", b":")
    assert listener.hears("visualization", anew).findings == ("message-repeated",)


def test_a_state_older_than_a_visualization_has_no_newer_pose_but_all_else() -> None:
    listener = Listener()
    listener.hears("visualization", visualization(T + 1, 5.0, 0.0))
    late = listener.hears("state", state(T, 4.0, paused=True))
    assert isinstance(late, Update)
    assert late.findings == ("stamp-not-increasing",)
    status = listener.front_end.status(b"", listener.memory, None)
    assert status is not None
    assert (status.x, status.state) == (5.0, "waitingExternalEvent")


def test_a_rejected_message_is_not_remembered() -> None:
    listener = Listener()
    listener.hears("state", state(T))
    before = listener.memory
    assert isinstance(listener.hears("state", state(T + 1, 2e7)), Rejection)
    assert listener.memory is before


def test_poses_are_superseded_and_worth_nothing_when_they_are_old_and_all_else_is_needed() -> None:
    front_end = VdaFrontEnd()
    for kind in ("state", "visualization"):
        assert front_end.superseded(b"", topic(kind))
        assert front_end.has_pose(b"", topic(kind))
    for kind in ("order", "factsheet", "connection"):
        assert front_end.superseded(b"", topic(kind)) is None
        assert not front_end.has_pose(b"", topic(kind))


def test_kinds_without_a_meaning_here_are_accepted() -> None:
    listener = Listener()
    listener.hears("state", state(T))
    for kind in ("zoneSet", "responses"):
        assert isinstance(listener.hears(kind, vda(T)), Update)
    assert isinstance(listener.hears("state", state(T + 1, agvPosition=position(2.0))), Status)


@pytest.mark.parametrize(
    "header",
    [{"headerId": 0, "timestamp": "1970-01-01T00:00:00.000Z"}, {"headerId": None, "timestamp": "2026-09-21T14:13:20Z"}],
)
def test_a_header_that_is_not_filled_in_hides_no_message(header: dict[str, Any]) -> None:
    listener = Listener()
    listener.hears("order", order(T, [node(0, 0.0), node(1, 4.0)], **header))
    listener.hears("order", order(T, [node(0, 0.0), node(1, 4.0), node(2, 9.0)], orderUpdateId=1, **header))
    assert listener.memory is not None
    assert listener.memory.orders[-1].update_id == 1
    for x in (1.0, 2.0, 3.0):
        raw = state(T, x, **header)
        moved = listener.status_after(("state", raw))
        assert (moved.x, "stamp-unchanged" in moved.findings) == (x, x > 1.0)
        assert isinf(moved.stamp_resolution_s) == (x > 1.0)
        assert "message-repeated" in listener.hears("state", raw).findings


EMPTY: dict[str, Any] = {"loads": [], "nodeStates": [], "actionStates": [], "errors": []}
FATAL = {"errorType": "motor", "errorLevel": "FATAL"}
NODE = {"nodeId": "n2", "sequenceId": 2, "released": True}
SIZE = {"length": 1.2, "width": 0.8, "height": 0.2}
CENTRE = {"x": 0.0, "y": 0.0, "z": 0.2}


@pytest.mark.parametrize(
    ("key", "usual", "odd"),
    [
        ("errors", FATAL, {"errorType": "motor", "errorlevel": "FATAL"}),
        ("nodeStates", NODE, {"nodeID": "n2", "sequenceId": 2, "Released": True}),
        ("nodeStates", NODE, {"nodeId": "n2", "sequenceId": 2, "Released": True}),
        ("actionStates", {"actionStatus": "RUNNING"}, {"action_status": "RUNNING"}),
        (
            "loads",
            {"loadDimensions": SIZE, "boundingBoxReference": CENTRE},
            {"load_dimensions": SIZE, "boundingBoxReference": CENTRE},
        ),
    ],
)
def test_a_key_of_an_item_in_another_spelling_is_read_after_an_empty_list(
    key: str, usual: dict[str, Any], odd: dict[str, Any]
) -> None:
    empty = ("state", state(T, **EMPTY))
    expected = Listener().status_after(empty, ("state", state(T + 1, **EMPTY | {key: [usual]})))
    listener = Listener()
    read = listener.status_after(empty, ("state", state(T + 1, **EMPTY | {key: [odd]})))
    assert set(read.findings) == {*expected.findings, "key-spelling"}
    assert (read.state, read.is_blocked, read.loads) == (expected.state, expected.is_blocked, expected.loads)
    listener.hears("state", state(T + 2, **EMPTY))
    mixed = state(T + 3, **EMPTY | {key: [usual]}, Velocity={"vx": 0.5})
    assert listener.status_after(("state", mixed)).linear_mps == 0.5


def test_an_action_in_another_spelling_is_read_after_an_order_without_actions() -> None:
    lift = [{"action_id": "a", "actionType": "pick", "blocking_type": "HARD"}]
    first, then = [node(0, 0.0), node(1, 4.0)], [node(1, 4.0), node(2, 8.0, actions=lift), node(3, 12.0)]
    ordered = ("order", order(T, first)), ("order", order(T + 1, then, orderUpdateId=1))
    status = Listener().status_after(*ordered, ("state", under_way(T + 2, 5.0, 0.0, then[1:])))
    assert (status.path.poses[-1][1], status.path.ends_in_stop) == (8.0, True)


def test_a_usual_message_is_not_read_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    listener = Listener()
    items: dict[str, Any] = {"loads": [{"loadId": "7"}], "nodeStates": [NODE], "actionStates": [], "errors": [FATAL]}
    listener.hears("state", state(T, **items))
    monkeypatch.setattr(tolerant_json, "_repaired", None)
    assert isinstance(listener.hears("state", state(T + 1, 1.0, **items)), Status)


PLANNED = {"polyline": [{"x": float(s), "y": 0.0, "eta": write(T + s)} for s in range(1, 10)]}
CURVE = {"trajectory": {"controlPoints": [{"x": 0.0, "y": 0.0}, {"x": 9.0, "y": 0.0}]}}


def test_a_path_lasts_while_another_topic_has_none_and_its_times_lie_ahead() -> None:
    listener = Listener()
    first = listener.status_after(("state", state_3(T, driving=True, intermediatePath=PLANNED)))
    for seconds in (0.5, 8.5):
        later = listener.status_after(("visualization", visualization(T + seconds, seconds, 0.0)))
        assert (later.path, later.path_basis) == (first.path, Basis.PATH)
    assert listener.status_after(("visualization", visualization(T + 9.5, 9.0, 0.0))).path is NO_PATH


def test_a_path_ends_with_a_message_of_its_own_topic_or_with_the_drive() -> None:
    for gone in (("state", state_3(T + 1, driving=True)), ("visualization", visualization(T + 1, 1.0, 0.0))):
        listener = Listener()
        listener.hears(gone[0], vda(T, intermediatePath=PLANNED, agvPosition=position()))
        assert listener.status_after(gone).path is NO_PATH
    listener = Listener()
    listener.hears("visualization", visualization(T, 0.0, 0.0, intermediatePath=PLANNED))
    assert listener.status_after(("state", state_3(T + 1, driving=True))).path is not NO_PATH
    assert listener.status_after(("state", state_3(T + 2, driving=False))).path is NO_PATH


def test_a_path_of_another_topic_does_not_come_back_after_a_state_by_which_the_robot_stands() -> None:
    listener = Listener()
    listener.hears("visualization", visualization(T, 0.0, 0.0, intermediatePath=PLANNED, plannedPath=CURVE))
    listener.hears("state", state_3(T + 1, driving=False))
    gone_on = listener.status_after(("state", state_3(T + 2, driving=True, velocity={"vx": 1.0})))
    assert (gone_on.path, gone_on.destinations) == (NO_PATH, NO_PATH)


@pytest.mark.parametrize(("y", "is_kept"), [(0.0, True), (0.9, True), (1.1, False)])
def test_a_path_of_another_topic_is_followed_only_by_a_robot_that_is_beside_it(y: float, is_kept: bool) -> None:
    listener = Listener()
    listener.hears("state", state_3(T, driving=True, intermediatePath=PLANNED))
    away = listener.status_after(("visualization", visualization(T + 3, 3.0, y)))
    assert (away.path is not NO_PATH) == is_kept
    own = listener.status_after(("visualization", visualization(T + 4, 4.0, 5.0, intermediatePath=PLANNED)))
    assert own.path is not NO_PATH


@pytest.mark.parametrize(("x", "is_kept"), [(3.0, True), (1.0, False)])
def test_a_path_with_a_point_sent_twice_is_compared_with_the_pose_too(x: float, is_kept: bool) -> None:
    listener, points = Listener(), PLANNED["polyline"]
    listener.hears("state", state_3(T, driving=True, intermediatePath={"polyline": [points[0], *points]}))
    kept = listener.status_after(("visualization", visualization(T + 3, x, 0.0)))
    assert (kept.path is not NO_PATH) == is_kept


def test_a_planned_path_lasts_as_long_as_states_may_be_apart() -> None:
    listener = Listener()
    listener.hears("state", state(T, driving=True, plannedPath=CURVE))
    for seconds, is_planned in ((1.0, True), (34.0, True), (36.0, False)):
        later = listener.status_after(("visualization", visualization(T + seconds, 1.0, 0.0)))
        assert (later.path is not NO_PATH) == is_planned


def test_a_visualization_without_a_map_is_on_the_last_one() -> None:
    nameless = visualization(T + 1, 1.0, 0.0).replace(b'"mapId": "hall", ', b"")
    assert Listener().status_after(("visualization", nameless)).datum == ""
    read = Listener().status_after(("state", state(T)), ("visualization", nameless))
    assert (read.x, read.datum, read.findings) == (1.0, "hall", ("map-missing",))
    assert read.oddities[0].reading == "hall"


@pytest.mark.parametrize(("other_map", "datum"), [("hall", "hall"), ("attic", "")])
def test_a_state_without_a_map_is_on_that_of_its_nodes_and_then_on_the_last_one(other_map: str, datum: str) -> None:
    place = {"x": 4.0, "y": 0.0, "mapId": other_map}
    nodes = [node(0, 0.0), node(1, None, nodePosition=place)]
    nameless: dict[str, Any] = {"agvPosition": position(1.0, mapId=None)}
    listener = Listener()
    listener.hears("order", order(T, nodes))
    driving = listener.status_after(("state", under_way(T + 1, 1.0, 0.0, nodes[1:], **nameless)))
    assert (driving.datum, driving.findings[0]) == (datum, "map-missing")
    assert listener.status_after(("state", state(T + 2, orderId="", **nameless))).datum == datum
    lost = position(mapId=None, positionInitialized=False)
    assert listener.status_after(("state", state(T + 3, agvPosition=lost))).datum == ""


def test_a_state_without_a_map_is_on_the_other_floor_once_the_robot_has_passed_the_lift() -> None:
    upstairs = {"x": 0.0, "y": 0.0, "mapId": "loft"}
    nodes = [node(0, 0.0), node(1, 10.0), node(2, None, nodePosition=upstairs), node(3, None, nodePosition=upstairs)]
    listener = Listener()
    listener.hears("order", order(T, nodes))
    listener.hears("state", under_way(T + 1, 0.0, 0.0, nodes[1:]))
    datums = [
        listener.status_after(("state", under_way(T + s, 0.0, 0.0, ahead, agvPosition=position(mapId=None)))).datum
        for s, ahead in ((2, nodes[2:]), (60, nodes[3:]))
    ]
    assert datums == ["hall", "loft"]
