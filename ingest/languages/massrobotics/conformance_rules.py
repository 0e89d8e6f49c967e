"""The rules of the standard by code: rejections and deviations.

A message that breaks a rejecting rule is rejected. A message that deviates from another rule is read as the sentence of
the rule says, and the deviation is counted. Codes are label values of metrics: they do not change.
"""

from ingest.languages.rules import (
    Rule,
    in_context,
    owner_rules,
    path_rules,
    point_rules,
    rejecting,
    size_rules,
    unit_rules,
    value_rules,
)

_REJECTING = (
    rejecting("not-utf8", "Not UTF-8; send JSON text in UTF-8.", "6.2"),
    rejecting("not-json", "Not JSON; send one JSON object a message.", "6.2"),
    rejecting("too-deep", "Nested more than 200 deep; no report is.", "6.2"),
    rejecting("not-object", "JSON, but no object; send one report a message.", "6.2"),
    rejecting("number-not-finite", "A required number is NaN or infinite; leave out what is not known.", "6.2"),
    rejecting("report-unknown", "Neither an identity nor a status report by its keys.", "schema"),
    rejecting("key-missing", "A required key is missing.", "schema"),
    rejecting("type-wrong", "A value without which the report says nothing can't be read.", "schema"),
    rejecting("uuid-unreadable", "The UUID is none, and the vendor is not set to use names.", "2.13"),
    rejecting("position-absurd", "The location lies more than ten thousand kilometres out.", "3.3"),
    *owner_rules("2.13"),
    rejecting(
        "robots-too-many",
        "A new UUID, or a long message, beyond what a vendor or a source may have.",
        "2.13",
        alone=False,
    ),
    rejecting("message-too-large", "Larger than the receiver's limit.", "6.1", alone=False),
)
_WHO = (
    Rule("uuid-upper-case", "The UUID has upper-case letters; folded to lower case.", "2.13"),
    Rule("uuid-no-dashes", "The UUID lacks dashes, or has braces, `urn:uuid:` or spaces about it; read.", "2.13"),
    Rule("uuid-not-rfc4122", "The UUID's version or variant is none of RFC 4122; used as it is.", "2.13"),
    Rule("uuid-is-name", "A name stands where a UUID belongs; the robot has a UUID derived from it.", "2.13"),
    in_context("identity-missing", "A status before any identity; the default envelope is used.", "4.4"),
    in_context("identity-changed", "The robot now names another maker, model, serial number or envelope.", "4.4"),
    *size_rules("4.1.6"),
    Rule("text-too-long", "A name or model is longer than 100 letters; cut.", "4.1"),
    Rule("text-empty", "A required text or an error code is empty; kept, the error code left out.", "4.1"),
)
_KEYS_AND_TYPES = (
    *value_rules("schema"),
    Rule("key-unknown", "A key that the standard does not have; shown, not used.", "schema"),
    Rule("duplicate-items", "A list that should hold different items repeats one; kept.", "schema"),
    Rule("codes-too-many", "More than 100 error codes, or one has more than 200 letters; cut.", "schema"),
)
_WHEN = (
    Rule("stamp-unreadable", "The message's own timestamp is absent or can't be read; as of its arrival.", "5.1.2"),
    Rule("stamp-absurd", "The message's own timestamp lies outside 1970 to 2100; as of its arrival.", "5.1.2"),
    Rule("stamp-offset-no-colon", "A timestamp's offset has no colon or no minutes; read.", "5.1.2"),
    Rule("stamp-not-utc", "A timestamp has an offset other than UTC; converted.", "5.1.2"),
    Rule("stamp-no-offset", "A timestamp has no offset; read as UTC.", "5.1.2"),
    Rule(
        "stamp-spelling",
        "A timestamp has a space for T, a lower-case letter, a comma, spaces, or a Z after an offset; read.",
        "5.1.2",
    ),
    Rule("stamp-epoch", "A timestamp counts from 1970; read as seconds, ms, us or ns by its size.", "5.1.2"),
    in_context("stamp-not-increasing", "Older than a status already had; the newer one holds.", "5.1.2"),
    in_context("stamp-stale", "Took two seconds longer than others to arrive; used as of when it was sent.", "5.1.2"),
    in_context(
        "stamp-unchanged",
        "The clock stands: others had this time for over two seconds; as of its arrival.",
        "5.1.2",
    ),
    in_context("clock-off", "The sender's clock is off; corrected by the estimate.", "5.1.2"),
    in_context("status-too-frequent", "More than one status a second; used.", "5.4"),
    in_context("status-too-rare", "More than thirty seconds since the last status.", "5.4"),
)
_STATE = (
    Rule("state-alias", "The state is spelt otherwise than in the schema; read as the state meant.", "5.1.3"),
    Rule("state-unknown", "No state of the standard; kept as text, present and not navigating.", "5.1.3"),
    Rule("state-offline", "A robot says that it is offline; it counts as present and standing.", "5.1.3.4"),
)
_WHERE = (
    Rule("datum-upper-case", "The datum has upper-case letters; folded to lower case.", "3.3.1"),
    Rule("datum-key", "The datum is under the key of the other kind of location; read.", "schema"),
    Rule("datum-missing", "The location's datum is absent, empty or nil; compared with nothing.", "3.3.1"),
    Rule("datum-empty", "A point's datum is empty or nil; read as the robot's own.", "3.3.1"),
    Rule(
        "datum-not-uuid",
        "No UUID with dashes; read without dashes or in braces, else used as a name in lower case.",
        "3.2.1",
    ),
    in_context("datum-unknown", "The site file has no such datum; a floor of its own.", "3.3.1"),
    in_context("datum-too-many", "The vendor has named fifty unknown datums before; compared with nothing.", "3.3.1"),
    *unit_rules("3.3"),
    Rule("angle-missing", "A location has no angle; heading unknown.", "3.3.5"),
    Rule("angle-zero", "A quaternion is all zeros; heading unknown.", "3.3.5"),
    Rule("angle-not-unit", "A quaternion is not of unit length; normalised.", "3.3.5"),
    in_context(
        "speed-contradicts-motion",
        "It moves much faster or slower than it says, twice; the observed speed is used.",
        "5.2.2",
    ),
    in_context("heading-contradicts-motion", "The robot moves across its heading; kept.", "3.3.5"),
    in_context(
        "turn-rate-contradicts-motion", "The headings do not bear out the angular velocity; set aside.", "5.2.2"
    ),
    in_context("speed-sign-lost", "The robot backs up with a positive speed; taken as negative.", "5.2.1"),
)
_AMOUNTS = (
    Rule("battery-out-of-range", "The battery is not within 0 to 100 %; clamped.", "5.3.1"),
    Rule("battery-fraction", "The battery lies between 0 and 1, perhaps a fraction; read as percent.", "5.3.1"),
    Rule("run-time-negative", "A run time is negative; read as zero.", "5.3.2"),
    Rule("load-out-of-range", "The load is not within 0 to 100 %; clamped.", "5.3.4"),
    Rule("load-used-key", "The load used is told, not what is left; read where that is missing.", "5.3.4"),
    Rule("speed-absurd", "A speed beyond 100 m/s; ignored.", "5.2.1"),
    Rule("speed-limit-not-positive", "The greatest speed is not above zero; ignored.", "4.2.1"),
)
_WHERE_TO = (
    Rule(
        "destinations-too-many",
        "More than ten destinations; two hundred are used, twenty for queues.",
        "5.2.3",
    ),
    Rule("destinations-too-far", "A destination beyond fifteen minutes; kept, not used yet.", "5.2.3"),
    Rule("destinations-past", "Every destination's time is over; kept.", "5.2.3"),
    Rule("destinations-unsorted", "Destinations are not in the order of their times; sorted.", "5.2.3"),
    Rule("path-too-many", "More than ten points; the first two hundred used.", "5.3.3"),
    Rule("path-too-far", "A point beyond ten seconds; used when the horizon reaches it.", "5.3.3"),
    Rule("path-past", "Every point's time is over; kept, for new times by speed.", "5.3.3"),
    Rule("path-partly-past", "Some points' times are over; the others are used.", "5.3.3"),
    Rule("path-times-1970", "The points' times lie at the beginning of 1970; kept, for new times.", "5.3.3"),
    Rule("path-times-equal", "Points have the same time; repeated ones are left out, others get new times.", "5.3.3"),
    Rule("path-unordered", "The times are out of order; sorted if that shortens the way, else new ones.", "5.3.3"),
    *path_rules("5.3.3"),
    in_context("path-contradicts-motion", "The path jumps further than the robot can go; used up to there.", "5.3.3"),
    *point_rules("3.3"),
    Rule("point-absurd", "A point lies beyond 10,000 km, before 1970 or after 2100; left out.", "3.3"),
)

CHAPTERS = {
    "What can't be understood": _REJECTING,
    "Who": _WHO,
    "Keys and types": _KEYS_AND_TYPES,
    "When": _WHEN,
    "State": _STATE,
    "Where": _WHERE,
    "Amounts": _AMOUNTS,
    "Where to": _WHERE_TO,
}
RULES = {rule.code: rule for rules in CHAPTERS.values() for rule in rules}
