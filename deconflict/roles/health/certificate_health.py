"""Certificates that end soon or can't be used, as the operator face sees them."""

import logging
import ssl
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from typing import Any, NamedTuple

from deconflict.cluster.members_health import health_part
from deconflict.settings.site import Site
from ingest.security.certificate_expiry import expires_s
from ingest.security.certificates import CertificateError, client_context, server_context, signatures

EXPIRES = "deconflict_certificate_expires_timestamp_seconds"
WARNED_S = 14 * 86_400.0
"""How long ahead the end of a certificate is warned of."""

log = logging.getLogger(__name__)


class UsedFiles(NamedTuple):
    """Files that are loaded together."""

    files: dict[str, str]
    """Those with certificates, by key of the site file."""
    load: Callable[[], ssl.SSLContext]
    """Raises `CertificateError`."""
    key: str = ""
    """The file of the private key, if it is another one."""

    def all(self) -> tuple[str, ...]:
        return *self.files.values(), *filter(None, [self.key])


class ReadFiles(NamedTuple):
    """What was found, of files that have not changed since. A problem may pass without a change."""

    files: tuple[str, ...]
    signatures: tuple[tuple[int, ...], ...]
    expires_s: dict[str, float]
    """By key, when the first certificate ends of those in use."""
    problem: str


def used_files(site: Site) -> Iterator[tuple[str, UsedFiles]]:
    """By section of the site file, what it names."""
    for section, tls in (("receiver.tls", site.receiver.tls), ("operator.tls", site.operator.tls)):
        if tls:
            files = {"certificate": tls.certificate, "clients": tls.clients}
            yield section, UsedFiles(_named(section, files), partial(server_context, tls), tls.key)
    if site.cluster:
        ca, certificate = site.cluster.ca, site.cluster.certificate
        files = {"ca": ca, "certificate": certificate}
        yield "cluster", UsedFiles(_named("cluster", files), partial(client_context, ca, certificate))
    brokers = [("mqtt", site.mqtt.ca)] if site.mqtt else []
    for section, ca in (*brokers, *((f"mqtt_sources.{source.name}", source.ca) for source in site.mqtt_sources)):
        yield section, UsedFiles(_named(section, {"ca": ca}), partial(client_context, ca))


def _named(section: str, files: dict[str, str]) -> dict[str, str]:
    return {f"{section}.{key}": file for key, file in files.items() if file}


class CertificateHealth:
    """When each certificate ends. Files are read again once they have changed, and while they can't be used.

    All times are of the host's clock.
    """

    def __init__(self) -> None:
        self._read: dict[str, ReadFiles] = {}
        """By section."""
        self._told: set[tuple[str, float, bool]] = set()

    def expiry_s(self, site: Site) -> dict[str, float]:
        """By key of the site file, when the first certificate ends that is in use."""
        self._look(site)
        return {key: end_s for read in self._read.values() for key, end_s in read.expires_s.items()}

    def document(self, site: Site, now_s: float) -> dict[str, Any]:
        """The part `certificates` of the health. Each that ends soon, and each that has ended, is logged once."""
        expiry_s = self.expiry_s(site)
        ending = {key: end_s for key, end_s in expiry_s.items() if end_s - now_s < WARNED_S}
        for key, end_s in ending.items():
            if (key, end_s, end_s <= now_s) not in self._told:
                self._told.add((key, end_s, end_s <= now_s))
                log.warning("%s; renew it", _sentence(key, end_s, now_s))
        reasons = [
            f"the files of {section} can't be used ({read.problem}); what was read before stays in use, "
            "until a role restarts: then nobody connects by TLS before they can be used"
            for section, read in self._read.items()
            if read.problem
        ]
        if ending:
            sentences = "; ".join(_sentence(key, end_s, now_s) for key, end_s in sorted(ending.items()))
            reasons.append(f"{sentences}; renew what ends, a changed file is read within seconds")
        return health_part(reasons, expires_s=expiry_s)

    def _look(self, site: Site) -> None:
        before, self._read = self._read, {}
        for section, used in used_files(site):
            if files := used.all():
                self._read[section] = _read(used, files, before.get(section))


def _read(used: UsedFiles, files: tuple[str, ...], before: ReadFiles | None) -> ReadFiles:
    now = signatures(files)
    if before and not before.problem and (before.files, before.signatures) == (files, now):
        return before
    try:
        used.load()
    except CertificateError as error:
        problem = str(error)
        if before and before.files == files:
            return before._replace(signatures=now, problem=problem)
    else:
        problem = ""
    ends = {key: expires_s(file) for key, file in used.files.items()}
    return ReadFiles(files, now, {key: end_s for key, end_s in ends.items() if end_s is not None}, problem)


def _sentence(key: str, end_s: float, now_s: float) -> str:
    when = f"{datetime.fromtimestamp(end_s, UTC):%Y-%m-%d %H:%M} UTC"
    return f"a certificate of {key} {'has ended' if end_s <= now_s else 'ends'} at {when}"
