"""Other engines on the same floors, if they are installed: `pip install .[peers]`.

None of them answers exactly the same question. Each is used as its documentation says, with shapes as close to the
robots as it allows. Its answers are compared with the oracle pair by pair.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from time import process_time
from types import SimpleNamespace
from typing import Any

import numpy as np

from benchmarks.floors import World
from ingest.batch import Floats

HORIZON_S = 10.0
STEP_S = 0.1
PairList = Sequence[tuple[int, int]]


@dataclass(frozen=True)
class Peer:
    """Another engine: its pass over a whole floor, and its answer for single pairs."""

    name: str
    module: str
    how: str
    look: Callable[[World], float] | None
    """Runs one pass over a floor. Returns milliseconds of one core. None if it has no such pass."""
    touches: Callable[[World, PairList], Iterator[bool]]
    """Whether each pair touches within the horizon."""

    @property
    def installed(self) -> bool:
        return find_spec(self.module) is not None


def _milliseconds(call: Callable[[], object]) -> float:
    begin = process_time()
    call()
    return 1e3 * (process_time() - begin)


def _hulls(world: World, rows: Sequence[int], step_s: float = 1.0) -> list[Any]:
    """Each robot as a chain of boxes. Each box encloses its poses at both ends of a step."""
    from commonroad_dc import pycrcc  # noqa: PLC0415
    from commonroad_dc.collision.trajectory_queries import trajectory_queries  # noqa: PLC0415

    x, y, yaw = world.forecast_poses(np.arange(0.0, HORIZON_S + step_s / 2, step_s))
    made = []
    for row in rows:
        chain = pycrcc.TimeVariantCollisionObject(0)
        half = float(world.length[row]) / 2, float(world.width[row]) / 2
        for pose in zip(yaw[row].tolist(), x[row].tolist(), y[row].tolist(), strict=True):
            chain.append_obstacle(pycrcc.RectOBB(*half, *pose))
        hull, failed = trajectory_queries.trajectory_preprocess_obb_sum(chain)
        if failed:
            raise RuntimeError("commonroad-drivability-checker could not build a hull")
        made.append(hull)
    return made


def _commonroad_pass(world: World) -> float:
    """Check each robot against all others for its first collision.

    The batch check compares trajectories with obstacles. A robot must not be both, or it collides with itself. So for
    each digit of the robots' binary numbers, the robots are split in two halves that are checked against each other:
    any two robots differ in some digit. The hulls are built before, and the fastest of its three methods is used; both
    favour the other engine.
    """
    from commonroad_dc.collision.trajectory_queries import trajectory_queries  # noqa: PLC0415

    hulls = _hulls(world, range(len(world.x)))
    halves = [
        [[hull for row, hull in enumerate(hulls) if row >> digit & 1 == side] for side in (0, 1)]
        for digit in range((len(hulls) - 1).bit_length())
    ]

    def batches() -> None:
        for clear, set_ in halves:
            for trajectories, obstacles in ((clear, set_), (set_, clear)):
                trajectory_queries.trajectories_collision_dynamic_obstacles(trajectories, obstacles, method="grid")

    return _milliseconds(batches)


def _commonroad_pairs(world: World, pairs: PairList) -> Iterator[bool]:
    hulls = dict(zip(*_of_pairs(world, pairs), strict=True))
    yield from (bool(hulls[a].collide(hulls[b])) for a, b in pairs)


def _of_pairs(world: World, pairs: PairList) -> tuple[list[int], list[Any]]:
    rows = sorted({row for pair in pairs for row in pair})
    return rows, _hulls(world, rows)


def _traffic(world: World, rows: Sequence[int]) -> tuple[SimpleNamespace, Floats]:
    """The robots as BlueSky's aircraft, and the diameter of each. For a pair it uses the larger one as the distance."""
    metres = 180 / np.pi / 6371000.0
    index = np.asarray(rows)
    zeros = np.zeros(len(index))
    craft = SimpleNamespace(
        ntraf=len(index),
        id=[str(row) for row in rows],
        lat=world.y[index] * metres,
        lon=world.x[index] * metres,
        trk=90.0 - np.degrees(world.yaw[index]),
        gs=world.speed[index].copy(),
        alt=zeros,
        vs=zeros.copy(),
    )
    return craft, np.hypot(world.length[index], world.width[index])


def _bluesky(world: World, rows: Sequence[int]) -> list[tuple[str, str]]:
    from bluesky.traffic.asas import cstatebased  # noqa: PLC0415

    craft, apart = _traffic(world, rows)
    ahead = np.full(len(rows), HORIZON_S)
    return cstatebased.detect(craft, craft, apart, np.full(len(rows), 10.0), ahead)[0]


def _bluesky_pass(world: World) -> float:
    from bluesky.traffic.asas import cstatebased  # noqa: PLC0415

    craft, apart = _traffic(world, range(len(world.x)))
    ahead, high = np.full(craft.ntraf, HORIZON_S), np.full(craft.ntraf, 10.0)
    return _milliseconds(lambda: cstatebased.detect(craft, craft, apart, high, ahead))


def _bluesky_pairs(world: World, pairs: PairList) -> Iterator[bool]:
    found = {(int(a), int(b)) for a, b in _bluesky(world, range(len(world.x)))}
    yield from ((a, b) in found or (b, a) in found for a, b in pairs)


def _coal_pairs(world: World, pairs: PairList) -> Iterator[bool]:
    """Its Python interface has no continuous check, so poses are checked one after another."""
    import coal  # noqa: PLC0415

    x, y, yaw = world.forecast_poses(np.arange(0.0, HORIZON_S + STEP_S / 2, STEP_S))
    boxes = {row: coal.Box(float(world.length[row]), float(world.width[row]), 1.0) for pair in pairs for row in pair}
    request = coal.CollisionRequest()

    def placed(row: int, step: int) -> Any:
        c, s = float(np.cos(yaw[row, step])), float(np.sin(yaw[row, step]))
        turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return coal.Transform3s(turned, np.array([x[row, step], y[row, step], 0.0]))

    for a, b in pairs:
        yield any(
            coal.collide(boxes[a], placed(a, step), boxes[b], placed(b, step), request, coal.CollisionResult())
            for step in range(x.shape[1])
        )


PEERS = (
    Peer(
        "commonroad-drivability-checker",
        "commonroad_dc",
        "boxes around 1 s of motion, robots rather than pairs",
        _commonroad_pass,
        _commonroad_pairs,
    ),
    Peer("bluesky-simulator", "bluesky", "compiled, straight lines and circles", _bluesky_pass, _bluesky_pairs),
    Peer("coal", "coal", f"box against box every {STEP_S} s, pairs only", None, _coal_pairs),
)
