"""What the durable stream carries. The key of a conflict is its pair of robots, of anything else what it is about."""

import json
from dataclasses import dataclass
from typing import NamedTuple
from uuid import uuid5

from deconflict.advisories.conflict_wording import ADVISORIES
from deconflict.advisories.finding_lifecycle import finding_key
from deconflict.advisory import ADVISORY, Acknowledgement, AnyAdvisory, ConflictAdvisory
from deconflict.cluster.tiles.channels import token
from deconflict.cluster.tiles.tiles import Place


class Seen(NamedTuple):
    """The line of the stream that somebody has come to."""

    seq: int
    """0 before the first."""
    id: str
    """Of its advisory; empty where that is known no more."""
    revision: int
    """0 in an answer."""


@dataclass(frozen=True, slots=True)
class Line:
    """A revision and the place that decides who tells it, or an answer to one."""

    seq: int
    key: str
    """Of the advisory; in an answer its id."""
    home: Place | None = None
    """None where no tile decides."""
    advisory: AnyAdvisory | None = None
    answer: Acknowledgement | None = None

    def seen(self) -> Seen:
        return (
            Seen(self.seq, self.advisory.id, self.advisory.revision) if self.advisory else Seen(self.seq, self.key, 0)
        )

    def is_what_was(self, seen: Seen) -> bool:
        """Whether this may be the line that was seen; who has stored it with an answer knows that as a revision."""
        return self.seen() == seen if self.advisory else (self.seq, self.key) == (seen.seq, seen.id)


def key_of(advisory: AnyAdvisory) -> str:
    """What an advisory is told under: there is at most one open of a key."""
    if isinstance(advisory, ConflictAdvisory):
        return token("_".join(advisory.robots))
    return str(uuid5(ADVISORIES, finding_key(advisory)))


def told_as(home: Place | None, advisory: AnyAdvisory) -> bytes:
    """A revision as `line` reads it."""
    return json.dumps({"home": home, "advisory": advisory.model_dump(mode="json")}).encode()


def line(seq: int, subject: str, data: bytes) -> Line:
    """What a message of the stream says."""
    _, kind, key = subject.split(".", 2)
    if kind == "answer":
        return Line(seq, key, answer=Acknowledgement.model_validate_json(data))
    told = json.loads(data)
    home = Place(*told["home"]) if told["home"] else None
    return Line(seq, key, home, ADVISORY.validate_python(told["advisory"]))
