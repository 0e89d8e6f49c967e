"""The demo's robots, the time that they lose, and what following advice saves.

Where one hall is too small for its robots, places and drawing of the hall repeat beside it.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from typing import Any

from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.settings.shared_places import FloorPart, Place, Polygon, Resource
from deconflict.settings.site import Site
from deconflict.simulation.demo.advice_follower import Follow, Follower
from deconflict.simulation.driving.lost_time import LostTimeCounter
from deconflict.simulation.driving.traffic import World
from deconflict.simulation.floor_layout import PATTERNS, halls_for
from deconflict.simulation.scripted_annex import Annex
from deconflict.simulation.vendors.senders import STEP_S, RobotFloor, warehouse
from deconflict_client.counted_nouns import count_of
from deconflict_client.situations import AnyRevision

EDGE_M = 0.6
"""What comes so near to both ends of a hall runs through all halls."""


def with_halls(site: Site, robots: int) -> Site:
    """The site with halls side by side for a number of robots, as `layout_for` lays them out."""
    halls = halls_for(robots)
    rows = {datum.id: _HallRow(pattern.width_m, halls) for datum, pattern in zip(site.datums, PATTERNS, strict=True)}
    places = {
        name: tuple(repeated for place in getattr(site, name) for repeated in _places(place, rows))
        for name in ("resources", "zones")
    }
    drawn = {
        name: tuple(repeated for part in getattr(site, name) for repeated in _parts(part, rows[part.floor]))
        for name in ("areas", "obstacles")
    }
    return site.model_copy(update=places | drawn)


class _HallRow:
    """The halls of one floor, from west to east."""

    def __init__(self, width_m: float, halls: int) -> None:
        self.width_m = width_m
        self._last = halls - 1

    def outlines(self, outline: Polygon) -> Iterator[tuple[int, Polygon]]:
        """The halls, counted from 0, that have such a part, and its outline there."""
        west_m, east_m = min(x for x, _ in outline), max(x for x, _ in outline)
        if east_m <= 0.0 or max(y for _, y in outline) < 0.0:  # the wall in the west, and the annex in the south
            yield 0, outline
        elif west_m >= self.width_m:  # the wall in the east
            yield self._last, _moved(outline, self._last * self.width_m)
        elif west_m <= EDGE_M and east_m >= self.width_m - EDGE_M:
            yield 0, tuple((x + self._last * self.width_m if x > EDGE_M else x, y) for x, y in outline)
        else:
            for hall in range(self._last + 1):
                yield hall, _moved(outline, hall * self.width_m)


def _places(place: Place, rows: Mapping[str, _HallRow]) -> Iterator[Place]:
    for hall, polygon in rows[place.datum].outlines(place.polygon):
        changed: dict[str, object] = {"id": f"{place.id}-hall-{hall + 1}" if hall else place.id}
        changed |= {"name": _named(place.name, hall), "polygon": polygon}
        if isinstance(place, Resource):
            changed["group"] = f"{place.group}-{hall + 1}" if hall and place.group else place.group
            changed["floors"] = tuple(
                door.model_copy(update={"polygon": _moved(door.polygon, hall * rows[door.datum].width_m)})
                for door in place.floors
            )
        yield place.model_copy(update=changed)


def _parts(part: FloorPart, row: _HallRow) -> Iterator[FloorPart]:
    for hall, outline_m in row.outlines(part.outline_m):
        yield part.model_copy(update={"name": _named(part.name, hall), "outline_m": outline_m})


def _named(name: str, hall: int) -> str:
    return f"{name} of hall {hall + 1}" if hall and name else name


def _moved(outline: Polygon, east_m: float) -> Polygon:
    return tuple((x + east_m, y) for x, y in outline)


SHOWN = ("delay_s", "waited_s", "stops", "trips")
"""The sums of `LostTime` that the demo prints."""
ORDERS = ("wait", "slow_down", "back_out", "go_around", "wait_before")


class FollowingFloor(RobotFloor, ABC):
    """Robots that report, and may follow advice."""

    who = "robots of four vendors"
    """Who they are, for people."""

    def __init__(self, world: World, annex: Annex, follow: Follow) -> None:
        super().__init__(world, annex)
        self._follower = Follower(world, world.rows(), follow) if follow is not Follow.NONE else None

    @property
    def follows_advice(self) -> bool:
        return self._follower is not None

    def begin(self) -> None:
        """The engine is up: from now on there is advice."""

    def pass_on(self, revision: AnyRevision, now_s: float) -> None:
        """Pass on the advice of a revision, if the robots follow advice. `now_s` is seconds since the epoch."""
        if self._follower:
            self._follower.pass_on(revision, now_s)

    def take_answers(self) -> list[AnsweredAdvice]:
        """What robots have answered to what was asked of them since the last call."""
        return self._follower.take_answers() if self._follower else []

    @abstractmethod
    def result(self) -> dict[str, Any]:
        """What the demo's last line says of these robots."""

    @abstractmethod
    def sentence(self) -> str:
        """What following advice saved so far; empty if the robots follow none."""

    def report(self) -> Iterable[str]:
        """What the demo prints before its last line."""
        return ()


class DemoFloor(FollowingFloor):
    """The robots that report. If they follow advice, the same robots without advice move beside them, unreported."""

    def __init__(self, robots: int, seed: int, *, follows_advice: bool) -> None:
        super().__init__(*warehouse(robots, seed), Follow.SITUATIONS if follows_advice else Follow.NONE)
        self.lost = LostTimeCounter(self.world)
        """What the robots of the halls lose."""
        self._without_advice = DemoFloor(robots, seed, follows_advice=False) if follows_advice else None

    def step(self) -> None:
        super().step()
        self.lost.update(STEP_S)
        if self._without_advice:
            self._without_advice.step()

    def result(self) -> dict[str, Any]:
        """The sums over the robots of the halls; with advice, those of the same robots without it beside them."""
        sums = asdict(self.lost.now())
        shown: dict[str, Any] = {name: sums[name] for name in SHOWN}
        if self._without_advice:
            shown["without_advice"] = self._without_advice.result()
        return shown

    def sentence(self) -> str:
        if not self._without_advice or not self._follower:
            return ""
        own, other = self.lost.now(), self._without_advice.lost.now()
        orders = sum(self._follower.counts[action] for action in ORDERS)
        return (
            f"Robots follow advice: {count_of(orders, 'order')} so far. "
            f"They were {own.delay_s:.0f} s late on their way, {other.delay_s:.0f} s without advice; "
            f"{own.stops} long stops, {other.stops} without; {own.trips} arrivals, {other.trips} without"
        )
