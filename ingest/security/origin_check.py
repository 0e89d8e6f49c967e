"""Refuses requests by web pages of other sites, made through a browser on this machine or its network.

A browser says which page makes a request (`Origin`, RFC 6454) and to which name (`Host`). The owner of a name can make
it mean this machine (DNS rebinding), so equal names prove nothing. `localhost` and an address can't be changed so.
"""

import ipaddress
from collections.abc import Sequence
from urllib.parse import urlsplit


def is_loopback(host: str) -> bool:
    """Whether a name or address, without a port, always means this machine."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def is_fixed(host: str) -> bool:
    """Whether nobody can make this name mean another machine: it is an address or `localhost`."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return is_loopback(host)
    return True


def host_of(header: str) -> str:
    """The name or address in a `Host` or `Origin` header. Empty if there is none, as in `null`."""
    try:
        return urlsplit(header if "//" in header else f"//{header}").hostname or ""
    except ValueError:
        return ""


def is_fetched_elsewhere(origins: Sequence[str], fetched_by: Sequence[str]) -> bool:
    """Whether a browser says by `Sec-Fetch-Site` alone that a page of another site makes the request.

    It sends no `Origin` for images, scripts, frames and forms that only read.
    """
    return not origins and any(value.strip().lower() == "cross-site" for value in fetched_by)


def is_cross_site(origin: str, host: str) -> bool:
    """Whether a browser makes the request for a page that is neither of this machine nor of the name requested.

    Enough where a request needs credentials that a page does not know. With client certificates it is needed: a browser
    adds them to the requests of any page.
    """
    page = host_of(origin)
    return not (is_loopback(page) or (page and page == host_of(host)))


def is_page_elsewhere(origin: str, host: str) -> bool:
    """Whether a browser makes the request for a page that is neither of this machine nor of the address requested."""
    page = host_of(origin)
    return not (is_loopback(page) or (is_fixed(page) and page == host_of(host)))
