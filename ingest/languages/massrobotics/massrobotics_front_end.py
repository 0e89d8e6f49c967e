"""The MassRobotics AMR Interoperability Standard 1.0 as one of the languages. Each message stands by itself."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ingest.languages.front_end import TopicSender
from ingest.languages.massrobotics import parser
from ingest.languages.massrobotics.conformance_rules import CHAPTERS, RULES
from ingest.languages.massrobotics.message_document import message_document
from ingest.languages.model import Message, Status
from ingest.languages.rules import Rule

LEADING_UUID = re.compile(rb'\s*\{\s*"uuid"\s*:\s*"([^"]{1,64})"')
"""Most senders begin a message with the UUID. A key in this place is the robot's own."""
UUID_KEY = re.compile(rb'"uuid"\s*:\s*"([^"]{1,64})"', re.IGNORECASE)
"""A key with the UUID of a robot, anywhere in a message."""


class MassRoboticsFrontEnd:
    """Robots have no memory here, and no topics."""

    standard = "MassRobotics AMR Interoperability Standard 1.0"
    chapters: Mapping[str, tuple[Rule, ...]] = CHAPTERS
    rules: Mapping[str, Rule] = RULES

    def has_topic(self, topic: str) -> bool:  # noqa: ARG002 - it knows no brokers
        return False

    def topic_filters(self, prefixes: Sequence[str], manufacturers: Sequence[str]) -> list[str]:  # noqa: ARG002
        return []

    def sender(self, topic: str) -> TopicSender | None:  # noqa: ARG002 - messages name their robots
        return None

    def read(self, raw: bytes, topic: str, memory: Any, names_as_uuid: str | None) -> tuple[Message, Any]:  # noqa: ARG002
        return parser.read(raw, names_as_uuid=names_as_uuid), None

    def status(self, raw: bytes, memory: Any, names_as_uuid: str | None) -> Status | None:  # noqa: ARG002
        status = parser.read(raw, names_as_uuid=names_as_uuid)
        return status if isinstance(status, Status) else None

    def superseded(self, raw: bytes, topic: str) -> bytes | None:
        """The UUID of the robot that sent this status, found without parsing. None unless it is certainly its own."""
        if not self.has_pose(raw, topic):
            return None
        if leading := LEADING_UUID.match(raw):
            return leading.group(1).lower()
        found = UUID_KEY.search(raw) if raw.lower().count(b'"uuid"') == 1 else None
        return found.group(1).lower() if found else None

    def has_pose(self, raw: bytes, topic: str) -> bool:  # noqa: ARG002
        return b'"operationalState"' in raw

    def document(self, raw: bytes) -> dict[str, Any]:
        return message_document(raw)
