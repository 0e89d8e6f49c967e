"""A chain of lines, each with the hash of the line before: a change of one line requires a change of all after it.

The hash of the last line is also kept elsewhere (the service's log, the register, the first line of the next file), so
that a file that was rewritten as a whole is detected too.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256

FIRST_HASH = "0" * 64
"""The hash in the first line of the first file."""
_KEY = b'{"before":"'


class ChainBrokenError(ValueError):
    """A line does not carry the hash of the one before, or the end is missing."""


@dataclass(slots=True)
class HashChain:
    """Adds the hash to each line as it is written."""

    head: str = FIRST_HASH
    """SHA-256 of the last line, hexadecimal."""
    lines: int = 0
    first: str = FIRST_HASH
    """The hash in the first line."""

    def link(self, line: bytes) -> bytes:
        """The line, which is a JSON object, with the hash of the line before as its first key."""
        linked = b'%b%b",%b' % (_KEY, self.head.encode(), line[1:])
        self.head, self.lines = sha256(linked).hexdigest(), self.lines + 1
        return linked

    def end(self) -> bytes:
        """The last line: the number of lines before it."""
        return self.link(f'{{"end":{self.lines}}}\n'.encode())


def verified(lines: Iterable[bytes]) -> HashChain:
    """The chain of a whole file. Raises `ChainBrokenError`."""
    chain, last = HashChain(), b""
    for line in lines:
        carried = line[len(_KEY) : len(_KEY) + len(FIRST_HASH)].decode("ascii", "replace")
        if not line.startswith(_KEY) or (chain.lines and carried != chain.head):
            raise ChainBrokenError(f"line {chain.lines + 1} does not carry the hash of the line before it")
        if not chain.lines:
            chain.first = carried
        chain.head, chain.lines, last = sha256(line).hexdigest(), chain.lines + 1, line
    try:
        ended = json.loads(last)["end"]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ChainBrokenError(f"the end is missing after line {chain.lines}") from None
    if ended != chain.lines - 1:
        raise ChainBrokenError(f"the last line counts {ended} lines and there are {chain.lines - 1}")
    return chain
