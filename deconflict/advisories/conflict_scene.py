"""What the life of conflict advisories asks of the engine: who is on the floor, and how two robots meet."""

from collections.abc import Sequence
from typing import Protocol

from deconflict.advisories.words.conflict_wording import Absence, Party
from deconflict.advisories.words.words import Spot
from deconflict.sweep.geometry.encounter import Encounter, Encounters
from ingest.batch import Floats, Pair


class ConflictScene(Protocol):
    """The robots and the places around a conflict. The engine's is `engine.live_scene.LiveScene`."""

    def is_present(self, uuid: str) -> bool:
        """Whether a robot is on the floor."""
        ...

    def absence(self, uuid: str) -> Absence | None:
        """Why a robot is not on the floor; None if it is, as far as is known."""
        ...

    def account(self, uuid: str) -> str:
        """Whose revisions are counted together with those of a robot that is on the floor: its vendor, as a rule."""
        ...

    def party(self, uuid: str, now_s: float) -> Party:
        """What an advisory says of a robot that is on the floor."""
        ...

    def stands(self, uuid: str) -> bool:
        """Whether a robot is on the floor and stands there."""
        ...

    def encounter(self, pair: Pair, contact_s: float) -> Encounter:
        """How two robots meet at `contact_s`."""
        ...

    def encounters(self, pairs: Sequence[Pair], contact_s: Floats) -> Encounters:
        """How each pair meets at its time, as `encounter` but for rounding errors; the place is nan if not known."""
        ...

    def separation_m(self, pair: Pair, now_s: float) -> float | None:
        """The separation of two robots; None if they are on different floors."""
        ...

    def datum(self, met: Encounter) -> str:
        """The id of the datum of an encounter's floor."""
        ...

    def spots(self, encounters: Sequence[Encounter]) -> list[Spot]:
        """Where each encounter is."""
        ...
