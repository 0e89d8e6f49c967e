import os
import ssl
from pathlib import Path

import pytest
import trustme
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
    load_pem_private_key,
)
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidMessage, InvalidStatus

from ingest.security.certificates import CertificateError, Certificates, server_context
from ingest.settings import Tls, Vendor
from tests.ingest.port.made_receiver import floor, until
from tests.ingest.security.made_tls import no_more_open_files, trusting, write


@pytest.fixture
def site_tls(authority: trustme.CA, site_tls: Tls, tmp_path: Path) -> Tls:
    """That of the others, where clients may show a certificate too."""
    authority.cert_pem.write_to_path(str(tmp_path / "clients.pem"))
    return site_tls.model_copy(update={"clients": str(tmp_path / "clients.pem")})


async def test_a_vendor_is_known_by_its_client_certificate(
    authority: trustme.CA, site_tls: Tls, caplog: pytest.LogCaptureFixture
) -> None:
    vendors = (Vendor(name="Alder", certificate_names=("alder-fleet",)),)
    async with floor(vendors, tls=site_tls) as served_floor:
        url = f"wss://127.0.0.1:{served_floor.receiver.port}"
        async with connect(url, ssl=trusting(authority, "alder-fleet")) as robot:
            await robot.send("hello")
            await until(lambda: served_floor.delivered)
        assert served_floor.delivered[0][2].vendor == "Alder"
        for stranger in (None, "basalt-fleet"):
            with pytest.raises(InvalidStatus) as refused:
                await connect(url, ssl=trusting(authority, stranger))
            assert refused.value.response.status_code == 401
        assert served_floor.count("unauthorised") == 2
        assert caplog.text.count("127.0.0.1 is refused, which is logged once an hour: send the vendor's token") == 1


async def test_a_certificate_of_a_foreign_authority_is_not_taken(
    authority: trustme.CA, site_tls: Tls, caplog: pytest.LogCaptureFixture
) -> None:
    vendors = (Vendor(name="Alder", certificate_names=("alder-fleet",)),)
    foreign = trusting(authority)
    trustme.CA().issue_cert(common_name="alder-fleet").configure_cert(foreign)
    async with floor(vendors, tls=site_tls) as served_floor:
        for _ in range(3):
            with pytest.raises((ssl.SSLError, ConnectionError, InvalidMessage)):
                await connect(f"wss://127.0.0.1:{served_floor.receiver.port}", ssl=foreign)
        await until(lambda: served_floor.count("tls-failed") == 3)
        assert caplog.text.count("127.0.0.1 is refused, which is logged once an hour: the TLS handshake failed: ") == 1
        assert served_floor.connections == 0


async def test_changed_certificates_hold_for_new_connections(authority: trustme.CA, tmp_path: Path) -> None:
    write(authority, tmp_path)
    file = tmp_path / "site.pem"
    async with floor(tls=Tls(certificate=str(file)), idle_timeout_s=0.4) as served_floor:
        url, renewed = f"wss://127.0.0.1:{served_floor.receiver.port}", trustme.CA()
        async with connect(url, ssl=trusting(authority)):
            write(renewed, tmp_path)
            os.utime(file, ns=(1, 1))

            async def taken_up() -> bool:
                try:
                    await (await connect(url, ssl=trusting(renewed))).close()
                except ssl.SSLError:
                    return False
                return True

            while not await taken_up():
                pass


def test_files_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    (tmp_path / "site.pem").write_text("no certificate")
    with pytest.raises(CertificateError, match=r"site\.pem"):
        server_context(Tls(certificate=str(tmp_path / "site.pem")))
    os.mkfifo(tmp_path / "pipe.pem")
    with pytest.raises(CertificateError, match=r"pipe\.pem is a pipe where a file is expected"):
        server_context(Tls(certificate=str(tmp_path / "pipe.pem")))
    encrypted = trustme.CA().issue_cert("127.0.0.1")
    key = load_pem_private_key(encrypted.private_key_pem.bytes(), None)
    locked = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"its password"))
    (tmp_path / "site.pem").write_bytes(locked + encrypted.cert_chain_pems[0].bytes())
    with pytest.raises(CertificateError, match=r"site\.pem"):
        server_context(Tls(certificate=str(tmp_path / "site.pem")))


