"""The newest message of one topic of a robot, by which a later one is known to be repeated or late."""

from math import nan
from typing import Any

import msgspec

from ingest.languages.rules import Findings
from ingest.languages.timestamps import NO_STAMP, Stamp

STEPPED_BACK = 3
"""After so many older messages in a row, of which each is newer than the one before it, the clock was set back."""
RESTARTED, RESTARTED_S = 20, 5.0
"""After so many older messages in a row, and so long, the sender counts anew if their numbers are lower, too. A broker
that kept messages back sends such ones as well."""
REPEATS_S = 5.0
"""A second broker repeats a message sooner. One with a pose that comes again later is of a robot that stands, with a
clock and a counter that stand, too."""
SOONER_S = 1.0
"""Messages that follow each other sooner than they were sent, by more than this, were kept back: no row goes on."""


class Heard(msgspec.Struct, frozen=True, gc=False):
    """What is kept of a message. Languages without numbers of messages have no `header_id`."""

    content_hash: int
    """Of all that is read of it, however it is written."""
    stamp_s: float
    header_id: int | None = None
    older: int = 0
    """Older messages that have come since, in a row of rising stamps."""
    older_s: float = nan
    """The stamp of the last one."""
    since_s: float = nan
    """When the first one arrived."""
    late_s: float = nan
    """That minus its stamp."""
    came_s: float = nan
    """When this message arrived."""

    def is_newer_than(self, later: "Heard", arrival_s: float) -> bool:
        """Whether a message that came later is older. A sender whose clock was set back may still count its messages.

        If it does not, or began to count anew, older messages in a row show it.
        """
        number, later_number = self.header_id or 0, later.header_id or 0
        if later.stamp_s >= self.stamp_s or later_number > number:
            return False
        row = self.after_older(later, arrival_s)
        if later_number == number:
            return row.older < STEPPED_BACK
        return row.older < RESTARTED or arrival_s - row.since_s < RESTARTED_S

    def after_older(self, later: "Heard", arrival_s: float) -> "Heard":
        """What is kept of this message after an older one has come."""
        older_s, late_s = later.stamp_s, arrival_s - later.stamp_s
        if older_s > self.older_s and not late_s < self.late_s - SOONER_S:
            return msgspec.structs.replace(self, older=self.older + 1, older_s=older_s)
        return msgspec.structs.replace(self, older=1, older_s=older_s, since_s=arrival_s, late_s=late_s)

    def has_header_of(self, later: "Heard") -> bool:
        """Whether the header does not tell when a later one was sent, since it is not filled in."""
        return later.stamp_s == self.stamp_s and later.header_id == self.header_id


def heard_after(
    last: Heard | None,
    message: Any,
    stamp: Stamp,
    findings: Findings,
    arrival_s: float,
    header_id: int | None = None,
    *,
    has_pose: bool,
) -> tuple[Heard | None, Stamp, bool]:
    """What is kept from now on, the stamp, and whether the message is used, which came after `last` of its topic.

    One that is repeated, or older, is not, but for a pose that comes again after `REPEATS_S`. One with the stamp of the
    last has none that can be used, see `has_header_of`. None is kept of one that is repeated or has no stamp.
    """
    if not stamp.is_known:
        return None, stamp, True
    heard = Heard(hash(msgspec.json.encode(message)), stamp.t_s, header_id, came_s=arrival_s)
    if last and last.content_hash == heard.content_hash:
        findings["message-repeated"] = None
        return None, stamp, has_pose and arrival_s - last.came_s > REPEATS_S
    if last and last.is_newer_than(heard, arrival_s):
        findings["message-reordered"] = None
        return last.after_older(heard, arrival_s), stamp, False
    if last and last.has_header_of(heard):
        findings.note("stamp-unchanged", "timestamp", message.timestamp, "as of its arrival")
        stamp = NO_STAMP
    return heard, stamp, True
