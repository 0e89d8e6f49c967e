"""Pages of other sites, which a browser on this machine or its network would let speak in somebody's place.

A browser says which page asks (`Origin`, RFC 6454) and by what name it asks (`Host`). A name can be made to mean this
machine by whoever owns it (DNS rebinding), so that equal names prove nothing; `localhost` and an address can't.
"""

import ipaddress
from urllib.parse import urlsplit


def is_loopback(host: str) -> bool:
    """Whether a name or address, without a port, can only be this machine."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def is_sure(host: str) -> bool:
    """Whether nobody else can make this name mean another machine: it is an address, or `localhost`."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return is_loopback(host)
    return True


def host_of(header: str) -> str:
    """The name or address in a `Host` header, or in an `Origin`; empty where there is none, as in `null`."""
    try:
        return urlsplit(header if "//" in header else f"//{header}").hostname or ""
    except ValueError:
        return ""


def is_page_elsewhere(origin: str, host: str) -> bool:
    """Whether a page that is not of this machine, nor of the very address asked, speaks through a browser."""
    page = host_of(origin)
    return not (is_loopback(page) or (is_sure(page) and page == host_of(host)))
