"""Every way in which a message departs from the standard, by code.

A rule that rejects means that the message could not be understood; any other was read as its sentence says, and
counted. Codes are label values of metrics: they do not change.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Rule:
    """One deviation: what was seen, and how it was read."""

    code: str
    clause: str
    """Of the standard, or `schema` for its published JSON schema."""
    sentence: str
    rejects: bool = False


def _rejecting(code: str, clause: str, sentence: str) -> Rule:
    return Rule(code, clause, sentence, rejects=True)


_ALL = (
    # what can't be understood
    _rejecting("not-utf8", "6.2", "The message is not UTF-8; send JSON text in UTF-8."),
    _rejecting("not-json", "6.2", "The message is not JSON; send one JSON object a message."),
    _rejecting("not-object", "6.2", "The message is JSON but no object; send one report a message."),
    _rejecting("number-not-finite", "6.2", "A number is NaN or infinite; leave out what is not known."),
    _rejecting("report-unknown", "schema", "Neither an identity nor a status report by its keys."),
    _rejecting("key-missing", "schema", "A required key is missing."),
    _rejecting("type-wrong", "schema", "A value has a type that can't be read as what belongs there."),
    _rejecting("uuid-unreadable", "2.13", "The robot's UUID is no UUID, and its vendor is not set to use names."),
    _rejecting("stamp-unreadable", "5.1.2", "The message's own timestamp can't be read; send RFC 3339 in UTC."),
    _rejecting("stamp-absurd", "5.1.2", "The message's own timestamp lies outside 1970 to 2100."),
    _rejecting("position-absurd", "3.3", "The location lies more than ten thousand kilometres out."),
    _rejecting("envelope-not-positive", "4.1.6", "The envelope's length or width is not above zero."),
    _rejecting("envelope-absurd", "4.1.6", "The envelope is longer, wider or higher than 100 m."),
    _rejecting("message-too-large", "6.1", "The message is larger than the receiver's limit."),
    # who
    Rule("uuid-upper-case", "2.13", "The UUID has upper-case letters; folded to lower case."),
    Rule("uuid-no-dashes", "2.13", "The UUID has no dashes, or braces; read as a UUID."),
    Rule("uuid-not-rfc4122", "2.13", "The UUID is not of an RFC 4122 variant; used as it is."),
    Rule("uuid-is-name", "2.13", "A name stands where a UUID belongs; the robot has a UUID derived from it."),
    Rule("uuid-of-another-vendor", "2.13", "The robot was identified as another vendor's."),
    Rule("identity-missing", "4.4", "A status of a robot that has not identified itself; default envelope."),
    Rule("identity-changed", "4.4", "The robot now names another maker, model, serial number or envelope."),
    Rule("text-empty", "4.1", "A required text is empty; kept."),
    # keys and types
    Rule("key-unknown", "schema", "A key that the standard does not have; kept aside."),
    Rule("number-as-text", "schema", "A number was sent as text; read as the number."),
    Rule("text-as-number", "schema", "A text was sent as a number; read as text."),
    Rule("null-value", "schema", "A key has the value null; read as left out."),
    Rule("single-not-list", "schema", "One value stands where a list belongs; read as a list of one."),
    Rule("duplicate-items", "schema", "A list that should hold different items repeats one; kept."),
    # when
    Rule("stamp-offset-no-colon", "5.1.2", "The timestamp's offset has no colon; read."),
    Rule("stamp-not-utc", "5.1.2", "The timestamp has an offset other than UTC; converted."),
    Rule("stamp-no-offset", "5.1.2", "The timestamp has no offset; read as UTC."),
    Rule("stamp-space", "5.1.2", "The timestamp has a space or a lower-case letter for T or Z; read."),
    Rule("stamp-epoch", "5.1.2", "The timestamp is a count of seconds since 1970; read."),
    Rule("stamp-not-increasing", "5.1.2", "The status is older than one already had; the newer one holds."),
    Rule("stamp-stale", "5.1.2", "The status took long to arrive, or says again what was said before."),
    Rule("clock-off", "5.1.2", "The sender's clock is off; corrected by the estimate."),
    Rule("status-too-frequent", "5.4", "More than one status a second; used."),
    Rule("status-too-rare", "5.4", "More than thirty seconds since the last status."),
    # state
    Rule("state-alias", "5.1.3", "The state is spelt otherwise than in the schema; read as the state meant."),
    Rule("state-unknown", "5.1.3", "No state of the standard; the robot counts as present and not navigating."),
    Rule("state-offline", "5.1.3.4", "A robot says that it is offline; it counts as present and standing."),
    # where
    Rule("datum-upper-case", "3.3.1", "The datum has upper-case letters; folded to lower case."),
    Rule("datum-key", "schema", "The datum is under the key of the other kind of location; read."),
    Rule("datum-missing", "3.3.1", "The location names no datum; the robot is compared with nothing."),
    Rule("datum-not-uuid", "3.2.1", "The datum is no UUID; used as a name."),
    Rule("datum-unknown", "3.3.1", "The site file has no such datum; a floor of its own."),
    Rule("angle-missing", "3.3.5", "A location has no angle; heading unknown."),
    Rule("angle-zero", "3.3.5", "A quaternion is all zeros; heading unknown."),
    Rule("angle-not-unit", "3.3.5", "A quaternion is not of unit length; normalised."),
    Rule("heading-contradicts-motion", "3.3.5", "The robot moves across its heading; kept."),
    Rule(
        "turn-rate-contradicts-motion",
        "5.2.2",
        "The angular velocity is not borne out by the headings; set aside.",
    ),
    Rule("speed-sign-lost", "5.2.1", "The robot backs up with a positive speed; taken as negative."),
    # amounts
    Rule("battery-out-of-range", "5.3.1", "The battery is not within 0 to 100 %; clamped."),
    Rule("run-time-negative", "5.3.2", "The remaining run time is negative; taken as zero."),
    Rule("load-out-of-range", "5.3.4", "The load is not within 0 to 100 %; clamped."),
    Rule("load-used-key", "5.3.4", "The load used stands in place of the load still available; read."),
    Rule("speed-limit-negative", "4.2.1", "The greatest speed is not above zero; ignored."),
    # where to
    Rule("destinations-too-many", "5.2.3", "More than ten destinations; used."),
    Rule("destinations-too-far", "5.2.3", "A destination beyond fifteen minutes; not used yet."),
    Rule("destinations-unsorted", "5.2.3", "Destinations are not in the order of their times; sorted."),
    Rule("path-too-many", "5.3.3", "More than ten points; used."),
    Rule("path-too-far", "5.3.3", "A point beyond ten seconds; used when the horizon reaches it."),
    Rule("path-past", "5.3.3", "Every point lies in the past; new times by the speed along the points."),
    Rule("path-unordered", "5.3.3", "Points are not in the order of their times; new times by speed."),
    Rule("path-retimed", "5.3.3", "The path was given new times by the robot's speed."),
    Rule("path-contradicts-motion", "5.3.3", "The path jumps further than the robot can go; used up to there."),
    Rule("point-unreadable", "3.3", "A point's time or position can't be read or is absurd; left out."),
)

RULES = {rule.code: rule for rule in _ALL}
