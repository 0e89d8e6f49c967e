import pytest

from ingest.security.vendor_credentials import Refusal, VendorCredentials
from ingest.settings import Vendor

ALDER, BASALT = "alder-0123456789abcdef", "basalt-0123456789abcdef"


@pytest.fixture
def credentials(monkeypatch: pytest.MonkeyPatch) -> VendorCredentials:
    monkeypatch.setenv("ALDER", ALDER)
    monkeypatch.setenv("BASALT", BASALT)
    return VendorCredentials(
        (
            Vendor(name="Alder", token="env:ALDER"),
            Vendor(name="Basalt", token="env:BASALT", certificate_names=("fleet.basalt.example",)),
            Vendor(name="Corvid"),
        )
    )


def test_without_any_credentials_the_path_says_who_speaks() -> None:
    open_site = VendorCredentials((Vendor(name="Blue Line"),))
    assert not open_site.needed
    assert open_site.vendor("/blue line/?x=1", None, ()) == "Blue Line"
    assert open_site.vendor("/", None, ()) is None


def test_a_token_or_a_certificate_says_who_speaks(credentials: VendorCredentials) -> None:
    assert credentials.vendor("/", f"Bearer {ALDER}", ()) == "Alder"
    assert credentials.vendor("/Basalt", None, ("Fleet.Basalt.example",)) == "Basalt"


@pytest.mark.parametrize("path", ["/", "/Alder", "/Corvid"])
def test_once_one_vendor_has_credentials_every_connection_needs_them(credentials: VendorCredentials, path: str) -> None:
    for authorization, names in ((None, ()), ("Bearer guessed-0123456789abcdef", ()), (None, ("other.example",))):
        refusal = credentials.vendor(path, authorization, names)
        assert isinstance(refusal, Refusal)
        assert refusal.status == 401


def test_a_vendor_cannot_take_anothers_path(credentials: VendorCredentials) -> None:
    refusal = credentials.vendor("/Basalt", f"Bearer {ALDER}", ())
    assert isinstance(refusal, Refusal)
    assert (refusal.status, refusal.counted_as) == (403, "another-vendor")
