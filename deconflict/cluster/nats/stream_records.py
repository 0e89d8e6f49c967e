"""Records of the durable stream. The key of a conflict is its pair of robots, that of a finding is its subject, that of
a situation is its id."""

import json
from dataclasses import dataclass
from typing import NamedTuple
from uuid import uuid5

from deconflict.advisories.finding_lifecycle import finding_key
from deconflict.advisories.words.conflict_wording import ADVISORIES
from deconflict.cluster.tiles.tile_channels import subject_token
from deconflict_client.advisory import Acknowledgement, ConflictAdvisory
from deconflict_client.advisory.robot_advice import RobotAdvice
from deconflict_client.situations import REVISION, AnyRevision, Situation
from ingest.batch import FloorPoint


class StreamPosition(NamedTuple):
    """A record of the stream, as a reader remembers it."""

    seq: int
    """0 before the first record."""
    id: str
    """Of its advisory; empty if the advisory is no longer known."""
    revision: int
    """0 in an answer."""


@dataclass(frozen=True, slots=True)
class StreamRecord:
    """A revision of an advisory or a situation with its home, or an answer to one."""

    seq: int
    key: str
    """Of the advisory; in an answer the advisory's id."""
    home: FloorPoint | None = None
    """The place whose tile decides which engine writes the advisory; None if no tile decides."""
    advisory: AnyRevision | None = None
    answer: Acknowledgement | None = None

    def position(self) -> StreamPosition:
        if self.advisory:
            return StreamPosition(self.seq, self.advisory.id, self.advisory.revision)
        return StreamPosition(self.seq, self.key, 0)

    def is_at(self, position: StreamPosition) -> bool:
        """Whether this may be the record at a position.

        The revision of an answer is not compared: a store remembers an answer under the revision that it added it to.
        """
        if self.advisory:
            return self.position() == position
        return (self.seq, self.key) == (position.seq, position.id)


def key_of(revision: AnyRevision) -> str:
    """The key of an advisory, a situation or advice. At most one of a key is open."""
    if isinstance(revision, ConflictAdvisory):
        return subject_token("_".join(revision.robots))
    if isinstance(revision, Situation | RobotAdvice):
        return str(uuid5(ADVISORIES, f"{revision.kind} {revision.id}"))
    return str(uuid5(ADVISORIES, finding_key(revision)))


def record_bytes(home: FloorPoint | None, advisory: AnyRevision) -> bytes:
    """A revision as `read_record` reads it."""
    return json.dumps({"home": home, "advisory": advisory.model_dump(mode="json")}).encode()


def read_record(seq: int, subject: str, data: bytes) -> StreamRecord:
    """The record in a message of the stream."""
    _, kind, key = subject.split(".", 2)
    if kind == "answer":
        return StreamRecord(seq, key, answer=Acknowledgement.model_validate_json(data))
    document = json.loads(data)
    home = FloorPoint(*document["home"]) if document["home"] else None
    return StreamRecord(seq, key, home, REVISION.validate_python(document["advisory"]))
