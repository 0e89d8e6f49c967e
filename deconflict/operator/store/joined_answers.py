"""Acknowledgements of situations that became part of others: nobody has to acknowledge the same thing twice."""

import sqlite3

from deconflict.advisories.severity import rises
from deconflict.operator.store.tables import numbered
from deconflict_client.advisory import AdvisoryState
from deconflict_client.situations import AnyRevision, Situation


class JoinedAnswers:
    """Numbers revisions, and passes on the answer to a situation to the one that it became part of."""

    def __init__(self) -> None:
        self._joined: dict[str, Situation] = {}
        """By id of a situation, the answered one that became part of it, until the answer is stored for it."""
        self.unstored: dict[int, AnyRevision] = {}
        """By number, what was answered and is not in the file yet. Later revisions have the answer already."""

    def stored_to(self, seq: int) -> None:
        self.unstored = {number: answered for number, answered in self.unstored.items() if number > seq}

    def numbered(self, db: sqlite3.Connection, revision: AnyRevision, seq: int) -> AnyRevision:
        """As `tables.numbered`. What is more severe than what was answered gets no answer: nobody has seen it."""
        known = numbered(db, revision, seq)
        for answered in self.unstored.values():
            if answered.id == known.id:
                known = known.model_copy(update={"acknowledgement": answered.acknowledgement})
        if not isinstance(known, Situation):
            return known
        joined = self._joined.get(known.id)
        if joined and (known.acknowledgement or known.state is AdvisoryState.CLEARED):
            del self._joined[known.id]
        if joined and not known.acknowledgement and not rises(known.severity, joined.severity):
            known = known.model_copy(update={"acknowledgement": joined.acknowledgement})
        if known.joined_into and known.acknowledgement:
            self._joined[known.joined_into] = known
        return known
