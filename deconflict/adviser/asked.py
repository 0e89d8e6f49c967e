"""What is asked of one robot. Requests that were made: which robots follow them, and how long that takes."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from math import floor, nan
from typing import Annotated, NamedTuple

from pydantic import Field

from deconflict.runtime.learned_state import Form, Part, Seconds
from deconflict_client.verbs import Side
from deconflict_client.verbs import Verb as Verb  # noqa: PLC0414 - callers import it from here


@dataclass(frozen=True, slots=True)
class Request:
    """What is asked of one robot. Positions are in the site's frame, times are seconds since the epoch."""

    id: str
    robot: str
    """UUID of the robot that is asked."""
    verb: Verb
    at: tuple[float, float] | None
    """(x, y) in metres: the point of its way not to pass, or where to go."""
    other: str | None
    """UUID of the robot for which it is asked."""
    until: tuple[str, ...]
    """UUIDs of the robots that must have passed."""
    latest_s: float
    """When the request ends at the latest."""
    withdrawn: bool = False
    saving_s: float | None = None
    """Seconds that all robots are expected to save in the next minute."""
    saving_interval_s: tuple[float, float] | None = None
    """80 % interval of these seconds."""
    side: Side | None = None
    """On which side of the other it goes around it, seen along its own way; None if that is left to the robot."""
    beside: tuple[float, float] | None = None
    """The point beside the other on this side that it drives over."""


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
UNABLE_S = 7 * 86400.0
"""After this time it is asked again: the vendor's program may be another."""
OF_ABLE: frozenset[Verb] = frozenset(("step_aside",))
"""Verbs that few robots can do: asked only of vendors whose section of the site file has them, or of whose robots one
has accepted."""
CANNOT, BUSY = "cannot", "busy"
"""Reasons to decline: a vendor that never can, and a robot that cannot now. Any other is about the place."""
PLACE_M = 3.0
"""Side of the squares by which it is learned where a verb can be done."""
USUALLY_DONE, USUAL_ANSWERS, PLACE_WEIGHT = 0.8, 5, 1.0
"""How likely a verb can be done that was never asked, and how many answers that counts for; the third for how many
answers at a place the share on all floors counts."""
MOST_PLACES, MOST_ROBOTS = 5000, 1000
"""Squares of verbs that are known, the least recently answered are dropped; and robots that are kept over a restart."""
MOST_REQUESTS, MOST_ANSWERS = 20, 100
"""Requests of a robot, and answers to a verb, that count. With more both counts are halved: who changes is believed."""
_Square = Annotated[int, Field(ge=-(10**9), le=10**9)]
_Faded = Annotated[float, Field(ge=0.0, le=MOST_ANSWERS)]
_Answers = tuple[_Faded, _Faded]
FORM = Form(
    "by vendor and verb a robot that accepted it and when robots could not do it; requests accepted and declined by "
    f"verb and square of {PLACE_M:g} m, and by verb; requests that each robot was asked and followed",
    {
        "can": list[tuple[str, Verb, list[str], dict[str, Seconds]]],
        "places": list[tuple[Verb, _Square, _Square, _Answers]],
        "anywhere": dict[Verb, _Answers],
        "has_answered": bool,
        "robots": dict[str, tuple[_Faded, _Faded]],
    },
)


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
    other_from_m: tuple[float, float] = (nan, nan)
    """Where the other robot was when it was asked."""
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
    asked: float = 0.0
    followed: float = 0.0
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
        """`verbs` may be asked of the robots of a vendor; of robots of other vendors all but those `OF_ABLE`."""
        self._verbs = verbs
        self._robots: dict[str, _OfRobot] = {}
        self._can: dict[tuple[str, Verb], tuple[set[str], dict[str, float]]] = {}
        """By vendor and verb: a robot that has accepted it, and when the first that cannot do it were asked."""
        self._at: dict[tuple[Verb, int, int], list[float]] = {}
        """By verb and square: how many requests were accepted, and how many declined. The newest answer is last."""
        self._anywhere: dict[Verb, list[float]] = {}
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
        return is_rested and self.can(vendor, option.verb, now_s)

    def can(self, vendor: str, verb: Verb, now_s: float) -> bool:
        """Whether a verb may be asked of the robots of a vendor."""
        able, unable = self._can.get((vendor, verb), ((), {}))
        if vendor not in self._verbs and verb in OF_ABLE and not able:
            return False
        return verb in self._verbs.get(vendor, (verb,)) and (bool(able) or len(_lately(unable, now_s)) < UNABLE_AFTER)

    def waits_s(self) -> float:
        """How long a robot has time to answer, or to set out."""
        return ANSWERS_WITHIN_S if self._answers else BEGINS_WITHIN_S

    def ask(self, robot: str, now_s: float) -> None:
        record = self._of(robot)
        record.ignored, record.asked_s = record.ignored + 1, now_s
        if record.asked + 1 > MOST_REQUESTS:
            record.asked, record.followed = record.asked / 2, record.followed / 2
        record.asked += 1

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
        able, unable = self._can.get((vendor, request.verb), (set(), {}))
        self._can[vendor, request.verb] = able, (unable := _lately(unable, now_s))
        record, reason = self._of(request.robot), reason_of(why)
        is_able = reason != CANNOT
        is_about_place = answer == "accepted" or (answer == "declined" and is_able and reason != BUSY)
        if is_about_place:
            self._count(request.verb, asked.from_m, is_accepted=answer == "accepted")
        if answer == "declined":
            record.asked, record.ignored = record.asked - 1, 0
            until = {key: until_s for key, until_s in record.declined_until_s.items() if until_s > now_s}
            if reason == BUSY:
                record.busy_until_s, record.busy = now_s + min(BUSY_S * 2**record.busy, DECLINED_S), record.busy + 1
            else:
                until[request.verb, request.other or ""] = now_s + (DECLINED_S if is_able else CANNOT_S)
                record.busy = 0
            record.declined_until_s = until
            if not is_able and len(unable) < UNABLE_AFTER:
                unable[request.robot] = now_s
        elif answer == "accepted":
            if not able:
                able.add(request.robot)
            record.busy = 0

    def _count(self, verb: Verb, at_m: tuple[float, float], *, is_accepted: bool) -> None:
        """Count an answer at its square and anywhere."""
        square = _square(verb, at_m)
        self._at[square] = self._at.pop(square, [0.0, 0.0])
        if len(self._at) > MOST_PLACES:
            del self._at[next(iter(self._at))]
        for counts in (self._at[square], self._anywhere.setdefault(verb, [0.0, 0.0])):
            if sum(counts) + 1 > MOST_ANSWERS:
                counts[:] = (count / 2 for count in counts)
            counts[not is_accepted] += 1

    def forget(self, robots: Iterable[str]) -> None:
        """Robots have left."""
        for robot in robots:
            self._robots.pop(robot, None)

    def learned(self) -> Part:
        """What is kept over a restart.

        Not kept is until when a robot is asked nothing. A newest request that was not followed does not count, as it
        may be open.
        """
        asked = {uuid: record.asked - (record.ignored > 0) for uuid, record in self._robots.items()}
        newest = sorted(self._robots.items(), key=lambda item: item[1].asked_s)[-MOST_ROBOTS:]
        return FORM.part(
            {
                "can": [[*key, sorted(able), dict(unable)] for key, (able, unable) in self._can.items()],
                "places": [[*square, list(counts)] for square, counts in self._at.items()],
                "anywhere": {verb: list(counts) for verb, counts in self._anywhere.items()},
                "has_answered": self._answers,
                "robots": {
                    uuid: [asked[uuid], min(record.followed, asked[uuid])] for uuid, record in newest if asked[uuid] > 0
                },
            }
        )

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave. Raises `UnreadableError`."""
        state = FORM.checked(part)
        self._can = {(vendor, verb): (set(able), unable) for vendor, verb, able, unable in state["can"]}
        self._at = {(verb, x, y): list(counts) for verb, x, y, counts in state["places"][-MOST_PLACES:]}
        self._anywhere = {verb: list(counts) for verb, counts in state["anywhere"].items()}
        self._answers = state["has_answered"]
        self._robots = {uuid: _OfRobot(asked, followed) for uuid, (asked, followed) in state["robots"].items()}

    def _of(self, robot: str) -> _OfRobot:
        return self._robots.setdefault(robot, _OfRobot())


def reason_of(why: str) -> str:
    """The reason of an answer, without what follows a colon."""
    return why.partition(":")[0].strip().lower()


def _lately(unable: Mapping[str, float], now_s: float) -> dict[str, float]:
    """Without robots that could not do it so long ago that it is asked again. A clock may have gone back."""
    return {robot: at_s for robot, at_s in unable.items() if abs(now_s - at_s) < UNABLE_S}


def _square(verb: Verb, at_m: tuple[float, float]) -> tuple[Verb, int, int]:
    return verb, floor(at_m[0] / PLACE_M), floor(at_m[1] / PLACE_M)
