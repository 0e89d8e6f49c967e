"""HTTP to a service on this machine, without TLS."""

import ssl
from collections.abc import Mapping

import httpx

from tests.helpers.patience import PATIENCE_S

NO_AUTHORITIES = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
"""To load those of the world, as httpx does for every client, takes 60 ms of computation."""


def http_client(base_url: str = "", headers: Mapping[str, str] | None = None) -> httpx.AsyncClient:
    return httpx.AsyncClient(
        base_url=base_url, headers=headers, timeout=PATIENCE_S, trust_env=False, verify=NO_AUTHORITIES
    )
