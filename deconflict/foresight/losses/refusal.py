"""A refusal: a robot was asked to end a standoff, and did not. It costs what others go on standing."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from deconflict.foresight.losses.loss import LossKind

LONGEST_S = 60.0
"""What others stand later is not because of a refusal."""


class HeldUp(NamedTuple):
    """A robot that stood for the one that refused, when that refused."""

    robot: str
    """UUID."""
    vendor: str
    kind: LossKind
    datum: str
    """Id of its floor."""
    x_m: float
    """Where it stood, in the floor's frame."""
    y_m: float
    stood_s: float = 0.0
    """How long it went on standing because of the refusal."""
    model: str = ""
    place: str = ""
    """Name of the smallest zone, resource or area; "" outside all."""


@dataclass(frozen=True, slots=True)
class AdviceRefusal:
    """Times are seconds since the epoch."""

    robot: str
    """UUID of the robot that refused."""
    vendor: str
    is_unable: bool
    """Its vendor said that it cannot."""
    since_s: float
    looked_s: float
    """Until when it is counted how long others stood."""
    others: tuple[HeldUp, ...]
    """First the robot for which it was asked, which need not stand."""


def stood_on(
    refusal: AdviceRefusal, standing: Collection[str], begun_s: Mapping[str, float], now_s: float
) -> tuple[AdviceRefusal, bool]:
    """A refusal at a later look, and whether it is over.

    `standing` are the robots that stand for the one that refused, itself or through others. `begun_s` is since when
    robots do what they were asked.
    """
    more_s = max(min(now_s, refusal.since_s + LONGEST_S) - refusal.looked_s, 0.0)
    others = tuple(
        other._replace(stood_s=other.stood_s + more_s) if other.robot in standing else other for other in refusal.others
    )
    robots = {refusal.robot, *(other.robot for other in others)}
    is_followed = any(begun_s[robot] >= refusal.since_s for robot in robots & begun_s.keys())
    is_over = is_followed or robots.isdisjoint(standing) or now_s >= refusal.since_s + LONGEST_S
    return replace(refusal, others=others, looked_s=max(now_s, refusal.looked_s)), is_over
