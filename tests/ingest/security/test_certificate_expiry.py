"""Our reading of the end of certificates, compared with that of `cryptography`."""

import ssl
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
from cryptography.x509.oid import NameOID

from ingest.security.certificate_expiry import MOST_FILE_BYTES, expires_s
from ingest.security.certificates import server_context
from ingest.settings import Tls

BEGIN_S = datetime(1950, 1, 1, tzinfo=UTC).timestamp()
END_S = datetime(9999, 12, 31, tzinfo=UTC).timestamp()
TURN = datetime(2050, 1, 1, tzinfo=UTC)
"""From here on a certificate has the year with four digits."""
SECOND = timedelta(seconds=1)
KEYS: list[ed25519.Ed25519PrivateKey | ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey] = [
    ed25519.Ed25519PrivateKey.generate(),
    ec.generate_private_key(ec.SECP256R1()),
    ec.generate_private_key(ec.SECP521R1()),
    rsa.generate_private_key(65537, 2048),
]
"""By kind: the algorithm's identifier, which stands before the validity, has other lengths and parameters."""


def ends(count: int, rng: np.random.Generator) -> list[datetime]:
    drawn = rng.integers(int(BEGIN_S) + 2, int(END_S), count)
    near = [int(TURN.timestamp()) + int(off) for off in rng.integers(-(10**8), 10**8, count)]
    return [*(datetime.fromtimestamp(int(each), UTC) for each in (*drawn, *near)), TURN - SECOND, TURN]


def certificate(end: datetime, rng: np.random.Generator) -> x509.Certificate:
    """One with names and a serial number of any length, so that lengths have one to three bytes."""
    key = KEYS[rng.integers(len(KEYS))]
    parts = [
        x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, "x" * int(rng.integers(1, 65)))
        for _ in range(rng.integers(0, 12))
    ]
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "site"), *parts])
    made = x509.CertificateBuilder(
        name, name, key.public_key(), 1 + (int.from_bytes(rng.bytes(19)) >> int(rng.integers(0, 140)))
    )
    hosts = [x509.DNSName("a" * 50 + ".example")] * int(rng.integers(1, 40))
    made = made.not_valid_before(datetime.fromtimestamp(BEGIN_S, UTC)).not_valid_after(end)
    made = made.add_extension(x509.SubjectAlternativeName(hosts), critical=False)
    return made.sign(key, None if isinstance(key, ed25519.Ed25519PrivateKey) else hashes.SHA256())


def test_the_end_of_any_certificate_is_the_one_that_another_reader_finds(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    file, made = tmp_path / "site.pem", [certificate(end, rng) for end in ends(150, rng)]
    for each in made:
        file.write_bytes(each.public_bytes(Encoding.PEM))
        assert expires_s(str(file)) == each.not_valid_after_utc.timestamp()
    assert {len(each.tbs_certificate_bytes) > size for each in made for size in (0x7F, 0xFF)} == {True}
    assert any(len(each.issuer.public_bytes()) < 0x80 for each in made)
    assert any(len(each.issuer.public_bytes()) > 0x104 for each in made)


@pytest.mark.parametrize("line_end", [b"\n", b"\r\n"])
def test_of_a_chain_with_a_key_and_any_text_around_the_first_end_counts(tmp_path: Path, line_end: bytes) -> None:
    rng = np.random.default_rng(6)
    made = [certificate(end, rng) for end in ends(4, rng)]
    key = KEYS[3].private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    texts = [b"subject=CN = site", "Bag Attributes: \u00e9 -----".encode(), bytes(range(128, 256)), key, b""]
    parts = [part for number, each in enumerate(made) for part in (texts[number % 5], each.public_bytes(Encoding.PEM))]
    file = tmp_path / "chain.pem"
    file.write_bytes(b"\n".join(parts).replace(b"\n", line_end))
    assert expires_s(str(file)) == min(each.not_valid_after_utc for each in made).timestamp()


@pytest.mark.parametrize("label", ["CERTIFICATE", "X509 CERTIFICATE", "TRUSTED CERTIFICATE"])
def test_a_certificate_counts_under_every_name_under_which_a_port_takes_it(tmp_path: Path, label: str) -> None:
    file, made = tmp_path / "site.pem", certificate(TURN, np.random.default_rng(8))
    pem = made.public_bytes(Encoding.PEM).decode().replace("CERTIFICATE", label)
    key = next(key for key in KEYS if key.public_key() == made.public_key())
    file.write_text(pem + key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode())
    server_context(Tls(certificate=str(file)))
    assert expires_s(str(file)) == TURN.timestamp()


def test_damaged_certificates_have_no_end_or_one_and_never_raise(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    file, whole = tmp_path / "site.pem", certificate(TURN, rng).public_bytes(Encoding.DER)
    file.write_bytes(whole)
    assert expires_s(str(file)) is None, "the service reads no DER files, so none is watched"
    for _ in range(300):
        spoilt = bytearray(whole)
        for place in rng.integers(0, min(len(whole), 400), rng.integers(1, 4)):
            spoilt[place] = rng.integers(256)
        del spoilt[len(spoilt) - int(rng.integers(0, len(spoilt)) if rng.random() < 0.3 else 0) :]
        file.write_text(ssl.DER_cert_to_PEM_cert(bytes(spoilt)))
        assert isinstance(expires_s(str(file)), float | None)


def test_a_file_of_beginnings_takes_no_time(tmp_path: Path) -> None:
    file = tmp_path / "site.pem"
    file.write_bytes(b"-----BEGIN CERTIFICATE-----\n" * (MOST_FILE_BYTES // 20))
    began_s = time.process_time()
    assert expires_s(str(file)) is None
    assert time.process_time() - began_s < 1.0
