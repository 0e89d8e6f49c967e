"""How much of the log rejected messages may fill, so that no sender's erase the recorded traffic of the others.

Within its rate a sender's rejected messages are recorded whole, beyond it by their beginning and hash, and beyond a
second rate not at all.
"""

from collections import OrderedDict
from dataclasses import dataclass
from enum import Enum

HEAD_BYTES = 200
"""What is recorded of the beginning of a message."""
LINE_BYTES = 300
"""The other keys of its line, about."""
BURST_S = 32.0
SENDER_BYTES_PER_S, ALL_BYTES_PER_S = 8192.0, 65536.0
"""Of lines with whole messages, and as much again of lines with beginnings."""
MOST_SENDERS = 1000


class RecordedPart(Enum):
    """How much of a rejected message is recorded."""

    WHOLE = "whole"
    HEAD = "head"
    NOTHING = "nothing"


@dataclass(slots=True, eq=False)
class _Allowance:
    """Bytes that may still be recorded: of whole messages and of beginnings."""

    rate: float
    at_s: float
    whole: float
    heads: float

    def refill(self, now_s: float) -> None:
        added, most = max(now_s - self.at_s, 0.0) * self.rate, self.rate * BURST_S
        self.whole, self.heads, self.at_s = min(self.whole + added, most), min(self.heads + added, most), now_s


class RejectedShares:
    """The allowances of all senders, and of all together: a sender may have many addresses."""

    def __init__(self) -> None:
        self._senders: OrderedDict[str, _Allowance] = OrderedDict()
        self._all = _full(ALL_BYTES_PER_S, 0.0)

    def admit(self, sender: str, message_bytes: int, now_s: float, topic_bytes: int = 0) -> RecordedPart:
        """How much to record of a rejected message of a sender: a vendor, or an address."""
        allowances = (self._of(sender, now_s), self._all)
        for allowance in allowances:
            allowance.refill(now_s)
        line_bytes = LINE_BYTES + topic_bytes
        whole_bytes, head_bytes = message_bytes + line_bytes, min(message_bytes, HEAD_BYTES) + line_bytes
        if all(allowance.whole >= whole_bytes for allowance in allowances):
            for allowance in allowances:
                allowance.whole -= whole_bytes
            return RecordedPart.WHOLE
        if all(allowance.heads >= head_bytes for allowance in allowances):
            for allowance in allowances:
                allowance.heads -= head_bytes
            return RecordedPart.HEAD
        return RecordedPart.NOTHING

    def _of(self, sender: str, now_s: float) -> _Allowance:
        known = self._senders.get(sender)
        if known is None:
            known = self._senders[sender] = _full(SENDER_BYTES_PER_S, now_s)
            if len(self._senders) > MOST_SENDERS:
                self._senders.popitem(last=False)
        else:
            self._senders.move_to_end(sender)
        return known


def _full(rate: float, now_s: float) -> _Allowance:
    return _Allowance(rate, now_s, rate * BURST_S, rate * BURST_S)
