"""TLS with the site's own certificates. Changed files are read again."""

import logging
import ssl
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from ingest.plain_files import MOST_GIVEN_BYTES, UnfitFileError, unfit
from ingest.settings import Tls

log = logging.getLogger(__name__)


class CertificateError(ValueError):
    """Certificates that can't be used; the message names the files."""


class RenewedContext:
    """A context of TLS, replaced as a whole by `refresh`: a context in use keeps what was loaded into it.

    So files that do not fit together change nothing, and an authority that was taken out is trusted no longer.
    """

    def __init__(self, files: Iterable[str], load: Callable[[], ssl.SSLContext]) -> None:
        """`load` makes a context of the files. Raises `CertificateError`."""
        self._files, self._load = tuple(filter(None, files)), load
        self._used: tuple[tuple[int, ...], ...] | None = None
        """Signatures of the files in use; None while none ever were."""
        self._failure = ""
        self.context = self._loaded()

    def refresh(self) -> None:
        """Use changed files for handshakes that begin from now on.

        If they can't be used, use no part, and try again at the next call: the reason may pass with no file changed,
        as too many open files. Each other reason is logged.
        """
        if signatures(self._files) == self._used:
            return
        try:
            self.context = self._loaded()
        except CertificateError as error:
            self._note("the earlier certificates stay in use, if there are any", error)
        else:
            self._failure = ""
            log.info("certificates are read again from %s", ", ".join(self._files))

    def _loaded(self) -> ssl.SSLContext:
        now = signatures(self._files)
        context = self._load()
        self._used = now
        return context

    def _note(self, follows: str, error: CertificateError) -> None:
        if str(error) != self._failure:
            log.error("%s: %s", follows, error)
        self._failure = str(error)


class Certificates(RenewedContext):
    """The context of a server. While its files have never been of use, every handshake fails."""

    def __init__(self, settings: Tls) -> None:
        files = settings.certificate, settings.key, settings.clients
        try:
            super().__init__(files, partial(server_context, settings))
        except CertificateError as error:
            self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            self._note("nobody can connect until the certificates can be used", error)


class ClientCertificates(RenewedContext):
    """The context of connections to servers, as `client_context` makes it."""

    def __init__(self, ca: str, certificate: str) -> None:
        """Raises `CertificateError`."""
        super().__init__((ca, certificate), partial(client_context, ca, certificate))


def server_context(settings: Tls) -> ssl.SSLContext:
    """A new context for a port. Raises `CertificateError`."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    files = tuple(filter(None, (settings.certificate, settings.key, settings.clients)))
    with reading(files, "expected PEM files of a certificate and its key"):
        context.load_cert_chain(settings.certificate, settings.key or None, no_password)
        if settings.clients:
            context.verify_mode = ssl.CERT_OPTIONAL
            context.load_verify_locations(settings.clients)
    return context


def client_context(ca: str = "", certificate: str = "") -> ssl.SSLContext:
    """A new context for connections to a server that `ca` signed; if it is empty, one that this machine trusts.

    Raises `CertificateError`.
    """
    files = tuple(filter(None, (ca, certificate)))
    with reading(files, "expected PEM files of an authority, and of a certificate with its key"):
        context = ssl.create_default_context(cafile=ca or None)
        if certificate:
            context.load_cert_chain(certificate, password=no_password)
    return context


@contextmanager
def reading(files: Iterable[str], expected: str) -> Iterator[None]:
    """Raises `CertificateError` if a file is none, or the block can't use the files."""
    try:
        for file in map(Path, files):
            if reason := unfit(file, MOST_GIVEN_BYTES):
                raise UnfitFileError(reason)
        yield
    except (OSError, ssl.SSLError) as error:
        raise CertificateError(f"{', '.join(files)}: {error}; {expected}") from error


def signatures(files: Iterable[str]) -> tuple[tuple[int, ...], ...]:
    """What changes when a file is written, replaced or made readable."""
    return tuple(_signature(Path(file)) for file in files)


def _signature(file: Path) -> tuple[int, ...]:
    try:
        found = file.stat()
    except OSError:
        return ()
    return found.st_mtime_ns, found.st_ctime_ns, found.st_size, found.st_ino


def no_password() -> str:
    """Without it, OpenSSL would ask for the password of an encrypted key on the terminal, and wait."""
    return ""


def names(certificate: dict[str, Any] | None) -> tuple[str, ...]:
    """The common name and DNS names of a verified peer certificate, as `ssl.SSLSocket.getpeercert` gives it."""
    if not certificate:
        return ()
    subject = [value for part in certificate.get("subject", ()) for key, value in part if key == "commonName"]
    return (*subject, *(value for kind, value in certificate.get("subjectAltName", ()) if kind == "DNS"))
