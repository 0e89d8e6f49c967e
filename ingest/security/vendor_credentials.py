"""For which vendor a connection may speak."""

from collections.abc import Sequence
from dataclasses import dataclass

from ingest.security.tokens import Tokens
from ingest.settings import Vendor


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a connection is not let in."""

    status: int
    counted_as: str
    reason: str


class VendorCredentials:
    """Each vendor's token and certificate names.

    Where no vendor has any, a connection speaks for whom its path names. Once one has, every connection needs one.
    """

    def __init__(self, vendors: Sequence[Vendor]) -> None:
        """Raises `SecretError` where a token can't be had."""
        self._vendors = {vendor.name.casefold(): vendor.name for vendor in vendors}
        self._tokens = Tokens({vendor.name: vendor.token for vendor in vendors if vendor.token})
        self._names = {name.casefold(): vendor.name for vendor in vendors for name in vendor.certificate_names}

    @property
    def needed(self) -> bool:
        return bool(self._tokens or self._names)

    def known(self, vendor: str) -> bool:
        """Whether the site file has this vendor."""
        return vendor.casefold() in self._vendors

    def refresh(self) -> None:
        """Read the tokens again."""
        self._tokens.refresh()

    def vendor(self, path: str, authorization: str | None, certificate_names: Sequence[str]) -> str | Refusal | None:
        """The vendor that a connection speaks for; None where nothing says which and nothing needs to."""
        named = self._vendors.get(path.partition("?")[0].strip("/").casefold())
        if not self.needed:
            return named
        shown = self._tokens.owner(authorization) or self._of_certificate(certificate_names)
        if shown is None:
            reason = "send the vendor's token as 'Authorization: Bearer TOKEN', or its client certificate"
            return Refusal(401, "unauthorised", reason)
        if named not in (None, shown):
            return Refusal(403, "another-vendor", f"these credentials are {shown}'s; connect to the path / or /{shown}")
        return shown

    def _of_certificate(self, certificate_names: Sequence[str]) -> str | None:
        found = {self._names[name.casefold()] for name in certificate_names if name.casefold() in self._names}
        return found.pop() if len(found) == 1 else None
