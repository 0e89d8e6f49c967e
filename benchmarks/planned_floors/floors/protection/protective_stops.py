"""The protective stops of the robots of a floor: how each robot reacts to bodies in its field.

Three kinds: `stop` brakes, `slow` slows down in a wider field before it brakes, `swerve` leaves its way sideways where
there is room. One that has stood for another for long drives around it at walking pace, where bodies may overlap.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.planned_floors.floors.driving.driving import ACCELERATION_MPS2, SIDEWAYS_MPS
from benchmarks.planned_floors.floors.protection.fields import FIELD, NOBODY, Fields, obstructors, occupied
from benchmarks.planned_floors.floors.protection.scene import HALF_M, Scene
from benchmarks.planned_floors.floors.protection.stop_notes import StopNote
from benchmarks.planned_floors.floors.protection.swerving import has_passed, next_aside_m, room_aside_m
from benchmarks.planned_floors.truth.motion import STEP_S, Bools
from ingest.batch import Floats, Ints

TURNING_M = float(np.hypot(*HALF_M)) + 0.02
"""A turning robot needs this radius free around its centre."""
MARGIN_M, BESIDE_M = 0.45, 0.05
"""How much longer than the robot, and wider on each side, its field is."""
WIDER_M, WIDER_BESIDE_M = 1.5, 0.15
"""The same for the field in which a robot slows down."""
SWERVING_M = 2.0
"""Additional distance ahead in which a robot looks for others to swerve around."""
SLOW_MPS, SWERVING_MPS, AROUND_MPS = 0.5, 0.7, 0.5
LONGEST_PASSING_S = 20.0
HELD_S = 1.0
"""A field must be free for this long before a robot continues."""
RELEASE_M = 0.1
"""Additional length of the field of a yielding robot, so that it does not alternately start and brake."""
ON_ITS_WAY_M = 0.05


@dataclass(slots=True, eq=False)
class Passing:
    """A robot that passes another: it swerves or drives around it."""

    note: StopNote
    others: set[int]
    """The robots that it passes. A robot that drives around them ignores their bodies."""
    aside_m: float
    """Planned offset to the left of its path."""
    until_s: float
    """When it gives up."""


class Held:
    """The robots that were recently in each robot's field. A robot keeps reacting for `HELD_S`."""

    def __init__(self, robots: int) -> None:
        self._by: Ints = np.full(robots, NOBODY)
        self._until_s: Floats = np.zeros(robots)

    def hold(self, by: Ints, now_s: float) -> Ints:
        """(n,) the robot to which each reacts. Updates from those whose bodies are in its field now."""
        hit = by != NOBODY
        self._by[hit], self._until_s[hit] = by[hit], now_s + HELD_S
        return np.where(self._until_s >= now_s, self._by, NOBODY)

    def let_go(self, robot: int) -> None:
        self._until_s[robot] = -np.inf


