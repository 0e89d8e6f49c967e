"""The newest message of one topic of a robot, by which a later one is known to be repeated or late."""

import msgspec

REORDERED_S = 3.0
"""A message that is older than another by more comes from a clock that was set back."""
MOST_SAME_STAMPS = 20
"""As many messages may have the same stamp, if their numbers rise: those of two seconds, with stamps of whole ones."""


class Heard(msgspec.Struct, frozen=True, gc=False):
    """What is kept of a message. Languages without numbers of messages have no `header_id`."""

    content_hash: int
    stamp_s: float
    header_id: int | None = None
    same_stamps: int = 0
    """Messages just before it that have its stamp."""

    def is_repeated_by(self, later: "Heard") -> bool:
        return later.content_hash == self.content_hash

    def is_newer_than(self, later: "Heard") -> bool:
        """Whether a message that came later is older. A sender whose clock was set back may still count its messages.

        If it counts nothing, only a message that is older by little is late.
        """
        number, later_number = self.header_id or 0, later.header_id or 0
        if later_number == number:
            return 0.0 < self.stamp_s - later.stamp_s <= REORDERED_S
        return later.stamp_s < self.stamp_s and later_number < number

    def has_header_of(self, later: "Heard") -> bool:
        """Whether the header does not tell when a later one was sent: it is not filled in, or the clock stands."""
        is_counted = later.header_id != self.header_id and later.same_stamps <= MOST_SAME_STAMPS
        return later.stamp_s == self.stamp_s and not is_counted


def message_after(last: Heard | None, raw: bytes, stamp_s: float, header_id: int | None = None) -> Heard:
    """What is kept of a message that came after `last` of the same topic."""
    same_stamps = last.same_stamps + 1 if last and last.stamp_s == stamp_s else 0
    return Heard(hash(raw), stamp_s, header_id, same_stamps)
