"""The newest message of one topic of a robot, by which a later one is known to be repeated or late."""

from math import nan
from typing import Any

import msgspec

from ingest.languages.rules import Findings
from ingest.languages.timestamps import NO_STAMP, Stamp

RESTARTED = 20
"""The same as `STEPPED_BACK` if their numbers are lower, too, as those of messages that a broker kept back are."""
STEPPED_BACK = 3
"""After so many older messages in a row, of which each is newer than the one before it, the clock was set back."""


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

    def is_newer_than(self, later: "Heard") -> bool:
        """Whether a message that came later is older. A sender whose clock was set back may still count its messages.

        If it does not, or began to count anew, older messages in a row show it.
        """
        number, later_number = self.header_id or 0, later.header_id or 0
        if later.stamp_s >= self.stamp_s or later_number > number:
            return False
        return self.after_older(later).older < (RESTARTED if later_number < number else STEPPED_BACK)

    def after_older(self, later: "Heard") -> "Heard":
        """What is kept of this message after an older one has come."""
        older = self.older + 1 if later.stamp_s > self.older_s else 1
        return msgspec.structs.replace(self, older=older, older_s=later.stamp_s)

    def has_header_of(self, later: "Heard") -> bool:
        """Whether the header does not tell when a later one was sent, since it is not filled in."""
        return later.stamp_s == self.stamp_s and later.header_id == self.header_id


def heard_after(
    last: Heard | None, message: Any, stamp: Stamp, findings: Findings, header_id: int | None = None
) -> tuple[Heard | None, Stamp, bool]:
    """What is kept from now on, the stamp, and whether the message is used, which came after `last` of its topic.

    One that is repeated, or older, is not. One with the stamp of the last has none that can be used, see
    `has_header_of`. None is kept of one that is repeated or has no stamp.
    """
    if not stamp.is_known:
        return None, stamp, True
    heard = Heard(hash(msgspec.json.encode(message)), stamp.t_s, header_id)
    if last and last.content_hash == heard.content_hash:
        findings["message-repeated"] = None
        return None, stamp, False
    if last and last.is_newer_than(heard):
        findings["message-reordered"] = None
        return last.after_older(heard), stamp, False
    if last and last.has_header_of(heard):
        findings.note("stamp-unchanged", "timestamp", message.timestamp, "as of its arrival")
        stamp = NO_STAMP
    return heard, stamp, True
