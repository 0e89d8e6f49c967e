"""TLS with the site's own certificates. Changed files are read again."""

import logging
import ssl
from pathlib import Path
from typing import Any

from ingest.settings import Tls

log = logging.getLogger(__name__)


class CertificateError(ValueError):
    """Certificates that can't be used; the message names the files."""


class Certificates:
    """One server context. Certificates that `refresh` has read again hold for connections that open from then on."""

    def __init__(self, settings: Tls) -> None:
        """Raises `CertificateError`."""
        self._settings = settings
        self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.context.minimum_version = ssl.TLSVersion.TLSv1_2
        if settings.clients:
            self.context.verify_mode = ssl.CERT_OPTIONAL
        self._read = self._changed()
        self._load()

    def refresh(self) -> None:
        """Load the files again if one has changed. If that fails, it is logged; the old ones stay in use."""
        changed = self._changed()
        if changed == self._read:
            return
        self._read = changed
        try:
            self._load()
        except CertificateError as error:
            log.error("the earlier certificates stay in use: %s", error)
        else:
            log.info("certificates are read again from %s", self._settings.certificate)

    def _load(self) -> None:
        settings = self._settings
        try:
            self.context.load_cert_chain(settings.certificate, settings.key or None)
            if settings.clients:
                self.context.load_verify_locations(settings.clients)
        except (OSError, ssl.SSLError) as error:
            files = ", ".join(filter(None, (settings.certificate, settings.key, settings.clients)))
            raise CertificateError(f"{files}: {error}; expected PEM files of a certificate and its key") from error

    def _changed(self) -> tuple[int, ...]:
        files = filter(None, (self._settings.certificate, self._settings.key, self._settings.clients))
        return tuple(Path(file).stat().st_mtime_ns if Path(file).exists() else 0 for file in files)


def names(certificate: dict[str, Any] | None) -> tuple[str, ...]:
    """The common name and DNS names of a verified peer certificate, as `ssl.SSLSocket.getpeercert` gives it."""
    if not certificate:
        return ()
    subject = [value for part in certificate.get("subject", ()) for key, value in part if key == "commonName"]
    return (*subject, *(value for kind, value in certificate.get("subjectAltName", ()) if kind == "DNS"))
