"""Who this machine is to the NATS servers, and whom it trusts to be them."""

import ssl
from collections.abc import Callable
from typing import Any

from deconflict.settings.cluster_settings import Cluster
from ingest.security.certificates import CertificateError
from ingest.security.tokens import renewed, secret


def credentials(settings: Cluster) -> dict[str, Any]:
    """What the NATS client is told of them. Raises `SecretError` and `CertificateError`."""
    told: dict[str, Any] = {}
    if settings.token:
        told["token"] = _read_again(settings.token)
    if settings.user:
        told |= {"user": settings.user, "password": _read_again(settings.password)}
    if settings.ca or settings.certificate:
        told["tls"] = _context(settings.ca, settings.certificate)
    return told


def _read_again(source: str) -> Callable[[], str]:
    """The secret, as it is whenever that is asked; as it was where it can't be had then."""
    known = secret(source)

    def current() -> str:
        nonlocal known
        known = renewed(source, known)
        return known

    return current


def _context(ca: str, certificate: str) -> ssl.SSLContext:
    try:
        context = ssl.create_default_context(cafile=ca or None)
        if certificate:
            context.load_cert_chain(certificate)
    except (OSError, ssl.SSLError) as error:
        files = ", ".join(filter(None, (ca, certificate)))
        raise CertificateError(
            f"{files}: {error}; expected PEM files of an authority, and of a certificate with its key"
        ) from error
    return context