@pytest.mark.parametrize("spoilt", ["key of the earlier", "no key", "no clients"])
async def test_files_that_do_not_fit_together_change_nothing_until_they_do(
    authority: trustme.CA, tmp_path: Path, spoilt: str, caplog: pytest.LogCaptureFixture
) -> None:
    """A renewal writes one file after the other."""
    files = {name: tmp_path / f"{name}.pem" for name in ("certificate", "key", "clients")}
    certificates = new_certificates(authority, files)
    async with floor(tls=Tls(**{name: str(file) for name, file in files.items()})) as served_floor:
        url = f"wss://127.0.0.1:{served_floor.receiver.port}"
        served_floor.receiver._certificates = certificates
        served_floor.receiver._handshakes._certificates = certificates  # type: ignore[union-attr]
        renewed = trustme.CA()
        good = {name: file.read_bytes() for name, file in files.items()}
        write_files(renewed, files)
        late = {"key of the earlier": "key", "no key": "key", "no clients": "clients"}[spoilt]
        after = files[late].read_bytes()
        files[late].write_bytes(good["key"] if spoilt == "key of the earlier" else b"")
        certificates.refresh()
        assert "the earlier certificates stay in use" in caplog.text
        await (await connect(url, ssl=trusting(authority))).close()
        files[late].write_bytes(after)
        certificates.refresh()
        await (await connect(url, ssl=trusting(renewed))).close()


async def test_a_port_that_begins_with_files_that_do_not_fit_together_takes_nobody_until_they_do(
    authority: trustme.CA, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    files = {name: tmp_path / f"{name}.pem" for name in ("certificate", "key", "clients")}
    write_files(authority, files)
    key = files["key"].read_bytes()
    files["key"].unlink()
    async with floor(tls=Tls(**{name: str(file) for name, file in files.items()})) as served_floor:
        assert "nobody can connect until the certificates can be used" in caplog.text
        url = f"wss://127.0.0.1:{served_floor.receiver.port}"
        anybody = trusting(authority)
        anybody.set_ciphers("ALL:@SECLEVEL=0")
        with pytest.raises((ssl.SSLError, ConnectionError, InvalidMessage)):
            await connect(url, ssl=anybody)
        await until(lambda: served_floor.count("tls-failed") == 1)
        files["key"].write_bytes(key)
        served_floor.receiver._certificates.refresh()  # type: ignore[union-attr]
        await (await connect(url, ssl=trusting(authority))).close()


@pytest.mark.parametrize("failing", ["the first", "a later"])
async def test_certificates_that_could_not_be_read_for_a_while_are_used_although_no_file_has_changed(
    authority: trustme.CA, tmp_path: Path, caplog: pytest.LogCaptureFixture, failing: str
) -> None:
    files = {name: tmp_path / f"{name}.pem" for name in ("certificate", "key", "clients")}
    write_files(authority, files)
    tls, newest = Tls(**{name: str(file) for name, file in files.items()}), authority
    if failing == "the first":
        with no_more_open_files():
            certificates = Certificates(tls)
    else:
        certificates, newest = Certificates(tls), trustme.CA()
        write_files(newest, files)
    with no_more_open_files():
        certificates.refresh()
        certificates.refresh()
    assert len([record for record in caplog.records if record.levelname == "ERROR"]) == 1
    certificates.refresh()
    in_use = certificates.context
    certificates.refresh()
    assert certificates.context is in_use
    async with floor(tls=tls) as served_floor:
        served_floor.receiver._handshakes._certificates = certificates  # type: ignore[union-attr]
        await (await connect(f"wss://127.0.0.1:{served_floor.receiver.port}", ssl=trusting(newest))).close()


async def test_an_authority_that_was_taken_out_is_not_trusted_after_the_files_are_read_again(
    authority: trustme.CA, tmp_path: Path
) -> None:
    files = {name: tmp_path / f"{name}.pem" for name in ("certificate", "key", "clients")}
    certificates, former = new_certificates(authority, files), trustme.CA()
    former.cert_pem.write_to_path(str(files["clients"]), append=True)
    certificates.refresh()
    vendors = (Vendor(name="Alder", certificate_names=("alder-fleet",)),)
    async with floor(vendors, tls=Tls(**{name: str(file) for name, file in files.items()})) as served_floor:
        url = f"wss://127.0.0.1:{served_floor.receiver.port}"
        served_floor.receiver._handshakes._certificates = certificates  # type: ignore[union-attr]
        formers = trusting(authority)
        former.issue_cert(common_name="alder-fleet").configure_cert(formers)
        await (await connect(url, ssl=formers)).close()
        authority.cert_pem.write_to_path(str(files["clients"]))
        certificates.refresh()
        with pytest.raises((ssl.SSLError, ConnectionError, InvalidMessage)):
            await connect(url, ssl=formers)
        await (await connect(url, ssl=trusting(authority, "alder-fleet"))).close()


def new_certificates(authority: trustme.CA, files: dict[str, Path]) -> Certificates:
    write_files(authority, files)
    return Certificates(Tls(**{name: str(file) for name, file in files.items()}))


def write_files(authority: trustme.CA, files: dict[str, Path]) -> None:
    issued = authority.issue_cert("127.0.0.1")
    issued.cert_chain_pems[0].write_to_path(str(files["certificate"]))
    issued.private_key_pem.write_to_path(str(files["key"]))
    authority.cert_pem.write_to_path(str(files["clients"]))
