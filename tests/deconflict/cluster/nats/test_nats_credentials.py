"""A NATS server that asks who is there."""

import asyncio
import logging
from pathlib import Path

import pytest
import trustme

from deconflict.cluster.nats.bus import Bus
from deconflict.cluster.nats.nats_credentials import certificates, credentials
from deconflict.settings.cluster_settings import Cluster
from deconflict.settings.site_file import SiteError, site_from_document
from ingest.security.certificates import CertificateError
from ingest.security.tokens import SecretError
from tests.deconflict.cluster.made_cluster import Broker, needs_server
from tests.helpers.patience import PATIENCE_S

SECRET, OTHER = "correct-horse-battery", "another-horse-battery"


async def reaches(broker: Broker, **fields: str) -> bool:
    """Whether a bus opens, and reads the table."""
    bus = Bus(Cluster(nats=(broker.address,), **fields), 1.0)
    async with asyncio.timeout(300):
        await bus.open()
        table = await bus.state.table()
    await bus.close()
    return table == (0, None)


@needs_server
async def test_a_server_with_a_token_accepts_only_members_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    broker = Broker(tmp_path / "nats", "--auth", SECRET)
    try:
        monkeypatch.setenv("NATS_TOKEN", SECRET)
        assert await reaches(broker, token="env:NATS_TOKEN")
        (tmp_path / "token").write_text(OTHER)
        opening = asyncio.create_task(reaches(broker, token=f"file:{tmp_path / 'token'}"))
        with caplog.at_level(logging.WARNING):
            async with asyncio.timeout(300):
                while "uthorization" not in caplog.text:
                    await asyncio.sleep(0.05)
        assert not opening.done()
        (tmp_path / "token").write_text(SECRET)
        assert await opening, "a secret that was put right takes no restart"
        assert SECRET not in caplog.text
    finally:
        broker.kill()


@needs_server
async def test_a_member_signs_in_to_a_server_with_a_user_and_a_certificate(tmp_path: Path) -> None:
    authority = trustme.CA()
    server, client = authority.issue_cert("127.0.0.1"), authority.issue_cert("engine")
    files = {name: str(tmp_path / name) for name in ("ca", "server", "key", "client", "password")}
    authority.cert_pem.write_to_path(files["ca"])
    server.cert_chain_pems[0].write_to_path(files["server"])
    server.private_key_pem.write_to_path(files["key"])
    client.private_key_and_cert_chain_pem.write_to_path(files["client"])
    Path(files["password"]).write_text(SECRET)
    tls = ["--tlsverify", "--tlscacert", files["ca"], "--tlscert", files["server"], "--tlskey", files["key"]]
    broker = Broker(tmp_path / "nats", "--user", "ada", "--pass", SECRET, *tls)
    try:
        known = {"user": "ada", "password": f"file:{files['password']}"}
        assert await reaches(broker, **known, ca=files["ca"], certificate=files["client"])
    finally:
        broker.kill()


@needs_server
async def test_renewed_certificates_hold_with_the_next_connection_to_the_servers(tmp_path: Path) -> None:
    files = {name: tmp_path / name for name in ("ca", "server", "key", "client")}
    options = {"--tlscacert": "ca", "--tlscert": "server", "--tlskey": "key"}
    write_all(trustme.CA(), files)
    broker = Broker(
        tmp_path / "nats", "--tlsverify", *(part for key, name in options.items() for part in (key, str(files[name])))
    )
    bus = Bus(Cluster(nats=(broker.address,), ca=str(files["ca"]), certificate=str(files["client"])), 1.0)
    try:
        async with asyncio.timeout(PATIENCE_S):
            await bus.open()
            broker.kill()
            while bus.connection.is_connected():
                await asyncio.sleep(0.01)
            write_all(trustme.CA(), files)
            broker.start()
            while not bus.connection.is_connected():
                await asyncio.sleep(0.01)
    finally:
        await bus.close()
        broker.kill()


def write_all(authority: trustme.CA, files: dict[str, Path]) -> None:
    server, client = authority.issue_cert("127.0.0.1"), authority.issue_cert("engine")
    authority.cert_pem.write_to_path(str(files["ca"]))
    server.cert_chain_pems[0].write_to_path(str(files["server"]))
    server.private_key_pem.write_to_path(str(files["key"]))
    client.private_key_and_cert_chain_pem.write_to_path(str(files["client"]))


def test_missing_credentials_are_named_before_anything_starts(tmp_path: Path) -> None:
    here = {"nats": ("nats://127.0.0.1",)}
    with pytest.raises(SecretError, match="NO_SUCH_TOKEN"):
        credentials(Cluster(**here, token="env:NO_SUCH_TOKEN"))
    with pytest.raises(CertificateError, match="no-such"):
        certificates(Cluster(**here, ca=str(tmp_path / "no-such.pem")))
    assert credentials(Cluster(**here)) == {}


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"token": "env:A", "user": "ada", "password": "env:B"}, "one or the other"),
        ({"user": "ada"}, "cluster.password"),
        ({"password": "env:B"}, "cluster.user"),
        ({"certificate": "engine.pem"}, "over TLS alone"),
        ({"token": "hunter2"}, "not the secret itself"),
    ],
)
def test_invalid_credentials_name_the_key(fields: dict[str, str], says: str) -> None:
    with pytest.raises(SiteError, match=says):
        site_from_document({"cluster": {"nats": ["nats://a"], **fields}})