class Protection:
    """The reactions of n robots to each other, and the stops that they have made."""

    def __init__(self, kinds: list[str], top_mps: Floats, patience_s: Floats, around_aside_m: float) -> None:
        n = len(kinds)
        self.notes: list[StopNote] = []
        self.stopped: list[StopNote | None] = [None] * n
        """By robot: its present stop."""
        self._kinds, self._top_mps, self._patience_s = kinds, top_mps, patience_s
        self._around_aside_m = around_aside_m
        self._swerving: dict[int, Passing] = {}
        self._around: dict[int, Passing] = {}
        self._ignored: Bools = np.zeros((n, n), bool)
        self._wider: Floats = np.array([WIDER_M if kind == "slow" else SWERVING_M for kind in kinds])
        self._wider_beside: Floats = np.array([WIDER_BESIDE_M if kind == "slow" else BESIDE_M for kind in kinds])
        self._looks_wider = any(kind != "stop" for kind in kinds)
        self._inner, self._outer = Held(n), Held(n)

    def react(self, scene: Scene) -> Floats:
        """(n,) speed limit of each robot. Writes its sideways offset into `scene.driving`."""
        known: Ints = np.array([note.by if note else NOBODY for note in self.stopped])
        inner = self._obstructors(scene, MARGIN_M, BESIDE_M, known)
        wider = (
            self._obstructors(scene, MARGIN_M + self._wider, self._wider_beside, known) if self._looks_wider else inner
        )
        top_mps = self._top_mps.copy()
        inner, wider = self._inner.hold(inner, scene.now_s), self._outer.hold(wider, scene.now_s)
        for robot in np.flatnonzero(scene.present).tolist():
            top_mps[robot] = self._allowed(scene, robot, int(inner[robot]), int(wider[robot]))
        return top_mps

    def withdraw(self, robot: int, now_s: float) -> None:
        """End the reactions of a robot that is carried away."""
        for passing in (self._swerving.pop(robot, None), self._around.pop(robot, None)):
            if passing:
                passing.note.around_until_s = max(passing.note.around_until_s, now_s)
        self._ignored[robot] = False
        self._let_go(robot)
        self._end(robot, now_s, 0.0)

    def set_out_around(self, scene: Scene, robot: int, other: int) -> None:
        """Drive around another robot now, because it is asked to."""
        note = self.stopped[robot]
        if note is None:
            note = StopNote(robot, other, scene.now_s, float(scene.driving["speed_mps"][robot]), self._kinds[robot])
            self.notes.append(note)
        self._set_out_around(scene, note, other)

    def finish(self, now_s: float) -> None:
        """End every stop at the end of the floor."""
        for robot in range(len(self.stopped)):
            self.withdraw(robot, now_s)

    def _let_go(self, robot: int) -> None:
        self._inner.let_go(robot)
        self._outer.let_go(robot)

    def _obstructors(self, scene: Scene, margin_m: Floats | float, beside_m: Floats | float, known: Ints) -> Ints:
        speed_mps = scene.driving["speed_mps"]
        braking_m = speed_mps**2 / (2 * ACCELERATION_MPS2) + speed_mps * STEP_S
        fields: Fields = np.zeros(len(speed_mps), FIELD)
        fields["front_m"] = HALF_M[0] + braking_m + margin_m + np.where(known != NOBODY, RELEASE_M, 0.0)
        fields["left_m"] = fields["right_m"] = HALF_M[1] + beside_m
        for name in FIELD.names or ():
            fields[name][scene.turning] = TURNING_M
        coming_m = speed_mps**2 / (2 * ACCELERATION_MPS2)
        return obstructors(scene.poses, scene.present, fields, HALF_M, coming_m, self._ignored, known)

    def _allowed(self, scene: Scene, robot: int, inner: int, wider: int) -> float:
        """The speed limit of a robot."""
        if robot in self._around:
            self._go_around(scene, robot)
        elif robot in self._swerving:
            self._go_on_swerving(scene, robot)
        elif self._kinds[robot] == "swerve" and wider != NOBODY and scene.wanting[robot]:
            self._try_to_swerve(scene, robot, wider)
        slows = self._kinds[robot] == "slow" and wider != NOBODY
        scene.driving["aside_to_m"][robot] = self._aside_m(scene, robot, inner)
        self._note(scene, robot, inner, wider if slows else NOBODY)
        if inner != NOBODY:
            return 0.0
        if robot in self._around:
            return AROUND_MPS
        if robot in self._swerving:
            return SWERVING_MPS
        return SLOW_MPS if slows else float(self._top_mps[robot])

    def _aside_m(self, scene: Scene, robot: int, inner: int) -> float:
        """The present offset of a robot to the left of its path."""
        if swerving := self._swerving.get(robot):
            return next_aside_m(scene, robot, swerving.aside_m)
        if inner != NOBODY:
            return float(scene.driving["aside_m"][robot])
        return self._around[robot].aside_m if robot in self._around else 0.0

    def _note(self, scene: Scene, robot: int, inner: int, slows_for: int) -> None:
        """Begin, continue or end the robot's stop."""
        now_s, me = scene.now_s, scene.driving[robot]
        sideways = abs(float(me["aside_to_m"] - me["aside_m"])) > ON_ITS_WAY_M
        speed_mps = max(float(me["speed_mps"]), SIDEWAYS_MPS if sideways else 0.0)
        note, swerving = self.stopped[robot], self._swerving.get(robot)
        by = inner
        if by == NOBODY and swerving:
            by = swerving.note.by
        elif by == NOBODY and slows_for != NOBODY and (note or speed_mps > SLOW_MPS):
            by = slows_for
        if by == NOBODY or not scene.wanting[robot]:
            self._end(robot, now_s, speed_mps)
            return
        if note is None or note.by != by:
            self._end(robot, now_s, speed_mps)
            note = self.stopped[robot] = StopNote(robot, by, now_s, float(me["speed_mps"]), self._kinds[robot])
            self.notes.append(note)
        note.go_on(now_s, speed_mps, float(me["aside_m"]) if swerving else 0.0)
        if note.stood_since_s is not None and now_s - note.stood_since_s >= self._patience_s[robot]:
            self._set_out_around(scene, note, note.by)

    def _end(self, robot: int, now_s: float, speed_mps: float) -> None:
        if note := self.stopped[robot]:
            note.end(now_s, speed_mps)
            self.stopped[robot] = None

    def _set_out_around(self, scene: Scene, note: StopNote, other: int) -> None:
        """After standing for long enough, drive around the other robot and all others that stand there."""
        robot, now_s = note.robot, scene.now_s
        self._swerving.pop(robot, None)
        self._end(robot, now_s, 0.0)
        note.around = True
        standing = np.flatnonzero(scene.present & (scene.driving["speed_mps"] < 0.05)).tolist()
        near = [other for other in standing if np.hypot(*(scene.poses[other] - scene.poses[robot])[:2]) < 3.0]
        others = ({other, *near} | (self._around[robot].others if robot in self._around else set())) - {robot}
        self._around[robot] = Passing(note, others, -self._around_aside_m, now_s + LONGEST_PASSING_S)
        self._ignored[robot, list(others)] = True
        self._let_go(robot)

    def _go_around(self, scene: Scene, robot: int) -> None:
        passing = self._around[robot]
        passing.note.around_until_s = scene.now_s
        field = np.zeros(1, FIELD)
        field["front_m"], field["rear_m"] = HALF_M[0] + MARGIN_M, HALF_M[0]
        field["left_m"] = field["right_m"] = HALF_M[1] + BESIDE_M
        among = scene.present & self._ignored[robot]
        if scene.now_s < passing.until_s and occupied(scene.poses, among, field, HALF_M, robot):
            return
        if scene.now_s < passing.until_s - LONGEST_PASSING_S + 1.0:
            return
        del self._around[robot]
        self._ignored[robot] = False

    def _try_to_swerve(self, scene: Scene, robot: int, other: int) -> None:
        aside_m = room_aside_m(scene, robot, other)
        if aside_m is None:
            return
        now_s, speed_mps, note = scene.now_s, float(scene.driving["speed_mps"][robot]), self.stopped[robot]
        if note is None or note.by != other:
            self._end(robot, now_s, speed_mps)
            note = self.stopped[robot] = StopNote(robot, other, now_s, speed_mps, "swerve")
            self.notes.append(note)
        self._swerving[robot] = Passing(note, {other}, aside_m, now_s + LONGEST_PASSING_S)

    def _go_on_swerving(self, scene: Scene, robot: int) -> None:
        passing = self._swerving[robot]
        if scene.now_s > passing.until_s or has_passed(scene, robot, passing.note.by):
            passing.aside_m = 0.0
        if passing.aside_m == 0.0 and abs(scene.driving["aside_m"][robot]) < ON_ITS_WAY_M:
            del self._swerving[robot]
