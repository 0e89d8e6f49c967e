"""Acknowledgements that are not in the file yet. One holds for what was acknowledged, and never passes to another."""

import sqlite3

from deconflict.operator.store.tables import numbered
from deconflict_client.situations import AnyRevision


class UnstoredAnswers:
    """Numbers revisions, with the answers that are given and not stored yet."""

    def __init__(self) -> None:
        self.unstored: dict[int, AnyRevision] = {}
        """By number, what was answered and is not in the file yet. Later revisions have the answer already."""

    def stored_to(self, seq: int) -> None:
        self.unstored = {number: answered for number, answered in self.unstored.items() if number > seq}

    def numbered(self, db: sqlite3.Connection, revision: AnyRevision, seq: int) -> AnyRevision:
        """As `tables.numbered`."""
        known = numbered(db, revision, seq)
        for answered in self.unstored.values():
            if answered.id == known.id:
                known = known.model_copy(update={"acknowledgement": answered.acknowledgement})
        return known
