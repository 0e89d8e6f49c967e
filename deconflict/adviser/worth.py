"""What advice is worth: the seconds that all robots lose without it, less those with it."""

from dataclasses import dataclass, field
from typing import NamedTuple

from deconflict.adviser.asked import Verb
from deconflict.runtime.learned_state import Count, Form, Part, Seconds

STANDS_ON_S = {"ring": 12.0, "stander": 8.0, "crossing": 30.0}
"""How much longer robots stand without advice, before any were seen."""
TAKES_S: dict[Verb, float] = {
    "go_around": 8.0,
    "go_first": 4.0,
    "wait_before": 4.0,
    "step_aside": 15.0,
    "back_out": 20.0,
    "other_way": 25.0,
}
"""How long a robot needs for what it is asked, before any were seen. Those that it lets through wait half of that."""
ASKING_S = 2.0
"""What asking in vain takes."""
LOOKED_AHEAD_S = 60.0
"""What robots lose later than this is not counted."""
WEIGHT = 5
"""How many observations the values above count for."""
UNFAIR_SHARE, FAIR_AFTER_S = 0.55, 60.0
"""A vendor that has yielded more than this share of the seconds between two vendors is asked last."""
YIELDED_HALF_LIFE_S = 8 * 3600.0
"""Half of what a vendor has yielded is forgotten after a shift."""
LEAST_YIELDED_S = 0.01
"""What has faded to less is dropped."""
LEFT_SHARE, LEFT_INTERVAL = 0.17, (-0.13, 1.05)
"""What is left of a saving after a minute, and its 80 % interval: robots that are let go soon stand elsewhere. By
copies of simulated floors that were driven with and without a request (`benchmarks.closed_loop.cells.proof`)."""
FORM = Form(
    "seconds and ends of standing by kind, and of doing by verb; yielded seconds by vendor that yielded and the one "
    f"that was let through, of which half is forgotten in {YIELDED_HALF_LIFE_S:g} s, as of a time",
    {
        "stands_on": dict[str, tuple[Seconds, Count]],
        "takes": dict[Verb, tuple[Seconds, Count]],
        "yielded_s": list[tuple[str, str, Seconds]],
        "yielded_as_of_s": Seconds,
    },
)


class ExpectedSaving(NamedTuple):
    """Seconds that all robots save in the next minute."""

    mean_s: float
    interval_s: tuple[float, float]
    """Of 80 %."""


@dataclass(slots=True)
class Mean:
    """A mean of times that begins with an assumption."""

    assumed_s: float
    seconds: float = 0.0
    ends: int = 0

    @property
    def value_s(self) -> float:
        return (self.seconds + self.assumed_s * WEIGHT) / (self.ends + WEIGHT)


@dataclass(slots=True)
class Worth:
    """What was learned from standoffs that nobody ended, and from requests that were followed."""

    stands_on: dict[str, Mean] = field(default_factory=lambda: {kind: Mean(s) for kind, s in STANDS_ON_S.items()})
    takes: dict[Verb, Mean] = field(default_factory=lambda: {verb: Mean(s) for verb, s in TAKES_S.items()})
    _standing: dict[str, dict[frozenset[str], float]] = field(default_factory=dict)
    """By kind: the robots that stood for each other at the last look, and when that was."""
    yielded_s: dict[tuple[str, str], float] = field(default_factory=dict)
    """By the vendor that yielded and the vendor that it let through, faded to the time of `_yielded_as_of_s`."""
    _yielded_as_of_s: float = 0.0

    def saving(self, kind: str, verb: Verb, works: float, stood_s: float, behind: tuple[int, int]) -> ExpectedSaving:
        """What a request saves that is followed with the probability `works`; if it is not, another is asked later.

        `behind` is how many robots stand behind the robot, and behind the other. Robots that have stood for `stood_s`
        stand about as long again.
        Robots behind either of the two lose as much as it does. Of robots that stand for each other one has to go
        around in the end, also without advice; a robot that stands only in the way moves on at no cost.
        """
        stand = 2 + sum(behind)
        stands_on_s = min(max(self.stands_on[kind].value_s, stood_s), LOOKED_AHEAD_S)
        takes_s = self.takes[verb].value_s
        if kind != "stander":
            takes_s -= min(takes_s, self.takes["go_around"].value_s)
        followed_s = stands_on_s * stand - takes_s * (1 + behind[0]) - takes_s / 2 * (1 + behind[1])
        here_s = works * followed_s - (1 - works) * ASKING_S * stand
        low, high = (share * here_s for share in LEFT_INTERVAL)
        return ExpectedSaving(LEFT_SHARE * here_s, (min(low, high), max(low, high)))

    def yields_too_much(self, vendor: str, other: str, now_s: float) -> bool:
        """Whether a vendor has yielded more than its share to another."""
        self._fade(now_s)
        own_s, others_s = self.yielded_s.get((vendor, other), 0.0), self.yielded_s.get((other, vendor), 0.0)
        return own_s + others_s > FAIR_AFTER_S and own_s > UNFAIR_SHARE * (own_s + others_s)

    def add_yield(self, verb: Verb, vendor: str, other: str, seconds: float, now_s: float) -> None:
        """A robot has done what it was asked for."""
        self._fade(now_s)
        mean = self.takes[verb]
        mean.seconds, mean.ends = mean.seconds + seconds, mean.ends + 1
        self.yielded_s[vendor, other] = self.yielded_s.get((vendor, other), 0.0) + seconds

    def observe(self, kind: str, groups: set[frozenset[str]], followed: set[str], now_s: float) -> None:
        """Robots stand for each other at `now_s`. What `followed` advice ended says nothing of standing without."""
        mean, before = self.stands_on[kind], self._standing.get(kind, {})
        alone = {group for group in groups if not group & followed}
        self._standing[kind] = dict.fromkeys(alone, now_s)
        for group, since_s in before.items():
            mean.seconds += max(now_s - since_s, 0.0)
            mean.ends += group not in groups and not group & followed

    def learned(self) -> Part:
        """What is kept over a restart; not who stands now."""
        return FORM.part(
            {
                "stands_on": {kind: [mean.seconds, mean.ends] for kind, mean in self.stands_on.items()},
                "takes": {verb: [mean.seconds, mean.ends] for verb, mean in self.takes.items()},
                "yielded_s": [[*vendors, seconds] for vendors, seconds in self.yielded_s.items()],
                "yielded_as_of_s": self._yielded_as_of_s,
            }
        )

    def resume(self, part: Part) -> None:
        """Continue from what `learned` gave. Raises `UnreadableError`."""
        state = FORM.checked(part)
        for means, kept in ((self.stands_on, state["stands_on"]), (self.takes, state["takes"])):
            for name in kept.keys() & means.keys():
                means[name].seconds, means[name].ends = kept[name]
        self.yielded_s = {(vendor, other): seconds for vendor, other, seconds in state["yielded_s"]}
        self._yielded_as_of_s = state["yielded_as_of_s"]

    def _fade(self, now_s: float) -> None:
        """A clock that went back fades nothing."""
        left = 0.5 ** (max(now_s - self._yielded_as_of_s, 0.0) / YIELDED_HALF_LIFE_S)
        faded = {vendors: seconds * left for vendors, seconds in self.yielded_s.items()}
        self.yielded_s = {vendors: seconds for vendors, seconds in faded.items() if seconds >= LEAST_YIELDED_S}
        self._yielded_as_of_s = now_s
