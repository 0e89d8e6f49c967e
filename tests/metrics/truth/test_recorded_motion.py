"""Where robots were, against each report and the one before taken by hand."""

from math import ceil, floor, inf, nan, pi

import numpy as np

from deconflict.foresight.motion_assumptions import JOINED_S
from ingest.batch import Forecasts
from metrics.truth.recorded_motion import RecordedMotion

STEP_S, SAMPLES = 0.1, 50
Report = tuple[float, float, float, float, int, float, float, float, float]
"""When, x, y, yaw, floor, length, width, bottom and top."""


def reported(motion: RecordedMotion, reports: dict[str, Report]) -> None:
    columns = [np.array(column, float) for column in zip(*reports.values(), strict=True)]
    t_s, x_m, y_m, yaw_rad, on, *sizes_m = columns
    poses = (np.arange(len(t_s) + 1), t_s, x_m, y_m, yaw_rad, on.astype(np.int64))
    motion.report(list(reports), Forecasts(*poses, *sizes_m))


def by_hand(reports: list[Report], first: int) -> dict[int, list[float]]:
    """By sample of a stretch: x, y, yaw, floor, since when it is there, half length and half width, bottom and top."""
    there: dict[int, list[float]] = {}
    before, since_s = reports[0], reports[0][0]
    for after in reports:
        gap_s = after[0] - before[0]
        since_s = after[0] if gap_s > JOINED_S else since_s
        begin = before if gap_s <= JOINED_S and before[4] == after[4] else after
        (t0, x0, y0, yaw0, _, length_m, width_m, *heights_m), (t1, x1, y1, yaw1, on, *_) = begin, after
        low = floor(t0 / STEP_S) + 1 if t0 < t1 else ceil(t1 / STEP_S)
        for sample in range(max(low, first), min(floor(t1 / STEP_S), first + SAMPLES - 1) + 1):
            share = (sample * STEP_S - t0) / (t1 - t0) if t1 > t0 else 0.0
            pose = [x0 + share * (x1 - x0), y0 + share * (y1 - y0), yaw0 + share * ((yaw1 - yaw0 + pi) % (2 * pi) - pi)]
            there[sample] = [*pose, nan if on < 0 else on, since_s, length_m / 2, width_m / 2, *heights_m]
        before = after
    return there


def test_poses_are_interpolated_between_reports_unless_these_are_too_far_apart() -> None:
    rng, motion = np.random.default_rng(1), RecordedMotion()
    taken: dict[str, list[Report]] = {}
    first = 0
    for second in range(40):
        result: dict[str, Report] = {}
        for robot in ("a", "b", "c", "d"):
            if rng.random() < 0.6:
                t_s = second + float(rng.choice([-1.5, 0.0, 0.03, 0.5]))
                x_m, y_m, yaw_rad = rng.normal(scale=3.0, size=3).tolist()
                on, bottom_m = int(rng.choice([-1, 0, 1], p=[0.1, 0.7, 0.2])), float(rng.choice([-inf, 0.0, 5.0]))
                top_m = inf if bottom_m == -inf else bottom_m + 1
                result[robot] = (t_s, x_m, y_m, yaw_rad, on, 1.0, second, bottom_m, top_m)
                if robot not in taken or t_s > taken[robot][-1][0]:
                    taken.setdefault(robot, []).append(result[robot])
        if result:
            reported(motion, result)
        if (first + SAMPLES) * STEP_S < second - 3:
            stretch = motion.sampled(first, SAMPLES, STEP_S)
            expected = {robot: found for robot, of in taken.items() if (found := by_hand(of, first))}
            assert [motion.slots.uuids[row] for row in stretch.robot] == [
                name for name in motion.slots.uuids if name in expected
            ]
            columns = (
                stretch.x_m,
                stretch.y_m,
                stretch.yaw_rad,
                stretch.floor,
                stretch.since_s,
                *stretch.half_m,
                *stretch.height_m,
            )
            for row, robot in enumerate(stretch.robot.tolist()):
                of = expected[motion.slots.uuids[robot]]
                rows = [of.get(sample, [nan] * 9) for sample in range(first, first + SAMPLES)]
                np.testing.assert_allclose(np.array([column[row] for column in columns]).T, rows)
            first += SAMPLES
    assert first >= 6 * SAMPLES
    assert {robot: motion.last_seen_s(robot) for robot in taken} == {robot: of[-1][0] for robot, of in taken.items()}
    assert motion.newest_s == max(of[-1][0] for of in taken.values())
