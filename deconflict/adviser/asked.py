"""Requests that were made: which robots follow them, and how long that takes."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from math import floor
from typing import NamedTuple

from deconflict.adviser.request import Request, Verb

BEGINS_WITHIN_S = 3.0
"""A robot that follows has set out by then. Else another is asked."""
ANSWERS_WITHIN_S = 2.0
"""The same for an answer of robots that answer."""
USUALLY_FOLLOWS, USUAL_WEIGHT = 0.7, 0.5
"""How likely a robot follows that was never asked, and how many requests that counts for."""
PAUSE_S, LONGEST_PAUSE_S = 5.0, 60.0
"""A robot that has not followed is asked again after this time, and after twice as long each further time."""
DECLINED_S, CANNOT_S = 20.0, 600.0
"""What a robot has declined is not asked of it again for so long; the second if it said that it cannot."""
BUSY_S = 3.0
"""A robot that was busy is asked nothing for so long, and for twice as long each further time."""
UNABLE_AFTER = 2
"""A verb that so many robots of a vendor could not do, and none could, is not asked of that vendor."""
CANNOT, BUSY = "cannot", "busy"
"""Reasons to decline: a vendor that never can, and a robot that cannot now. Any other is about the place."""
PLACE_M = 3.0
"""Side of the squares by which it is learned where a verb can be done."""
USUALLY_DONE, USUAL_ANSWERS, PLACE_WEIGHT = 0.8, 5, 1.0
"""How likely a verb can be done that was never asked, and how many answers that counts for; the third for how many
answers at a place the share on all floors counts."""


@dataclass(slots=True)
class Asked:
    """One request and what came of it. Times are seconds since the epoch."""

    request: Request
    asked_s: float
    from_m: tuple[float, float]
    """Where the robot was when it was asked."""
    from_rad: float
    """Its heading then."""
    rolls_m: float = 0.0
    """How far it may roll on before it stands."""
    answer: str = ""
    begun_s: float | None = None
    waits: Request | None = None
    """The request of another robot to wait while this one goes first."""

    @property
    def is_agreed(self) -> bool:
        """Whether its vendor has accepted it."""
        return self.answer in {"accepted", "done"}


class Option(NamedTuple):
    """Something that a robot could be asked for."""

    robot: str
    verb: Verb
    other: str

    @property
    def yields(self) -> tuple[str, str]:
        """The robot that loses time for the other, and the other."""
        return (self.other, self.robot) if self.verb == "go_first" else (self.robot, self.other)


@dataclass(slots=True)
class _OfRobot:
    asked: int = 0
    followed: int = 0
    ignored: int = 0
    """The newest requests in a row that it did not follow."""
    asked_s: float = 0.0
    busy: int = 0
    """In how many answers in a row it was busy."""
    busy_until_s: float = 0.0
    stopped: tuple[Verb, str] | None = None
    """Verb and other robot of the newest request that it began and did not finish."""
    declined_until_s: dict[tuple[Verb, str], float] = field(default_factory=dict)
    """By verb and other robot: until when it is not asked again."""


class Following:
    """Which robots follow requests, and which verbs their vendors can do."""

    def __init__(self, verbs: Mapping[str, Collection[Verb]]) -> None:
        """`verbs` may be asked of the robots of a vendor; every verb of robots of vendors that are not named."""
        self._verbs = verbs
        self._robots: dict[str, _OfRobot] = {}
        self._can: dict[tuple[str, Verb], tuple[set[str], set[str]]] = {}
        """By vendor and verb: a robot that has accepted it, and the first that cannot do it."""
        self._at: dict[tuple[Verb, int, int], list[int]] = {}
        """By verb and square: how many requests were accepted, and how many declined."""
        self._anywhere: dict[Verb, list[int]] = {}
        """The same by verb."""
        self._answers = False
        """Whether any robot has ever answered."""

    def likely(self, robot: str) -> float:
        """The probability that a robot follows the next request."""
        record = self._of(robot)
        return (record.followed + USUALLY_FOLLOWS * USUAL_WEIGHT) / (record.asked + USUAL_WEIGHT)

    def usually(self, verb: Verb) -> float:
        """The probability that a verb can be done anywhere."""
        accepted, declined = self._anywhere.get(verb, (0, 0))
        return (accepted + USUALLY_DONE * USUAL_ANSWERS) / (accepted + declined + USUAL_ANSWERS)

    def possible(self, verb: Verb, at_m: tuple[float, float]) -> float:
        """The probability that a verb can be done at a place."""
        usually = self.usually(verb)
        accepted, declined = self._at.get(_square(verb, at_m), (0, 0))
        return (accepted + usually * PLACE_WEIGHT) / (accepted + declined + PLACE_WEIGHT)

    def asked_s(self, robot: str) -> float:
        """When a robot was last asked; 0 if never."""
        return self._of(robot).asked_s

    def may_be_asked(self, option: Option, vendor: str, now_s: float) -> bool:
        """Whether the robot has not declined or ignored it lately, and its vendor can do it."""
        record = self._of(option.robot)
        pause_s = min(PAUSE_S * 2**record.ignored, LONGEST_PAUSE_S) if record.ignored else 0.0
        declined_until_s = record.declined_until_s.get((option.verb, option.other), 0.0)
        is_rested = now_s >= max(record.asked_s + pause_s, record.busy_until_s, declined_until_s)
        return is_rested and self.can(vendor, option.verb)

    def can(self, vendor: str, verb: Verb) -> bool:
        """Whether a verb may be asked of the robots of a vendor."""
        able, unable = self._can.get((vendor, verb), ((), ()))
        return verb in self._verbs.get(vendor, (verb,)) and (bool(able) or len(unable) < UNABLE_AFTER)

    def waits_s(self) -> float:
        """How long a robot has time to answer, or to set out."""
        return ANSWERS_WITHIN_S if self._answers else BEGINS_WITHIN_S

    def ask(self, robot: str, now_s: float) -> None:
        record = self._of(robot)
        record.asked, record.ignored, record.asked_s = record.asked + 1, record.ignored + 1, now_s

    def follow(self, robot: str) -> None:
        record = self._of(robot)
        record.followed, record.ignored = record.followed + 1, 0

    def stop(self, request: Request, now_s: float) -> None:
        """A robot has begun, and stands again soon. Twice in a row is as good as declined."""
        record, key = self._of(request.robot), (request.verb, request.other or "")
        if record.stopped == key:
            record.declined_until_s[key] = now_s + DECLINED_S
        record.stopped = None if record.stopped == key else key

    def answer(self, asked: Asked, vendor: str, answer: str, why: str, now_s: float) -> None:
        """A robot has answered."""
        self._answers, request = True, asked.request
        able, unable = self._can.setdefault((vendor, request.verb), (set(), set()))
        record, reason = self._of(request.robot), reason_of(why)
        is_able = reason != CANNOT
        counts = (
            self._at.setdefault(_square(request.verb, asked.from_m), [0, 0]),
            self._anywhere.setdefault(request.verb, [0, 0]),
        )
        if answer == "declined":
            record.asked, record.ignored = record.asked - 1, 0
            until = {key: until_s for key, until_s in record.declined_until_s.items() if until_s > now_s}
            if reason == BUSY:
                record.busy_until_s, record.busy = now_s + min(BUSY_S * 2**record.busy, DECLINED_S), record.busy + 1
            else:
                until[request.verb, request.other or ""] = now_s + (DECLINED_S if is_able else CANNOT_S)
                record.busy = 0
            record.declined_until_s = until
            for count in counts:
                count[1] += is_able and reason != BUSY
            if not is_able and len(unable) < UNABLE_AFTER:
                unable.add(request.robot)
        elif answer == "accepted":
            if not able:
                able.add(request.robot)
            record.busy = 0
            for count in counts:
                count[0] += 1

    def forget(self, robots: Iterable[str]) -> None:
        """Robots have left."""
        for robot in robots:
            self._robots.pop(robot, None)

    def _of(self, robot: str) -> _OfRobot:
        return self._robots.setdefault(robot, _OfRobot())


def reason_of(why: str) -> str:
    """The reason of an answer, without what follows a colon."""
    return why.partition(":")[0].strip().lower()


def _square(verb: Verb, at_m: tuple[float, float]) -> tuple[Verb, int, int]:
    return verb, floor(at_m[0] / PLACE_M), floor(at_m[1] / PLACE_M)
