"""Bearer tokens: whose each is. Secrets come from files or the environment, are kept as digests and never logged."""

import hashlib
import logging
import os
from collections.abc import Mapping
from pathlib import Path

LEAST_LENGTH = 16
"""A shorter token can be guessed."""

log = logging.getLogger(__name__)


class SecretError(ValueError):
    """A secret that can't be had; the message says what to change, and never the secret."""


def secret(source: str) -> str:
    """The secret at `env:NAME` or `file:PATH`, without surrounding white space. Raises `SecretError`."""
    kind, _, place = source.partition(":")
    if kind == "env":
        value = os.environ.get(place, "")
    else:
        try:
            value = Path(place).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise SecretError(f"{source}: {type(error).__name__}; expected a readable file with the secret") from error
    value = value.strip()
    if len(value) < LEAST_LENGTH:
        raise SecretError(f"{source}: found {len(value)} characters; expected a secret of at least {LEAST_LENGTH}")
    return value


def renewed(source: str, before: str) -> str:
    """The secret as it is now; what it was before, and a word in the log, where it can't be had."""
    try:
        return secret(source)
    except SecretError as error:
        log.error("a secret stays as it was: %s", error)
        return before


class Tokens:
    """Owners by token. `refresh` reads the sources again, so that a secret changes without a restart."""

    def __init__(self, sources: Mapping[str, str]) -> None:
        """`sources` gives each owner the source of its token. Raises `SecretError`, also where two share one."""
        self._sources = dict(sources)
        self._digests = {owner: _digest(secret(source)) for owner, source in self._sources.items()}
        self._owners = self._by_digest()

    def __bool__(self) -> bool:
        return bool(self._sources)

    def owner(self, authorization: str | None) -> str | None:
        """Whose token an `Authorization` header carries; None for a wrong or missing one.

        Tokens are compared by digest, so that the time it takes tells nothing of them.
        """
        scheme, _, token = (authorization or "").partition(" ")
        return self._owners.get(_digest(token.strip())) if scheme.casefold() == "bearer" else None

    def digest(self, owner: str) -> bytes | None:
        """Of the token that an owner has now."""
        return self._digests.get(owner)

    def refresh(self) -> None:
        """Read every source again; one that can't be read keeps its last token and is logged."""
        before = dict(self._digests)
        for owner, source in self._sources.items():
            try:
                self._digests[owner] = _digest(secret(source))
            except SecretError as error:
                log.error("the token of %s stays as it was: %s", owner, error)
        try:
            self._owners = self._by_digest()
        except SecretError as error:
            log.error("tokens stay as they were: %s", error)
            self._digests = before

    def _by_digest(self) -> dict[bytes, str]:
        owners = {digest: owner for owner, digest in self._digests.items()}
        if len(owners) < len(self._digests):
            shared = [owner for owner, digest in self._digests.items() if owners[digest] != owner]
            raise SecretError(f"{', '.join(shared)} has the token of another; give each its own")
        return owners


def _digest(token: str) -> bytes:
    return hashlib.sha256(token.encode()).digest()
