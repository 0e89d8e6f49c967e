"""Certificates of an authority of the site's own."""

import ssl
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
