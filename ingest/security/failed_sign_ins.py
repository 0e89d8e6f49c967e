"""Slows down guessing: each further wrong token from one address is answered later."""

from collections import OrderedDict

FREE = 3
"""Wrong tokens that are answered at once."""
STEP_S, LONGEST_S = 0.25, 3.0
"""How much later each further one is answered, and the longest delay."""
FORGIVEN_AFTER_S = 10.0
"""How long it takes until one wrong token is forgotten."""
MOST_ADDRESSES = 10_000


class FailedSignIns:
    """The wrong tokens of each address. A right token is never delayed, whatever its address has sent before."""

    def __init__(self) -> None:
        self._addresses: OrderedDict[str, tuple[float, float]] = OrderedDict()
        """By address, how many there were and when the last one was; the one heard longest ago first."""

    def delay_s(self, address: str, now_s: float) -> float:
        """Note a wrong token. Returns how long its answer should wait. `now_s` is of a monotonic clock."""
        count, last_s = self._addresses.pop(address, (0.0, now_s))
        count = max(count - (now_s - last_s) / FORGIVEN_AFTER_S, 0.0) + 1.0
        self._addresses[address] = count, now_s
        if len(self._addresses) > MOST_ADDRESSES:
            self._addresses.popitem(last=False)
        return min(max(count - FREE, 0.0) * STEP_S, LONGEST_S)
