"""What advice is worth: the seconds that all robots lose without it, less those with it."""

from dataclasses import dataclass, field

from deconflict.adviser.request import Verb

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
WEIGHT = 5
"""How many observations the values above count for."""
UNFAIR_SHARE, FAIR_AFTER_S = 0.55, 60.0
"""A vendor that has yielded more than this share of the seconds between two vendors is asked last."""


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
    yielded_s: dict[tuple[str, str], float] = field(default_factory=dict)
    """By the vendor that yielded and the vendor that it let through."""

    def saving_s(self, kind: str, verb: Verb, behind: int, behind_other: int) -> float:
        """What one request saves if it is followed. Robots behind either of the two lose as much as it does."""
        without_s = self.stands_on[kind].value_s * (2 + behind + behind_other)
        takes_s = self.takes[verb].value_s
        return without_s - takes_s * (1 + behind) - takes_s / 2 * (1 + behind_other)

    def yields_too_much(self, vendor: str, other: str) -> bool:
        """Whether a vendor has yielded more than its share to another."""
        own_s, others_s = self.yielded_s.get((vendor, other), 0.0), self.yielded_s.get((other, vendor), 0.0)
        return own_s + others_s > FAIR_AFTER_S and own_s > UNFAIR_SHARE * (own_s + others_s)

    def add_yield(self, verb: Verb, vendor: str, other: str, seconds: float) -> None:
        """A robot has done what it was asked for."""
        mean = self.takes[verb]
        mean.seconds, mean.ends = mean.seconds + seconds, mean.ends + 1
        self.yielded_s[vendor, other] = self.yielded_s.get((vendor, other), 0.0) + seconds

    def add_standing(self, kind: str, seconds: float, ended: int) -> None:
        """Robots stood for each other without advice that was followed; `ended` standoffs ended by themselves."""
        mean = self.stands_on[kind]
        mean.seconds, mean.ends = mean.seconds + seconds, mean.ends + ended
