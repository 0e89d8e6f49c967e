"""What every language offers: bytes in; an identity, a status, an update or a rejection out.

A front end is pure: it has no socket, file or clock, and nothing that a sender sends raises an error. What it must keep
of a robot between two messages is the robot's memory, which the caller holds. So the same messages in the same order,
with the same arrivals, give the same results, live and from a recording.
"""

from collections.abc import Collection, Mapping, Sequence
from math import nan
from typing import Any, NamedTuple, Protocol

from ingest.languages.model import Message, Rejection, Status, rejection_of
from ingest.languages.rules import Findings, RejectedError, Rule
from ingest.languages.tolerance.tolerant_json import document


class TopicSender(NamedTuple):
    """The robot to which a topic of a broker belongs."""

    uuid: str
    manufacturer: str
    """"" if only messages say it."""
    serial: str
    """Serial number; "" if only messages say it."""


class FrontEnd(Protocol):
    """How the messages of one language are read."""

    @property
    def standard(self) -> str:
        """Its name and versions, for people."""

    @property
    def chapters(self) -> Mapping[str, tuple[Rule, ...]]:
        """All rules by which its messages are checked, by the chapter of the page on conformance."""

    @property
    def rules(self) -> Mapping[str, Rule]:
        """The same rules by code."""

    def has_topic(self, topic: str) -> bool:
        """Whether the language has topics of this form, of which it reads the messages."""

    def topic_filters(self, prefixes: Sequence[str], manufacturers: Sequence[str]) -> list[str]:
        """What to subscribe to at a broker. Without prefixes those of the standard, without manufacturers all."""

    def sender(self, topic: str) -> TopicSender | None:
        """The robot of a topic. None if the topic names none, since the message does."""

    def read(
        self, raw: bytes, topic: str, memory: Any, names_as_uuid: str | None, arrival_s: float = nan
    ) -> tuple[Message, Any]:
        """What a message says, and the robot's memory after it.

        `memory` is the one after the robot's last message, None before the first. `names_as_uuid` is the vendor whose
        robots may send a name instead of a UUID. The arrival is nan if it is not known.
        """

    def status(self, raw: bytes, memory: Any, names_as_uuid: str | None) -> Status | None:
        """The robot's status by the last message with a pose, `raw`, and its memory. None if there is none."""

    def superseded(self, raw: bytes, topic: str) -> bytes | None:
        """The robot as sent, if its next message of this kind makes this one pointless. None if each is needed."""

    def has_pose(self, raw: bytes, topic: str) -> bool:
        """Whether a message is of the kind that has the robot's pose, which is worth nothing once it is old."""

    def document(self, raw: bytes) -> dict[str, Any]:
        """Everything that an accepted message says, JSON-ready."""


class Topic(NamedTuple):
    """What the last parts of a topic say."""

    sender: TopicSender
    kind: str


class TopicFrontEnd:
    """What the languages of brokers share: a topic names the robot and, last, the kind of message."""

    kinds: Collection[str]
    with_pose: Collection[str]
    """The kinds of messages that have the robot's pose."""
    form: str
    """What stands before the kind in a topic, for people."""
    nothing: Any
    """The memory of a robot before its first message."""
    parsed: "staticmethod[[str], Topic | None]"
    """What a topic says. None if it is not of the language's form."""
    read_kind: "staticmethod[[bytes, Topic, Any, Findings, float], tuple[Message, Any]]"
    """What `read` returns for a topic that is known. Raises `RejectedError` if it can't be understood."""
    status_of: "staticmethod[[str, Any, Findings], Status | None]"
    """The status of the robot with a UUID by its memory."""

    def has_topic(self, topic: str) -> bool:
        parsed = self.parsed(topic)
        return parsed is not None and parsed.kind in self.kinds

    def sender(self, topic: str) -> TopicSender | None:
        parsed = self.parsed(topic)
        return parsed.sender if parsed else None

    def read(
        self,
        raw: bytes,
        topic: str,
        memory: Any,
        names_as_uuid: str | None,  # noqa: ARG002
        arrival_s: float = nan,
    ) -> tuple[Message, Any]:
        parsed, findings = self.parsed(topic), Findings()
        if parsed is None or parsed.kind not in self.kinds:
            reason = f"topic {topic[-80:]!r} is not {self.form}/ and one of {', '.join(self.kinds)}"
            return Rejection("topic-unknown", reason), memory
        try:
            return self.read_kind(raw, parsed, memory or self.nothing, findings, arrival_s)
        except RejectedError as rejected:
            return rejection_of(rejected, parsed.sender.uuid, findings), memory

    def status(self, raw: bytes, memory: Any, names_as_uuid: str | None) -> Status | None:  # noqa: ARG002
        return self.status_of("", memory, Findings()) if memory else None

    def superseded(self, raw: bytes, topic: str) -> bytes | None:  # noqa: ARG002
        parsed = self.parsed(topic)
        return parsed.sender.uuid.encode() if parsed and parsed.kind in self.with_pose else None

    def has_pose(self, raw: bytes, topic: str) -> bool:  # noqa: ARG002 - the topic says it
        return topic.rpartition("/")[2] in self.with_pose

    def document(self, raw: bytes) -> dict[str, Any]:
        return document(raw)
