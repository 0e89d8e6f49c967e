"""Certificates of an authority of the site's own."""

import resource
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import trustme


def write(authority: trustme.CA, directory: Path) -> None:
    authority.issue_cert("127.0.0.1").private_key_and_cert_chain_pem.write_to_path(str(directory / "site.pem"))


def trusting(authority: trustme.CA, as_client: str | None = None) -> ssl.SSLContext:
    context = ssl.create_default_context()
    authority.configure_trust(context)
    if as_client:
        authority.issue_cert(common_name=as_client).configure_cert(context)
    return context


@contextmanager
def no_more_open_files() -> Iterator[None]:
    """While it lasts, this process can look at files and open none."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
