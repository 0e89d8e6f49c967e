"""What odd times and messages do to the adviser, and what it keeps."""

from collections.abc import Iterable
from functools import partial
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

from deconflict.adviser import Adviser, Request
from tests.deconflict.adviser.floors import START_S, Floor, face_to_face


@pytest.mark.parametrize("now_s", [nan, inf, -inf])
def test_a_time_that_is_not_finite_is_refused_and_changes_nothing(now_s: float) -> None:
    floor = Floor(face_to_face())
    with pytest.raises(ValueError, match="seconds since the epoch"):
        floor.adviser.hear(now_s, [])
    assert floor.until("go_around")


def test_if_the_time_goes_back_requests_are_withdrawn_and_new_ones_have_other_ids() -> None:
    floor = Floor(face_to_face())
    before = floor.until("go_around")
    floor.now_s -= 3600.0
    found = floor.seconds(12)
    assert (found[0].id, found[0].withdrawn) == (before.id, True)
    assert [each.verb for each in found[1:2]] == ["go_around"]
    assert before.id not in {each.id for each in found[1:]}


def test_if_the_time_goes_back_robots_are_where_they_say_now() -> None:
    floor = Floor(face_to_face())
    floor.until("go_around")
    long_m = {uuid: robot.length_m for uuid, robot in floor.adviser._robots.items()}
    floor.now_s -= 3600.0
    floor.robots[1].x_m += 20.0
    assert all(request.withdrawn for request in floor.seconds(12))
    assert {uuid: robot.length_m for uuid, robot in floor.adviser._robots.items()} == long_m


def test_a_clock_that_goes_back_a_little_ends_no_request() -> None:
    floor = Floor(face_to_face())
    request = floor.until("go_around")
    floor.adviser.answer(request.id, "accepted")
    floor.now_s -= 2.0
    assert floor.seconds(6) == []


def test_what_is_known_of_robots_that_have_left_does_not_grow(tmp_path: Path) -> None:
    site = tmp_path / "site.toml"
    site.write_text('name = "s"\n[reading]\nforget_after_s = 60.0\n', encoding="utf-8")

    def kept_after(pairs: int) -> int:
        adviser, now_s, asked = Adviser(site), START_S, 0
        for k in range(pairs):
            robots = face_to_face(name=str(k))
            floor = Floor(robots, adviser, now_s)
            adviser.hear(now_s, [{**robot.identity(), "uuid": robot.uuid.upper()} for robot in robots])
            asked += len(floor.seconds(12, partial(_by_turns, k)))
            now_s = floor.now_s + 600.0
            adviser.hear(now_s, [])
        assert asked >= pairs
        return _entries(adviser._advice) + len(adviser._identities)

    assert kept_after(24) == kept_after(12)


def _by_turns(turn: int, _: Request) -> tuple[str, ...]:
    return [("declined", "cannot"), ("accepted",), ("declined", "no room")][turn % 3]


def _entries(thing: object) -> int:
    """How many entries the containers of an object have, and those of all that is in them."""
    if isinstance(thing, dict):
        return len(thing) + sum(_entries(value) for value in thing.values())
    if isinstance(thing, list | set | tuple | frozenset):
        return len(thing) + sum(_entries(value) for value in thing)
    if not type(thing).__module__.startswith("deconflict.adviser"):
        return 0
    names: Iterable[str] = getattr(type(thing), "__slots__", None) or vars(thing)
    return sum(_entries(getattr(thing, name)) for name in names)


def _cyclic() -> dict[str, Any]:
    message: dict[str, Any] = {}
    message["itself"] = message
    return message


BAD = [
    {},
    None,
    [1],
    "text",
    b"bytes",
    3,
    {"uuid": None},
    {1: 2},
    {"uuid": {1}},
    {"uuid": "x", "path": object()},
    _cyclic(),
]


@pytest.mark.parametrize("message", BAD, ids=lambda message: type(message).__name__)
def test_messages_that_are_no_reports_are_counted_and_do_not_harm_others(message: Any) -> None:
    floor = Floor(face_to_face())
    floor.adviser.hear(floor.now_s, [message, message])
    assert floor.adviser.refused == 2
    assert floor.until("go_around")


def test_reports_with_numbers_that_are_not_finite_are_counted() -> None:
    floor = Floor(face_to_face())
    status = floor.robots[0].status(floor.now_s)
    floor.adviser.hear(floor.now_s, [{**status, "location": {**status["location"], "x": nan}}, status])
    assert floor.adviser.refused == 1
