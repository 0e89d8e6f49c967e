"""The network ports of the service: refused before it starts if it can't listen on them."""

import asyncio
import logging
import os
import socket
from collections.abc import Awaitable, Callable, Iterable
from contextlib import ExitStack
from typing import Protocol, TypeVar

from deconflict.runtime.command_parsers import whole_in
from deconflict.settings.site import Site
from ingest.measures.measures import Measures

LAST_PORT = 65535
port_number = whole_in(0, LAST_PORT)
"""The type of an argument that is a port; 0 is any free one."""
OPTIONS = {"receiver": "--robots-port", "operator": "--operator-port"}
"""By section of the site, the option of `serve` that sets its port."""
FAILURES = "deconflict_port_failures_total"
RETRY_S = 1.0
Opened = TypeVar("Opened")

log = logging.getLogger(__name__)


class Address(Protocol):
    """The part of the settings of a port that is used here."""

    @property
    def host(self) -> str: ...

    @property
    def port(self) -> int: ...


class PortTakenError(OSError):
    """The service can't listen on a port that it needs. `errno` is that of the cause."""

    def __init__(self, section: str, address: Address, error: OSError) -> None:
        number = error.errno or 0
        why = os.strerror(number) if number > 0 else error.strerror or str(error)
        where = f"{address.host}:{address.port}"
        option = OPTIONS.get(section, "")
        asked = f"{section}.port{f' ({option})' if option else ''} or {section}.host"
        super().__init__(f"can't listen on {where}: {why}. Set another {asked}")
        self.errno = error.errno


def listen_at(section: str, address: Address) -> socket.socket:
    """A socket that listens at the address of a section of the site. Raises `PortTakenError`."""
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    try:
        return socket.create_server((address.host, address.port), family=family)
    except OSError as error:
        raise PortTakenError(section, address, error) from error


async def opened(
    section: str, address: Address, open_port: Callable[[], Awaitable[Opened]], measures: Measures
) -> Opened:
    """What `open_port` returns, once it can listen: a role that starts again goes on without its port meanwhile."""
    failed = False
    while True:
        try:
            result = await open_port()
        except OSError as error:
            measures.count(FAILURES, section)
            if not failed:
                log.error(
                    "%s; it is tried each second, and all that needs no port goes on",
                    _explained(section, address, error),
                )
            failed = True
            await asyncio.sleep(RETRY_S)
        else:
            if failed:
                log.warning("listening on %s:%s again", address.host, address.port)
            return result


def _explained(section: str, address: Address, error: OSError) -> OSError:
    return error if isinstance(error, PortTakenError) else PortTakenError(section, address, error)


def refuse_taken(site: Site, sections: Iterable[str]) -> None:
    """Raises `PortTakenError` if the service can't listen at the addresses of these `sections` of the site at once."""
    section_at: dict[tuple[str, int], str] = {}
    with ExitStack() as listeners:
        for section in sections:
            address: Address = getattr(site, section)
            other = section_at.setdefault((address.host, address.port), section)
            if address.port and other != section:
                raise PortTakenError(section, address, OSError(0, f"{other}.port is the same port"))
            listeners.enter_context(listen_at(section, address))
