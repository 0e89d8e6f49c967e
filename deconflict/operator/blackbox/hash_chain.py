"""Lines of which each carries the hash of the one before: who changes one must change all that follow.

The hash of the last line is told elsewhere too (the service's log, the register, the next file's first line), so that
a file that was written anew from its first line on is found out as well.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256

NOTHING = "0" * 64
"""What the first line of all carries."""
_KEY = b'{"before":"'


class ChainBrokenError(ValueError):
    """A line does not carry the hash of the one before, or the end is missing."""


@dataclass(slots=True)
class Chain:
    """Links lines as they are written."""

    head: str = NOTHING
    """SHA-256 of the last line, hexadecimal."""
    lines: int = 0
    first: str = NOTHING
    """What the first line carries."""

    def link(self, line: bytes) -> bytes:
        """A line that is a JSON object, with the hash of the one before as its first key."""
        linked = b'%b%b",%b' % (_KEY, self.head.encode(), line[1:])
        self.head, self.lines = sha256(linked).hexdigest(), self.lines + 1
        return linked

    def end(self) -> bytes:
        """The last line: it says how many there are before it."""
        return self.link(f'{{"end":{self.lines}}}\n'.encode())


def verified(lines: Iterable[bytes]) -> Chain:
    """The chain of a whole file. Raises `ChainBrokenError`."""
    chain, last = Chain(), b""
    for line in lines:
        carried = line[len(_KEY) : len(_KEY) + len(NOTHING)].decode("ascii", "replace")
        if not line.startswith(_KEY) or (chain.lines and carried != chain.head):
            raise ChainBrokenError(f"line {chain.lines + 1} does not carry the hash of the line before it")
        if not chain.lines:
            chain.first = carried
        chain.head, chain.lines, last = sha256(line).hexdigest(), chain.lines + 1, line
    try:
        ended = json.loads(last)["end"]
    except (ValueError, KeyError):
        raise ChainBrokenError(f"the end is missing after line {chain.lines}") from None
    if ended != chain.lines - 1:
        raise ChainBrokenError(f"the end tells of {ended} lines and there are {chain.lines - 1}")
    return chain
