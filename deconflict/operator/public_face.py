"""The port of the operator face, on a thread and an event loop of its own.

Whatever people and programs do to it, storing and outlets go on: they run on the event loop of the role.
"""

import asyncio
import socket
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from threading import Thread

from fastapi import FastAPI

from deconflict.operator.http.server.server_protocols import count_refused
from deconflict.operator.http.server.uvicorn_server import create_server
from deconflict.settings.site import Site
from ingest.measures.lasting_loops import lasting
from ingest.port.connection_limits import count_failed_accepts
from ingest.security.certificates import Certificates

REFRESH_EVERY_S = 5.0
MOST_THREADS = 64
"""Some may wait for a disk that does not answer, and the others answer meanwhile."""
SILENCE_LIMIT_S = 20
"""An event loop that runs nothing for this long hangs."""
SWITCH_INTERVAL_S = 0.0005
"""A busy thread lets the others run after this time. Beside one busy thread, publishing takes 4 ms with it, and 15 ms
with Python's own 5 ms."""


class HangingFaceError(Exception):
    """The event loop of the port runs nothing any more. Only a restart of the role helps."""


class PublicFace:
    """Serves `app` until `end`. Every method is called on the event loop of the role."""

    def __init__(self, app: FastAPI, certificates: Certificates | None) -> None:
        self._app, self._certificates = app, certificates
        self._server = create_server(app, certificates)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._beats = 0
        """Rises every `REFRESH_EVERY_S` while the event loop of the port runs."""

    def serve(self, listener: socket.socket) -> asyncio.Future[None]:
        """Begin to serve. The future is done once it has ended and closed the listener.

        It fails with `HangingFaceError` if it hangs.
        """
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        self._loop, served = asyncio.new_event_loop(), Future[None]()
        Thread(target=self._run, args=(self._loop, listener, served), name="public face", daemon=True).start()
        return asyncio.ensure_future(self._until(asyncio.wrap_future(served)))

    def renew(self, site: Site) -> None:
        """Use other settings from now on."""
        if self._loop:
            self._loop.call_soon_threadsafe(self._renew, site)

    def end(self) -> None:
        self._server.should_exit = True

    async def _until(self, served: asyncio.Future[None]) -> None:
        """Wait for the end. Time in which the whole process was stopped does not count as silence."""
        silent_s, beats = 0, self._beats
        while silent_s < SILENCE_LIMIT_S:
            await asyncio.wait({served}, timeout=1.0)
            if served.done():
                served.result()
                return
            silent_s, beats = 0 if self._beats > beats else silent_s + 1, self._beats
        raise HangingFaceError(f"the operators' port has done nothing for {SILENCE_LIMIT_S} s")

    def _run(self, loop: asyncio.AbstractEventLoop, listener: socket.socket, served: Future[None]) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: loop) as runner:
                runner.run(self._serve(listener))
            served.set_result(None)
        except BaseException as error:  # noqa: BLE001 - the role gets it
            served.set_exception(error)

    async def _serve(self, listener: socket.socket) -> None:
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(MOST_THREADS, "face"))
        count_failed_accepts(partial(count_refused, self._app.state, "face-no-files"))
        refreshing = asyncio.create_task(
            lasting("reading tokens and certificates of people", self._refresh, self._app.state.measures)
        )
        try:
            await self._server.serve([listener])
        finally:
            refreshing.cancel()

    async def _refresh(self) -> None:
        """Read changed tokens and certificates."""
        while True:
            await asyncio.sleep(REFRESH_EVERY_S)
            self._beats += 1
            self._app.state.people.refresh()
            if self._certificates:
                self._certificates.refresh()

    def _renew(self, site: Site) -> None:
        self._app.state.site = site
        self._app.state.people.renew(site.operator.people)
