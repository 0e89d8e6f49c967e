"""A simple adviser, the least that advice must beat: it asks one of two that stand for each other."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from math import atan2, cos, hypot, sin
from typing import Any

import numpy as np

from deconflict.adviser import Request
from deconflict.adviser.asked import Verb
from ingest.batch import Floats

STOOD_S = 3.0
STANDS_MPS = 0.03
NEAR_M, ACROSS_M = 3.5, 0.75
WAY_S = 6
"""Of a path that is believed to be wanted now."""
LEAST_WAY_M = 0.5
BEGINS_WITHIN_S, LATEST_S, PAUSE_S = 4.0, 40.0, 3.0
VERBS: tuple[Verb, ...] = ("go_around", "back_out", "step_aside", "other_way")


@dataclass(slots=True)
class Seen:
    """The newest report of a robot."""

    vendor: str
    xy: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    path_m: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    stood_since_s: float = float("inf")

    def wants_through(self, other: "Seen") -> bool:
        """Whether its path leads soon to where another is."""
        points_m = np.concatenate([[self.xy], self.path_m[:WAY_S]])
        if np.hypot(*(points_m[-1] - points_m[0])) < LEAST_WAY_M:
            return False
        steps = np.linspace(0, len(points_m) - 1, 6 * len(points_m))
        x_m, y_m = (np.interp(steps, np.arange(len(points_m)), points_m[:, k]) for k in (0, 1))
        return bool(np.hypot(x_m - other.xy[0], y_m - other.xy[1]).min() < ACROSS_M)


@dataclass(slots=True)
class Pair:
    """What was asked because of two robots."""

    tries: int = 0
    open: Request | None = None
    asked_s: float = 0.0
    accepted: bool = False


class Believed:
    """Has the methods of the product's adviser."""

    def __init__(self) -> None:
        self._seen: dict[str, Seen] = {}
        self._pairs: dict[tuple[str, str], Pair] = {}
        self._by_id: dict[str, Pair] = {}
        self._made = 0

    def hear(self, now_s: float, messages: Iterable[Mapping[str, Any]]) -> list[Request]:
        for message in messages:
            self._take(message)
        found = [request for pair in self._pairs.values() for request in self._lapses(pair, now_s)]
        busy = {robot for key, pair in self._pairs.items() if pair.open for robot in key}
        for key in self._standing(now_s):
            pair = self._pairs.setdefault(key, Pair())
            if busy & set(key) or now_s - pair.asked_s < PAUSE_S:
                continue
            found += self._ask(key, pair, now_s)
            busy |= set(key)
        return found

    def answer(self, request_id: str, answer: str, why: str = "") -> None:
        pair = self._by_id.get(request_id)
        if pair is None or pair.open is None or pair.open.id != request_id:
            return
        if answer == "accepted":
            pair.accepted = True
        else:
            pair.tries = 0 if answer == "done" else pair.tries + 1
            pair.open, pair.asked_s = None, pair.asked_s if answer == "done" or why == "" else 0.0

    def _take(self, message: Mapping[str, Any]) -> None:
        uuid = message["uuid"]
        if "manufacturerName" in message:
            self._seen.setdefault(uuid, Seen(message["manufacturerName"]))
            return
        seen, place = self._seen[uuid], message["location"]
        seen.xy = place["x"], place["y"]
        seen.yaw = 2 * atan2(place["angle"]["z"], place["angle"]["w"])
        seen.path_m = np.array([(point["x"], point["y"]) for point in message.get("path", [])]).reshape(-1, 2)
        at_s = datetime.fromisoformat(message["timestamp"]).timestamp()
        stands = abs(message["velocity"]["linear"]) < STANDS_MPS
        seen.stood_since_s = min(seen.stood_since_s, at_s) if stands else float("inf")

    def _standing(self, now_s: float) -> list[tuple[str, str]]:
        """Pairs of two vendors that have stood for each other for some seconds."""
        stood = [(uuid, seen) for uuid, seen in self._seen.items() if now_s - seen.stood_since_s >= STOOD_S]
        return [
            (a, b)
            for k, (a, first) in enumerate(stood)
            for b, second in stood[k + 1 :]
            if first.vendor != second.vendor
            and hypot(first.xy[0] - second.xy[0], first.xy[1] - second.xy[1]) < NEAR_M
            and first.wants_through(second)
            and second.wants_through(first)
        ]

    def _ask(self, key: tuple[str, str], pair: Pair, now_s: float) -> list[Request]:
        verb = VERBS[pair.tries // 2 % len(VERBS)]
        robot, other = key if pair.tries % 2 == 0 else key[::-1]
        seen = self._seen[other]
        at = seen.xy if verb == "other_way" else None
        request = self._request(robot, verb, at, other, now_s)
        pair.open, pair.asked_s, pair.accepted = request, now_s, False
        self._by_id[request.id] = pair
        return [request, self._request(other, "go_first", None, robot, now_s), *self._keep_away(robot, other, now_s)]

    def _keep_away(self, robot: str, other: str, now_s: float) -> list[Request]:
        """Ask one that drives up to the two to wait some way before them."""
        behind = self._seen[robot]
        for uuid, seen in self._seen.items():
            if uuid in (robot, other) or now_s - seen.stood_since_s > 0 or not seen.wants_through(behind):
                continue
            away_m = hypot(seen.xy[0] - behind.xy[0], seen.xy[1] - behind.xy[1])
            if away_m > NEAR_M:
                at = behind.xy[0] - 2.0 * cos(seen.yaw), behind.xy[1] - 2.0 * sin(seen.yaw)
                return [replace(self._request(uuid, "wait_before", at, other, now_s), latest_s=now_s + 10.0)]
        return []

    def _request(self, robot: str, verb: Verb, at: tuple[float, float] | None, other: str, now_s: float) -> Request:
        self._made += 1
        return Request(str(self._made), robot, verb, at, other, (other,), now_s + LATEST_S)

    def _lapses(self, pair: Pair, now_s: float) -> list[Request]:
        """Take back what nobody has begun, and forget what is over."""
        if pair.open is None:
            return []
        asked, moved = pair.open, self._seen[pair.open.robot].stood_since_s > now_s
        if pair.accepted:
            if now_s >= asked.latest_s or (asked.verb == "other_way" and moved):
                pair.open, pair.tries = None, 0
            return []
        if now_s - pair.asked_s < BEGINS_WITHIN_S:
            return []
        pair.open, pair.tries = None, pair.tries + 1
        return [replace(asked, withdrawn=True)]
