"""The drives of all robots in one table, so that one lookup finds all poses."""

import numpy as np

from deconflict.simulation.driving.routes import Drive
from ingest.batch import Floats, Ints


class DriveTable:
    """One drive for each robot, in padded arrays (n, longest)."""

    def __init__(self, robots: int) -> None:
        self._columns = np.zeros((5, robots, 64))
        """(5, n, longest) x, y, yaw, greatest speed, and seconds from the start at that speed."""
        self.step_m = np.ones(robots)
        self.last = np.zeros(robots, np.int64)
        """Index of each drive's last sample."""

    def set_drive(self, robot: int, drive: Drive) -> None:
        """Replace a robot's drive."""
        samples = len(drive.x_m)
        if samples > self._columns.shape[2]:
            longer = np.zeros((5, len(self.last), 2 * samples))
            longer[:, :, : self._columns.shape[2]] = self._columns
            self._columns = longer
        mean_mps = (drive.speed_mps[1:] + drive.speed_mps[:-1]) / 2
        seconds = np.concatenate([[0.0], np.cumsum(drive.step_m / mean_mps)])
        self._columns[:, robot, :samples] = drive.x_m, drive.y_m, drive.yaw_rad, drive.speed_mps, seconds
        self.step_m[robot], self.last[robot] = drive.step_m, samples - 1

    @property
    def length_m(self) -> Floats:
        return self.step_m * self.last

    def poses(self, robots: Ints, progress_m: Floats) -> Floats:
        """(3, ...) x, y, yaw of `robots` at `progress_m`, which broadcast together. Clamped to the ends of the
        drive."""
        return self._between(slice(0, 3), robots, progress_m)

    def speed_mps(self, robots: Ints, progress_m: Floats) -> Floats:
        """Greatest speed of progress at `progress_m`."""
        return self._between(slice(3, 4), robots, progress_m)[0]

    def seconds(self, robots: Ints, progress_m: Floats) -> Floats:
        """Seconds from the start of the drive to `progress_m`, without obstacles."""
        return self._between(slice(4, 5), robots, progress_m)[0]

    def slope(self, robots: Ints, progress_m: Floats) -> Floats:
        """(2, ...) metres moved and radians turned per metre of progress."""
        low = np.clip((progress_m / self.step_m[robots]).astype(np.int64), 0, np.maximum(self.last[robots] - 1, 0))
        change = (self._columns[:3, robots, low + 1] - self._columns[:3, robots, low]) / self.step_m[robots]
        return np.stack([np.hypot(change[0], change[1]), change[2]])

    def samples(self, robot: int) -> Floats:
        """(4, m) x, y, yaw and greatest speed of one robot's drive."""
        return self._columns[:4, robot, : self.last[robot] + 1]

    def _between(self, columns: slice, robots: Ints, progress_m: Floats) -> Floats:
        at = np.clip(progress_m / self.step_m[robots], 0.0, self.last[robots])
        low = np.minimum(at.astype(np.int64), np.maximum(self.last[robots] - 1, 0))
        share = at - low
        before, after = self._columns[columns, robots, low], self._columns[columns, robots, low + 1]
        return before + share * (after - before)
