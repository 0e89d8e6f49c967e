"""Robots on given ways, as the protective fields see them."""

import numpy as np

from deconflict.simulation.driving.drive_table import DriveTable
from deconflict.simulation.driving.protection import Traffic
from deconflict.simulation.driving.routes import drive
from deconflict.simulation.floor_layout import Place
from deconflict.simulation.participants import ALDER

Way = tuple[Place, Place]


def traffic(ways: list[Way], progress_m: list[float], speed_mps: list[float], fleet: list[int]) -> Traffic:
    """Robots on straight ways, the first of highest rank."""
    make = ALDER
    tracks = DriveTable(len(ways))
    for row, (start, end) in enumerate(ways):
        yaw = float(np.arctan2(end[1] - start[1], end[0] - start[0]))
        tracks.set_drive(row, drive([start, end], yaw, make))
    n = len(ways)
    return Traffic(
        tracks=tracks,
        progress_m=np.array(progress_m),
        speed_mps=np.array(speed_mps),
        brake_mps2=np.full(n, make.brake_mps2),
        backing=np.zeros(n, np.bool_),
        going=np.ones(n, np.bool_),
        aside_m=np.zeros(n),
        floor=np.zeros(n, np.int64),
        length_m=np.full(n, make.body.length_m),
        width_m=np.full(n, make.body.width_m),
        ahead_m=np.zeros(n),
        fleet=np.array(fleet),
        person=np.zeros(n, np.bool_),
        rank=np.arange(n),
        first=np.zeros(n, np.bool_),
    )
