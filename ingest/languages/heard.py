"""The newest message of one topic of a robot, by which a later one is known to be repeated or late."""

import msgspec

REORDERED_S = 3.0
"""A message that is older than another by more comes from a clock that was set back."""


class Heard(msgspec.Struct, frozen=True, gc=False):
    """What is kept of a message. Languages without numbers of messages have no `header_id`."""

    content_hash: int
    stamp_s: float
    header_id: int | None = None

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
        """Whether nothing but the content tells them apart, as the sender fills in no header or its clock stands."""
        return later.stamp_s == self.stamp_s and later.header_id == self.header_id
