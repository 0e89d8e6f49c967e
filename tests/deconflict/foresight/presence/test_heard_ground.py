"""Who has left, by the edge of the ground on which robots were heard, and by the doors and lifts of the plan."""

import numpy as np
import pytest

from deconflict.foresight.presence.heard_ground import HeardGround
from deconflict.foresight.presence.presence import HEARD_GROUND, Presence
from deconflict.runtime.learned_state import UnreadableError, learned_of, packed, unpacked
from deconflict.settings.shared_places import Point, Resource, Zone
from deconflict.settings.site import Site
from tests.deconflict.foresight.presence.made_watch import DATUMS, Watch
from tests.helpers.saying import HALL

EDGE_M = 12.0
AT_THE_EDGE: tuple[Point, ...] = ((11.0, -1.0), (14.0, -1.0), (14.0, 1.0), (11.0, 1.0))
DOOR = Site(datums=DATUMS, zones=(Zone(kind="door", id="door", datum=HALL, polygon=AT_THE_EDGE),))
LIFT = Site(datums=DATUMS, resources=(Resource(kind="lift", id="lift", datum=HALL, polygon=AT_THE_EDGE),))
SOON_S = 3.3


def watch_of(site: Site, robots: int = 0) -> Watch:
    """So many robots have driven out over the edge."""
    watch = Watch()
    watch.presence = Presence(watch.live, watch.measures, site)
    for number in range(robots):
        watch.drive(f"leaver {number}", EDGE_M - 6.0, seconds=6)
    return watch


def there_at_once(watch: Watch, to_m: float = EDGE_M, path_s: int = 10) -> float:
    """How likely one is there that drove to a place, and is silent for less than its grace time."""
    watch.drive("A", to_m - 6.0, seconds=6, path_s=path_s)
    watch.wait(SOON_S)
    return watch.there("A")


def test_who_went_out_over_the_edge_of_the_heard_ground_has_left_at_once() -> None:
    assert there_at_once(watch_of(DOOR.model_copy(update={"zones": ()}), 3)) < 0.4


def test_who_falls_silent_on_heard_ground_or_on_new_ground_is_there() -> None:
    watch = watch_of(Site(datums=DATUMS), 3)
    assert there_at_once(watch, EDGE_M - 5.5, path_s=5) == 1.0
    watch.wait(3.0)
    assert watch.there("A") > 0.8
    assert there_at_once(watch_of(Site(datums=DATUMS))) == 1.0


@pytest.mark.parametrize(("site", "leavers"), [(Site(datums=DATUMS), 2), (DOOR, 0)])
def test_ground_behind_which_somebody_was_heard_has_no_edge(site: Site, leavers: int) -> None:
    watch = watch_of(site, leavers)
    watch.drive("passes", 2.0, seconds=9, speed_mps=2.0)
    watch.drive("passes too", 2.0, seconds=9, speed_mps=2.0)
    assert there_at_once(watch) == 1.0


def test_who_stops_at_the_edge_is_there() -> None:
    watch = watch_of(DOOR, 1)
    watch.stand("B", EDGE_M)
    watch.wait(8.0)
    assert watch.there("B") > 0.9


def test_the_first_through_a_door_of_the_plan_has_left_at_once() -> None:
    assert there_at_once(watch_of(DOOR), path_s=1) < 0.4
    assert there_at_once(watch_of(Site(datums=DATUMS)), path_s=1) == 1.0


def test_who_is_silent_in_a_lift_has_left_at_once() -> None:
    watch = watch_of(LIFT)
    watch.stand("B", EDGE_M)
    watch.wait(SOON_S)
    assert watch.there("B") < 0.4


def test_those_that_come_back_over_the_edge_keep_the_next_one_there() -> None:
    watch = watch_of(Site(datums=DATUMS), 3)
    for number in range(6):
        watch.drive(f"returns {number}", EDGE_M - 6.0, seconds=6)
        watch.wait(7.0)
        watch.drive(f"returns {number}", EDGE_M, speed_mps=-1.0, seconds=6)
    assert there_at_once(watch) == 1.0


def test_the_heard_ground_is_kept_over_a_restart() -> None:
    learned = unpacked(packed(learned_of(watch_of(Site(datums=DATUMS), 3).presence.learners)))
    nothing = learned_of(Watch().presence.learners)
    assert there_at_once(Watch(learned=nothing | {HEARD_GROUND: learned[HEARD_GROUND]})) < 0.4


@pytest.mark.parametrize("spoilt", [{"cells": [["hall", 1]]}, {"came": np.zeros(9)}, {"form": "cells of 9 m"}])
def test_unreadable_ground_is_refused(spoilt: dict[str, object]) -> None:
    with pytest.raises(UnreadableError):
        HeardGround().resume(HeardGround().learned() | spoilt)
