"""The command `alive`: asks the ports of a service on this machine whether they answer, for a container's health."""

import http.client
import ssl
import sys
from collections.abc import Iterable
from http import HTTPStatus
from typing import Any

from deconflict.roles.processes.ports import Address
from deconflict.roles.processes.supervisor import PARTS, PORTS
from deconflict.runtime.command_parsers import MISUSED
from deconflict.settings.site import Site

SILENT = 1
"""Exit code if a port does not answer."""
TIMEOUT_S = 5.0
ANSWERS = (HTTPStatus.OK, HTTPStatus.SERVICE_UNAVAILABLE)
"""A service that says what is wrong with it is alive."""
EVERY_ADDRESS = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - asked, not listened on
"""By address to listen on, the one of this machine."""


def ask_ports(site: Site, parts: Iterable[str]) -> int:
    """Print whether the ports of these parts answer. The exit code of the command."""
    roles = [role for part in parts for role in PARTS[part] if role in PORTS]
    if not roles:
        sys.stderr.write("deconflict: --part engine has no port that could be asked\n")
        return MISUSED
    problems = [problem for role in roles if (problem := _problem(getattr(site, role)))]
    sys.stdout.writelines(f"{problem}\n" for problem in problems or ["alive"])
    return SILENT if problems else 0


def _problem(section: Any) -> str:
    """Why the port of a section of the site is not alive; empty if it is."""
    where = f"{section.host}:{section.port}"
    connection = _connection(section, section.tls is not None)
    try:
        connection.request("GET", "/healthz")
        status = connection.getresponse().status
    except (OSError, http.client.HTTPException) as error:
        return f"{where} does not answer: {error}"
    finally:
        connection.close()
    return "" if status in ANSWERS else f"{where} answers {status}: is it the service?"


def _connection(address: Address, has_tls: bool) -> http.client.HTTPConnection:
    """Not through a proxy. The certificate has the name of the site, not of this machine, so it is not checked."""
    host = EVERY_ADDRESS.get(address.host, address.host)
    if not has_tls:
        return http.client.HTTPConnection(host, address.port, timeout=TIMEOUT_S)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return http.client.HTTPSConnection(host, address.port, timeout=TIMEOUT_S, context=context)
