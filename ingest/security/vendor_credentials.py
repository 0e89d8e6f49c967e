"""Which vendor a connection may speak for."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

from ingest.security.tokens import Tokens
from ingest.settings import Vendor


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a connection is refused."""

    status: int
    """HTTP status of the answer."""
    counted_as: str
    """Reason in the metric of refused connections."""
    reason: str


class VendorCredentials:
    """Each vendor's token and certificate names.

    If no vendor has credentials, a connection speaks for the vendor that its path names. If one vendor has some, every
    connection needs credentials.
    """

    def __init__(self, vendors: Sequence[Vendor], before: Self | None = None) -> None:
        """`before` as of `Tokens`."""
        self._vendors = {vendor.name.casefold(): vendor.name for vendor in vendors}
        self._tokens: Tokens = Tokens(token_sources(vendors), before._tokens if before else None)
        self._names = {name.casefold(): vendor.name for vendor in vendors for name in vendor.certificate_names}

    @property
    def needed(self) -> bool:
        """Whether connections need credentials."""
        return bool(self._tokens or self._names)

    def known(self, vendor: str) -> bool:
        """Whether the site file has this vendor."""
        return vendor.casefold() in self._vendors

    def refresh(self) -> None:
        """Read the tokens again."""
        self._tokens.refresh()

    def vendor(self, path: str, authorization: str | None, certificate_names: Sequence[str]) -> str | Refusal | None:
        """The vendor that a connection speaks for. None if nothing names one and credentials are not needed."""
        named = self._vendors.get(path.partition("?")[0].strip("/").casefold())
        if not self.needed:
            return named
        proven = self._tokens.owner(authorization) or self._of_certificate(certificate_names)
        if proven is None:
            reason = "send the vendor's token as 'Authorization: Bearer TOKEN', or its client certificate"
            return Refusal(401, "unauthorised", reason)
        if named not in (None, proven):
            return Refusal(
                403, "another-vendor", f"these credentials are {proven}'s; connect to the path / or /{proven}"
            )
        return proven

    def _of_certificate(self, certificate_names: Sequence[str]) -> str | None:
        found = {self._names[name.casefold()] for name in certificate_names if name.casefold() in self._names}
        return found.pop() if len(found) == 1 else None


def token_sources(vendors: Iterable[Vendor]) -> dict[str, str]:
    """By vendor that has a token, its source."""
    return {vendor.name: vendor.token for vendor in vendors if vendor.token}
