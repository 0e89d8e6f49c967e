"""`deconflict alive`: whether a service on this machine answers, as the health check of the container asks."""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
import trustme

from deconflict.__main__ import parser
from deconflict.roles.processes.alive_command import SILENT, ask_ports
from deconflict.runtime.command_parsers import MISUSED
from deconflict.settings.site import Operator, Site
from ingest.settings import ReceiverSettings, Tls
from tests.deconflict.operator.http.served_face import served
from tests.deconflict.roles.made_service import SITE, free_ports, running
from tests.helpers.plain_http import http_client


async def asked(*arguments: object) -> int:
    args = parser().parse_args(["alive", *map(str, arguments)])
    code: int = await asyncio.to_thread(args.run, args)
    return code


def certificates(directory: Path) -> Tls:
    """Of a name that no address of this machine is."""
    certificate = trustme.CA().issue_cert("floor.example")
    certificate.private_key_and_cert_chain_pem.write_to_path(str(directory / "site.pem"))
    return Tls(certificate=str(directory / "site.pem"))


async def test_both_ports_with_tls_are_asked_where_the_site_file_has_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robots, face = free_ports(2)
    tls, site_file = certificates(tmp_path), tmp_path / "site.toml"
    section = '[{}]\nhost = "0.0.0.0"\nport = {}\ntls = {{ certificate = "site.pem" }}\n'
    site_file.write_text(section.format("receiver", robots) + section.format("operator", face))
    receiver, operator = ReceiverSettings(port=robots, tls=tls), Operator(port=face, tls=tls)
    site = SITE.model_copy(update={"receiver": receiver, "operator": operator})
    async with running(tmp_path / "data", site):
        assert await asked(site_file) == 0
        assert await asked(site_file, "--robots-port", free_ports(1)[0], "--part", "face") == 0
        assert await asked(site_file, "--robots-port", free_ports(1)[0]) == SILENT
    assert capsys.readouterr().out.startswith("alive\nalive\n0.0.0.0:")
    assert await asked(site_file) == SILENT
    assert capsys.readouterr().out.count("does not answer") == 2


async def test_a_service_whose_health_is_not_ok_is_alive(tmp_path: Path) -> None:
    async with served(tmp_path) as face, http_client() as client:
        face.sources.down = {"engine"}
        assert (await client.get(f"{face.http}/healthz")).status_code == 503
        assert await asked("--part", "face", "--operator-port", face.address.split(":")[1]) == 0


@contextmanager
def another_program() -> Iterator[int]:
    with HTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler) as server:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        yield server.server_port
        thread.join()


def test_another_program_at_the_port_is_not_the_service(capsys: pytest.CaptureFixture[str]) -> None:
    with another_program() as port:
        assert ask_ports(Site(operator=Operator(port=port)), ["face"]) == SILENT
    assert capsys.readouterr().out == f"127.0.0.1:{port} answers 501: is it the service?\n"


async def test_an_engine_alone_has_no_port_to_ask(capsys: pytest.CaptureFixture[str]) -> None:
    assert await asked("--part", "engine") == MISUSED
    assert "no port" in capsys.readouterr().err
