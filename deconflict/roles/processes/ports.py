"""The network ports of the service: refused before it starts if it can't listen on them."""

import argparse
import errno
import socket
from collections.abc import Iterable
from typing import Protocol

from deconflict.settings.site import Site

LAST_PORT = 65535


class Address(Protocol):
    """The part of the settings of a port that is used here."""

    @property
    def host(self) -> str: ...

    @property
    def port(self) -> int: ...


class PortTakenError(OSError):
    """The service can't listen on a port that it needs."""

    def __init__(self, section: str, address: Address, error: OSError) -> None:
        why = error.strerror or str(error)
        where = f"{address.host}:{address.port}"
        super().__init__(f"can't listen on {where}: {why}. Set another {section}.port or {section}.host")


def port_number(text: str) -> int:
    """The type of an argument that is a port."""
    if not (text.isascii() and text.isdecimal()) or int(text) > LAST_PORT:
        raise argparse.ArgumentTypeError(f"{text!r} is no port: a whole number from 0, any free port, to {LAST_PORT}")
    return int(text)


def free_port(host: str, port: int, others: Iterable[int] = ()) -> int:
    """A port of a host on which this process can listen now; if `port` is 0, any. `others` are wanted for something
    else. Raises OSError if it can't."""
    if port in others:
        raise OSError(errno.EADDRINUSE, "Another port of the service has this number")
    with socket.socket(family_of(host)) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((host, port))
        return int(probe.getsockname()[1])


def family_of(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def refuse_taken(site: Site, sections: Iterable[str]) -> None:
    """Raises `PortTakenError` if the service can't listen on a port of these `sections` of the site."""
    wanted: list[int] = []
    for section in sections:
        address: Address = getattr(site, section)
        try:
            wanted.append(free_port(address.host, address.port, wanted))
        except OSError as error:
            raise PortTakenError(section, address, error) from error
