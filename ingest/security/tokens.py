"""Bearer tokens and their owners. Secrets come from files or the environment, are kept as digests and never logged."""

import hashlib
import logging
import os
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Self

from ingest.plain_files import decoded, read_file

LEAST_LENGTH = 16
"""A shorter token can be guessed."""
MOST_BYTES = 1 << 16
"""A longer file holds no secret."""

log = logging.getLogger(__name__)


class SecretError(ValueError):
    """A secret can't be read. The message says what to change, and never the secret."""


def secret(source: str) -> str:
    """The secret at `env:NAME` or `file:PATH`, without surrounding white space. Raises `SecretError`."""
    kind, _, place = source.partition(":")
    if kind == "env":
        if place not in os.environ:
            raise SecretError(f"{source}: is not set; expected an environment variable with the secret")
        value = os.environ[place]
    else:
        try:
            value = decoded(read_file(Path(place), MOST_BYTES))
        except (OSError, UnicodeDecodeError) as error:
            raise SecretError(f"{source}: {type(error).__name__}; expected a readable file with the secret") from error
    value = value.strip()
    if len(value) < LEAST_LENGTH:
        raise SecretError(f"{source}: found {len(value)} characters; expected a secret of at least {LEAST_LENGTH}")
    return value


def secret_of(owner: str, source: str) -> str:
    """The secret of `source`. Raises `SecretError`, which names the owner."""
    try:
        return secret(source)
    except SecretError as error:
        raise SecretError(f"{owner}: {error}") from error


def renewed(source: str, before: str = "") -> str:
    """The secret of `source`. If it can't be read, that is logged, and `before` is returned."""
    try:
        return secret(source)
    except SecretError as error:
        log.error("%s: %s", "the old secret stays in use" if before else "a secret is missing", error)
        return before


def verify_tokens(sources: Mapping[str, str]) -> None:
    """Raises `SecretError` if the token of an owner can't be read, or two share one. `sources` as of `Tokens`."""
    digests = {owner: _digest(secret_of(owner, source)) for owner, source in sources.items()}
    if shared := _sharing(digests):
        raise SecretError(f"{', '.join(shared)} have the token of another; give each its own")


class Tokens:
    """Owners by token. `refresh` reads the sources again, so that a secret changes without a restart.

    An owner whose token can't be read, or is another's too, has the one before. One who has none gets in
    once that is mended: a role starts whatever has become of the files that were verified when the service started.
    """

    def __init__(self, sources: Mapping[str, str], before: Self | None = None) -> None:
        """`sources` gives each owner the source of its token. `before` has the tokens that were in use.

        Of those, owners whose source is the same have theirs until it is read again.
        """
        self._sources = dict(sources)
        self._digests: dict[str, bytes] = {}
        if before:
            same = dict(before._sources.items() & self._sources.items())
            self._digests = {owner: digest for owner, digest in before._digests.items() if owner in same}
        self._owners: dict[bytes, str] = {}
        self.refresh()

    def __bool__(self) -> bool:
        return bool(self._sources)

    def owner(self, authorization: str | None) -> str | None:
        """The owner of the token in an `Authorization` header. None if it is wrong or missing.

        Tokens are compared by digest, so that the time of the comparison reveals nothing about them.
        """
        scheme, _, token = (authorization or "").partition(" ")
        return self._owners.get(_digest(token.strip())) if scheme.casefold() == "bearer" else None

    def digest(self, owner: str) -> bytes | None:
        """The digest of an owner's present token."""
        return self._digests.get(owner)

    def refresh(self) -> None:
        """Read every source again. What can't be read, and what owners share, is logged and changes nothing."""
        found = dict(self._digests)
        for owner, source in self._sources.items():
            try:
                found[owner] = _digest(secret(source))
            except SecretError as error:
                self._log(owner, str(error))
        self._digests = self._without_shared(found)
        self._owners = {digest: owner for owner, digest in self._digests.items()}

    def _without_shared(self, found: Mapping[str, bytes]) -> dict[str, bytes]:
        """`found`, where those who share a token have the one before, or none.

        That one may have become another's. Then both have the ones before. No two of those are the same.
        """
        digests = dict(found)
        while shared := _sharing(digests):
            for owner in shared:
                del digests[owner]
                if owner in self._digests:
                    digests[owner] = self._digests[owner]
        for owner in found:
            if digests.get(owner) != found[owner]:
                self._log(owner, "it is the token of another; give each its own")
        return digests

    def _log(self, owner: str, reason: str) -> None:
        kept = "the earlier token of %s stays in use: %s" if owner in self._digests else "%s has no token: %s"
        log.error(kept, owner, reason)


def _sharing(digests: Mapping[str, bytes]) -> list[str]:
    """The owners of tokens that others have too."""
    counts = Counter(digests.values())
    return [owner for owner, digest in digests.items() if counts[digest] > 1]


def _digest(token: str) -> bytes:
    return hashlib.sha256(token.encode()).digest()
