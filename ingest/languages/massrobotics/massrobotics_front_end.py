"""The MassRobotics AMR Interoperability Standard 1.0 as one of the languages. Each message stands by itself."""

import re
from collections.abc import Mapping, Sequence
from math import nan
from typing import Any

from ingest.languages import timestamps
from ingest.languages.front_end import TopicSender
from ingest.languages.massrobotics import amounts, parser, path_points, vocabulary
from ingest.languages.massrobotics.conformance_rules import CHAPTERS, RULES
from ingest.languages.massrobotics.report_models import StatusReport
from ingest.languages.massrobotics.report_reader import validated_report
from ingest.languages.model import Message, Status
from ingest.languages.rules import Findings, Rule
from ingest.languages.tolerance.tolerant_json import stamp_of


def message_document(raw: bytes) -> dict[str, Any]:
    """Everything that an accepted message says, JSON-ready. Unknown keys are included, times are in UTC.

    Raises `RejectedError` for a message that `parser.read` rejects.
    """
    report = validated_report(raw, Findings())
    document = report.model_dump(mode="json", exclude_none=True)
    if vocabulary.is_uuid(report.uuid):
        document["uuid"] = vocabulary.robot_uuid(report.uuid, None, Findings())
    if (stamp := stamp_of(report.timestamp, Findings())).is_known:
        document["timestamp"] = timestamps.write(stamp.t_s)
    if isinstance(report, StatusReport):
        _spell_status(document, report)
    elif report.maxRunTime is not None:
        document["maxRunTime"] = amounts.run_time(report.maxRunTime, "maxRunTime", Findings())
    return document


def _spell_status(document: dict[str, Any], report: StatusReport) -> None:
    document["operationalState"] = vocabulary.state(report.operationalState, Findings())[0]
    document |= amounts.document(report)
    _spell_datum(document["location"], "planarDatum")
    if path_points.absurd(0.0, 0.0, report.location.z):
        document["location"]["z"] = 0.0
    for point in (*document.get("path", ()), *document.get("destinations", ())):
        _spell_datum(point, "planarDatumUUID")
        stamp = timestamps.parse(point["timestamp"])
        if stamp and timestamps.plausible(stamp.t_s):
            point["timestamp"] = timestamps.write(stamp.t_s)


def _spell_datum(location: dict[str, Any], key: str) -> None:
    """Put the datum, in lower case, under the key that the schema has for it."""
    keys = (key, *({"planarDatum", "planarDatumUUID"} - {key}))
    datums = [location.pop(each) for each in keys if each in location]
    if datums:
        location[key] = vocabulary.datum(datums[0], None, Findings(), empty="datum-empty")


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

    def read(
        self,
        raw: bytes,
        topic: str,  # noqa: ARG002
        memory: Any,  # noqa: ARG002
        names_as_uuid: str | None,
        arrival_s: float = nan,  # noqa: ARG002
    ) -> tuple[Message, Any]:
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
