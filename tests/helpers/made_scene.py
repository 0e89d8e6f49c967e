"""A scene for the life of conflict advisories: every robot is present and drives, and all meet at one place."""

from collections.abc import Sequence

import numpy as np

from deconflict.advisories.live_scene import LiveScene
from deconflict.advisories.words.conflict_wording import GONE, Absence, Party
from deconflict.advisories.words.words import Spot
from deconflict.sweep.geometry.encounter import CLASSES, ENCOUNTER, Encounter, Encounters
from deconflict_client.advisory import EncounterClass
from ingest.batch import Floats, Pair


class MadeScene(LiveScene):
    """Answers without an engine; tests override what they are about."""

    def __init__(self) -> None:
        pass

    def is_present(self, uuid: str) -> bool:
        return True

    def absence(self, uuid: str) -> Absence | None:
        return None if self.is_present(uuid) else GONE

    def account(self, uuid: str) -> str:
        return "Alder"

    def party(self, uuid: str, now_s: float) -> Party:
        return Party(f"Alder {uuid}", "Alder", "path", standing=False)

    def stands(self, uuid: str) -> bool:
        return False

    def encounter(self, pair: Pair, contact_s: float) -> Encounter:
        return Encounter(EncounterClass.CROSSING, 1.2, 3.0, 4.0, 0)

    def encounters(self, pairs: Sequence[Pair], contact_s: Floats) -> Encounters:
        met = map(self.encounter, pairs, contact_s.tolist())
        rows = [
            (encounter.x_m, encounter.y_m, CLASSES.index(encounter.encounter_class), encounter.floor)
            for encounter in met
        ]
        return np.array(rows, ENCOUNTER)

    def separation_m(self, pair: Pair, now_s: float) -> float | None:
        return 5.0

    def datum(self, met: Encounter) -> str:
        return "datum-1"

    def spots(self, encounters: Sequence[Encounter]) -> list[Spot]:
        return [Spot("in Aisle 4")] * len(encounters)
