"""The lifts of an Open-RMF building file: the cabin on its own floor, and on each floor that it has doors on."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import dist, hypot
from typing import Any

from deconflict.settings.importers.formats.openrmf.rmf_entries import mapping, number
from deconflict.settings.importers.formats.openrmf.rmf_frames import LevelFrame
from deconflict.settings.importers.plan import Level, Lift, PlanError, Spot, UnusedParts, unused


@dataclass(slots=True)
class RmfLifts:
    """The lifts of one file, and what they lack."""

    tables: Mapping[str, Any]
    levels: Mapping[str, Level]
    frames: Mapping[str, LevelFrame]
    reference: str
    y_sign: int
    doubts: list[str] = field(default_factory=list)
    closed: list[str] = field(default_factory=list)
    """Levels with a vertex in a cabin that has no doors there."""
    homeless: list[str] = field(default_factory=list)
    """Lifts whose reference floor is not in the file."""
    doors: int = 0

    def found(self) -> tuple[Lift, ...]:
        """The lifts whose floor is in the file. Raises `PlanError`."""
        return tuple(filter(None, (self._lift(str(name), table) for name, table in self.tables.items())))

    def left_out(self) -> Iterator[UnusedParts]:
        reason = f"their reference floor is no level of the file: {', '.join(self.homeless)}"
        yield from unused(len(self.homeless), "lift", reason)
        reason = f"the lift has no doors there: {', '.join(self.closed)}"
        yield from unused(len(self.closed), "vertex in a lift", reason, "vertices in lifts")
        cabins = [node.lift for level in self.levels.values() for node in level.nodes if node.lift]
        unknown = [name for name in cabins if name not in map(str, self.tables)]
        reason = f"the file has no lift of that name: {', '.join(sorted(set(unknown)))}"
        yield from unused(len(unknown), "vertex in a lift", reason, "vertices in lifts")
        yield from unused(self.doors, "lift door", "the site file has the outline of the cabin")

    def _lift(self, name: str, entry: Any) -> Lift | None:
        where = f"lifts.{name}"
        table = mapping(entry, where)
        level = str(table.get("reference_floor_name") or self.reference)
        if level not in self.levels:
            self.homeless.append(f"{name} on {level}")
            return None
        x, y, yaw, width, depth = (
            number(table.get(key), f"{where}.{key}") for key in ("x", "y", "yaw", "width", "depth")
        )
        if width <= 0 or depth <= 0:
            raise PlanError(f"{where}: width and depth must be above 0, not {width:g} and {depth:g}")
        self.doors += len(table.get("doors") or ())
        frame = self.frames[level]
        at = frame.to_metres((x, y * self.y_sign))
        landings = tuple(self._landings(name, table, level, at, hypot(width, depth) / 2))
        return Lift(name, level, at, yaw + frame.turn_rad, (width, depth), landings)

    def _landings(
        self, name: str, table: Mapping[str, Any], own: str, at: Spot, reach_m: float
    ) -> Iterator[tuple[str, Spot]]:
        """The other floors on which a lift opens, with its place there.

        Where floors share a frame, that is the place on its own floor, from which a vertex in the cabin may differ by
        `reach_m`. Elsewhere it is that vertex.
        """
        doors = mapping(table.get("level_doors") or {}, f"lifts.{name}.level_doors")
        opens = {str(level) for level, names in doors.items() if names}
        for level, floor in self.levels.items():
            node = next((node for node in floor.nodes if node.lift == name), None)
            is_above = level == own or (self.frames[level].is_shared and self.frames[own].is_shared)
            if node and is_above and dist(node.at, at) > reach_m:
                raise PlanError(
                    f"levels.{level}.vertices.{node.id}: is in the cabin of {name}, but {dist(node.at, at):.1f} m from"
                    " it; correct the vertex, the lift, or the fiducials of the level"
                )
            if level == own:
                continue
            if opens and level not in opens:
                self.closed += [f"{name} on {level}"] if node else []
            elif is_above and (opens or node):
                yield level, at
            elif node:
                yield level, node.at
            elif opens:
                self.doubts.append(f"{name} has doors on {level}, but no vertex in its cabin; it does not open there")
