"""Certificates that end soon, as the operator face sees them."""

import logging
from datetime import UTC, datetime
from typing import Any

from deconflict.settings.site import Site
from ingest.security.certificate_expiry import expires_s
from ingest.security.certificates import signatures

EXPIRES = "deconflict_certificate_expires_timestamp_seconds"
WARNED_S = 14 * 86_400.0
"""How long ahead the end of a certificate is warned of."""

log = logging.getLogger(__name__)


def certificate_files(site: Site) -> dict[str, str]:
    """The files with certificates that the site file names, by key."""
    files: dict[str, str] = {}
    for section, tls in (("receiver", site.receiver.tls), ("operator", site.operator.tls)):
        if tls:
            files |= {f"{section}.tls.certificate": tls.certificate, f"{section}.tls.clients": tls.clients}
    if site.cluster:
        files |= {"cluster.ca": site.cluster.ca, "cluster.certificate": site.cluster.certificate}
    if site.mqtt:
        files["mqtt.ca"] = site.mqtt.ca
    files |= {f"mqtt_sources.{source.name}.ca": source.ca for source in site.mqtt_sources}
    return {key: file for key, file in files.items() if file}


class CertificateHealth:
    """When each certificate ends. Files are read again once they have changed. All times are of the host's clock."""

    def __init__(self) -> None:
        self._read: dict[str, tuple[object, float | None]] = {}
        """By file, what it was when it was read, and when its first certificate ends."""
        self._told: set[tuple[str, float, bool]] = set()

    def expiry_s(self, site: Site) -> dict[str, float]:
        """By key of the site file, when the first certificate ends. Files that can't be read are left out."""
        ends = {key: self._end_s(file) for key, file in certificate_files(site).items()}
        return {key: end_s for key, end_s in ends.items() if end_s is not None}

    def document(self, site: Site, now_s: float) -> dict[str, Any]:
        """The part `certificates` of the health. Each that ends soon, and each that has ended, is logged once."""
        expiry_s = self.expiry_s(site)
        ending = {key: end_s for key, end_s in expiry_s.items() if end_s - now_s < WARNED_S}
        for key, end_s in ending.items():
            if (key, end_s, end_s <= now_s) not in self._told:
                self._told.add((key, end_s, end_s <= now_s))
                log.warning("%s; renew it", _sentence(key, end_s, now_s))
        if not ending:
            return {"status": "ok", "expires_s": expiry_s}
        sentences = "; ".join(_sentence(key, end_s, now_s) for key, end_s in sorted(ending.items()))
        reason = f"{sentences}; renew what ends, a changed file is read within seconds"
        return {"status": "degraded", "reason": reason, "expires_s": expiry_s}

    def _end_s(self, file: str) -> float | None:
        now = signatures((file,))
        before = self._read.get(file)
        if before is None or before[0] != now:
            before = self._read[file] = now, expires_s(file)
        return before[1]


def _sentence(key: str, end_s: float, now_s: float) -> str:
    when = f"{datetime.fromtimestamp(end_s, UTC):%Y-%m-%d %H:%M} UTC"
    return f"a certificate of {key} {'has ended' if end_s <= now_s else 'ends'} at {when}"
