"""A loss: the time that one robot loses because another one is in its way."""

from enum import StrEnum
from math import pi
from typing import NamedTuple

from ingest.batch import Ints
from ingest.frames.angles import turn_between

FOLLOWS_RAD, MEETS_RAD = pi / 4, 3 * pi / 4
"""Robots whose headings differ by less go the same way; if they differ by more than the second, they meet head-on."""
LONGEST_CHAIN = 50
NOBODY = -1


class LossKind(StrEnum):
    """How the other robot is in the way."""

    CROSSING = "crossing"
    HEAD_ON = "head_on"
    FOLLOWING = "following"
    """It drives ahead, in the same direction."""
    QUEUE = "queue"
    """It loses time to a third robot itself."""
    BLOCKAGE = "blockage"
    """It stands for no robot."""
    DEADLOCK = "deadlock"
    """It waits for the losing robot, itself or through others."""


class Loss(NamedTuple):
    """One robot has lost time to another one. Times are seconds since the epoch."""

    robot: str
    """UUID of the robot that lost time."""
    by: str
    """UUID of the robot in its way."""
    root: str
    """UUID of the robot at the head of the queue; the same as `by` if that one waits for nobody."""
    vendor: str
    model: str
    """Of the losing robot; "" if it has named none."""
    by_vendor: str
    root_vendor: str
    kind: LossKind
    from_s: float
    until_s: float
    lost_s: float
    """Against its plan."""
    over_usual_s: float
    """Against the usual time of its model on this way; against its plan where that is not known."""
    is_sure: bool
    """The other robot was on its way. If not, it only crossed the way."""
    floor: int
    """Index of the floor."""
    x_m: float
    """Place of the losing robot when it began to lose time, in the floor's frame."""
    y_m: float


class LossNotice(NamedTuple):
    """What the service had published when a loss began."""

    is_warned: bool = False
    """An advisory named both robots."""
    is_advised: bool = False
    """It advised one of them to wait, or one did what it was asked for the other."""
    is_heeded: bool = False
    """That robot did as advised."""


def kind_of(turn_rad: float, *, stands: bool, waits: bool, for_each_other: bool) -> LossKind:
    """The kind of a loss, by the angle from the heading of the losing robot to that of the other, and by whether the
    other one stands, and loses time itself."""
    if for_each_other:
        return LossKind.DEADLOCK
    if waits:
        return LossKind.QUEUE
    if stands:
        return LossKind.BLOCKAGE
    turn_rad = abs(turn_between(0.0, turn_rad))
    if turn_rad < FOLLOWS_RAD:
        return LossKind.FOLLOWING
    return LossKind.HEAD_ON if turn_rad > MEETS_RAD else LossKind.CROSSING


def root_of(blocker_of: Ints, slot: int) -> tuple[int, bool]:
    """The slot at the head of the chain of robots that begins with a losing robot, and whether the chain leads back to
    it. `blocker_of` (slots,) is the slot of the robot in the way of each, or `NOBODY`."""
    root = int(blocker_of[slot])
    for _ in range(LONGEST_CHAIN):
        following = int(blocker_of[root])
        if following == slot:
            return root, True
        if following == NOBODY:
            return root, False
        root = following
    return root, False
