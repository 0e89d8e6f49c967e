"""The credentials for the NATS servers, and the authority that this machine trusts."""

from collections.abc import Callable
from typing import Any

from deconflict.settings.cluster_settings import Cluster
from ingest.security.certificates import ClientCertificates
from ingest.security.tokens import renewed, secret


def credentials(settings: Cluster) -> dict[str, Any]:
    """The credentials as arguments of the NATS client. Raises `SecretError`."""
    arguments: dict[str, Any] = {}
    if settings.token:
        arguments["token"] = _current_secret(settings.token)
    if settings.user:
        arguments |= {"user": settings.user, "password": _current_secret(settings.password)}
    return arguments


def certificates(settings: Cluster) -> ClientCertificates | None:
    """The certificates for the servers; None for what this machine trusts. Raises `CertificateError`."""
    if settings.ca or settings.certificate:
        return ClientCertificates(settings.ca, settings.certificate)
    return None


def _current_secret(source: str) -> Callable[[], str]:
    """A function that reads the secret at each call; if that fails, it gives the last known one."""
    known = secret(source)

    def current() -> str:
        nonlocal known
        known = renewed(source, known)
        return known

    return current
