"""Certificates that end."""

import logging
import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import trustme
from cryptography import x509

from deconflict.roles.health.certificate_health import CertificateHealth
from deconflict.settings.outlet_settings import Mqtt
from deconflict.settings.site import Operator, Site
from ingest.security.certificate_expiry import expires_s
from ingest.settings import Tls
from tests.ingest.security.made_tls import no_more_open_files

NOW = datetime(2030, 6, 1, tzinfo=UTC)


def written(file: Path, *ends: datetime) -> Path:
    authority = trustme.CA()
    issued = [authority.issue_cert("127.0.0.1", not_after=end) for end in ends]
    pems = [each.cert_chain_pems[0].bytes() for each in issued]
    file.write_bytes(b"a comment\n".join([*pems, issued[0].private_key_pem.bytes()]))
    return file


@pytest.mark.parametrize("year", [2027, 2049, 2050, 2099])
def test_the_first_end_of_a_file_is_found(tmp_path: Path, year: int) -> None:
    file = written(tmp_path / "site.pem", datetime(2120, 1, 1, tzinfo=UTC), datetime(year, 12, 31, 5, 6, 7, tzinfo=UTC))
    [_, second] = x509.load_pem_x509_certificates(file.read_bytes())
    assert expires_s(str(file)) == second.not_valid_after_utc.timestamp()


def test_what_is_no_certificate_has_no_end(tmp_path: Path) -> None:
    (tmp_path / "empty.pem").touch()
    os.mkfifo(tmp_path / "pipe.pem")
    whole = written(tmp_path / "site.pem", NOW).read_text()
    first = whole.index("\n") + 1
    for number, spoilt in enumerate((whole[:200], whole[:first] + "AAAA" + whole[first + 4 :])):
        (tmp_path / f"spoilt-{number}.pem").write_text(spoilt)
    for name in ("none.pem", "empty.pem", "pipe.pem", "spoilt-0.pem", "spoilt-1.pem", "."):
        assert expires_s(str(tmp_path / name)) is None


def test_the_end_of_a_certificate_is_told_two_weeks_ahead_and_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = written(tmp_path / "site.pem", NOW)
    other = written(tmp_path / "ca.pem", NOW + timedelta(days=300))
    site = Site(
        operator=Operator(tls=Tls(certificate=str(file), clients="")), mqtt=Mqtt(host="b", tls=True, ca=str(other))
    )
    health = CertificateHealth()

    def told(days: float) -> str:
        return str(health.document(site, (NOW + timedelta(days=days)).timestamp())["status"])

    with caplog.at_level(logging.WARNING):
        assert [told(-15), caplog.text] == ["ok", ""]
        assert [told(-13.9), told(-13.8)] == ["degraded", "degraded"]
        assert [record.getMessage() for record in caplog.records] == [
            "a certificate of operator.tls.certificate ends at 2030-06-01 00:00 UTC; renew it"
        ]
        assert told(1) == "degraded"
        assert "has ended" in caplog.records[-1].getMessage()
        written(file, NOW + timedelta(days=90))
        assert [told(1), len(caplog.records)] == ["ok", 2]
    assert health.expiry_s(site)["mqtt.ca"] == (NOW + timedelta(days=300)).timestamp()


def test_files_that_do_not_fit_together_are_said_with_the_end_of_those_in_use(tmp_path: Path) -> None:
    file = written(tmp_path / "site.pem", NOW)
    site = Site(operator=Operator(tls=Tls(certificate=str(file), clients=str(file))))
    health = CertificateHealth()
    now_s = (NOW - timedelta(days=30)).timestamp()
    ends_s = health.document(site, now_s)["expires_s"]
    assert set(ends_s) == {"operator.tls.certificate", "operator.tls.clients"}

    whole = file.read_bytes()
    renewed = written(tmp_path / "renewed.pem", NOW + timedelta(days=90)).read_bytes()
    file.write_bytes(renewed.split(b"a comment")[0] + whole.split(b"a comment")[1])
    spoilt = health.document(site, now_s)
    assert (spoilt["status"], spoilt["expires_s"]) == ("degraded", ends_s)
    assert "the files of operator.tls can't be used" in spoilt["reason"]
    file.unlink()
    assert "No such file" in health.document(site, now_s)["reason"]
    file.write_bytes(whole)
    assert health.document(site, now_s) == {"status": "ok", "expires_s": ends_s}


def test_files_that_can_be_used_again_with_no_change_are_said_to_be_in_order(tmp_path: Path) -> None:
    certificate = tmp_path / "site.pem"
    trustme.CA().issue_cert("127.0.0.1").private_key_and_cert_chain_pem.write_to_path(str(certificate))
    site, health = Site(operator=Operator(tls=Tls(certificate=str(certificate)))), CertificateHealth()
    with no_more_open_files():
        assert "can't be used" in health.document(site, 0.0)["reason"]
    found = health.document(site, 0.0)
    assert (found["status"], list(found["expires_s"])) == ("ok", ["operator.tls.certificate"])
