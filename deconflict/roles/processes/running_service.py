"""What commands that ask a running service have in common: its address, a token, and a client."""

import argparse
from typing import TYPE_CHECKING

from ingest.security.certificates import client_context
from ingest.security.tokens import secret

if TYPE_CHECKING:
    import httpx

ADDRESS = "http://127.0.0.1:8080"
"""Where `serve` has the operators' port on the same machine, unless it is told otherwise."""
TIMEOUT_S = 30.0


def add_service_options(command: argparse.ArgumentParser) -> None:
    """Where the service is, and how it is asked."""
    command.add_argument(
        "url",
        nargs="?",
        default=ADDRESS,
        metavar="URL",
        help="the operators' port of the service (default: %(default)s)",
    )
    command.add_argument("--token", metavar="SOURCE", help="source of a token: env:NAME or file:PATH")
    command.add_argument(
        "--ca", metavar="FILE", help="PEM file of the authority of an https port; that of the system if absent"
    )


def service_client(args: argparse.Namespace) -> "httpx.Client":
    """A client of the service. Raises `httpx.InvalidURL`, `SecretError` or `CertificateError`."""
    import httpx  # noqa: PLC0415 - the command line starts without it

    headers = {"authorization": f"Bearer {secret(args.token)}"} if args.token else {}
    return httpx.Client(base_url=args.url, headers=headers, verify=client_context(args.ca or ""), timeout=TIMEOUT_S)
