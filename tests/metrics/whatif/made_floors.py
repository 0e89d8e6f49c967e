"""Recorded floors that were never driven: robots on given ways."""

import numpy as np

from deconflict.foresight.losses.loss import Loss, LossKind
from deconflict.simulation.floor_layout import Place
from metrics.whatif.recorded_tracks import RecordedFloor, RobotTrack

SPEED_MPS = 1.0
Leg = tuple[Place, float]
"""A place, and how long the robot stays there, in seconds."""


def track(name: str, legs: list[Leg], vendor: str = "Alder", *, is_person: bool = False) -> RobotTrack:
    """A robot that drives from place to place and stays at each for so many seconds. It reports once a second."""
    x, y = [legs[0][0][0]] * (round(legs[0][1]) + 1), [legs[0][0][1]] * (round(legs[0][1]) + 1)
    for (place, stay_s), (before, _) in zip(legs[1:], legs, strict=False):
        steps = max(round(float(np.hypot(place[0] - before[0], place[1] - before[1])) / SPEED_MPS), 1)
        x += [*np.linspace(before[0], place[0], steps + 1)[1:].tolist(), *[place[0]] * round(stay_s)]
        y += [*np.linspace(before[1], place[1], steps + 1)[1:].tolist(), *[place[1]] * round(stay_s)]
    yaw_rad = np.arctan2(np.gradient(np.array(y)), np.gradient(np.array(x)))
    return RobotTrack(
        uuid=name,
        name=name,
        vendor=vendor,
        model="",
        is_person=False,
        length_m=1.0,
        width_m=0.7,
        t_s=np.arange(float(len(x))),
        x_m=np.array(x),
        y_m=np.array(y),
        yaw_rad=yaw_rad,
        floor=np.zeros(len(x), np.int64),
    )


def recorded(*tracks: RobotTrack) -> RecordedFloor:
    """A log of these robots that lost nothing."""
    return RecordedFloor(list(tracks), [], ("hall",), max(float(found.t_s[-1]) for found in tracks))


def met(kind: LossKind, x_m: float, length_s: float, from_s: float = 10.0) -> Loss:
    """A robot has stood for another one."""
    return Loss(
        "A", "B", "B", "Alder", "", "Birch", "Birch", kind, from_s, from_s + length_s, 9.0, 9.0, True, 0, x_m, 0.0
    )
