"""A message as people are shown it: everything that it says, spelt as the standard spells it."""

from typing import Any

from ingest.languages import timestamps
from ingest.languages.massrobotics import amounts, vocabulary
from ingest.languages.massrobotics.report_models import StatusReport
from ingest.languages.massrobotics.report_reader import validated_report
from ingest.languages.rules import Findings
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
        document["maxRunTime"] = amounts.run_time(report.maxRunTime, Findings())
    return document


def _spell_status(document: dict[str, Any], report: StatusReport) -> None:
    document["operationalState"] = vocabulary.state(report.operationalState, Findings())[0]
    document |= amounts.document(report)
    _spell_datum(document["location"], "planarDatum")
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
