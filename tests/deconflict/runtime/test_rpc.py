import asyncio
import socket
import time
from contextlib import suppress
from itertools import count
from pathlib import Path

import pytest

from deconflict.runtime.rpc import SEND_BUFFER_BYTES, AsyncCaller, Caller, LinkDownError, listening, socket_path
from tests.helpers.patience import PATIENCE_S

MOST_BYTES = int(Path("/proc/sys/net/core/wmem_max").read_text())


async def _shout(payload: bytes) -> bytes:
    return payload.upper()


async def test_both_callers_get_the_answer(tmp_path: Path) -> None:
    async with listening(socket_path(tmp_path, "role"), {"shout": _shout}):
        assert await AsyncCaller(tmp_path, "role").call("shout", b"a\nb") == b"A\nB"
        blocking = Caller(tmp_path, "role")
        large = b"x" * 3_000_000
        assert await asyncio.to_thread(blocking.call, "shout", large) == large.upper()
        assert await asyncio.to_thread(blocking.call, "shout") == b""
        blocking.close()


def test_the_error_names_a_role_that_does_not_run(tmp_path: Path) -> None:
    with pytest.raises(LinkDownError, match="receiver"):
        Caller(tmp_path, "receiver").call("anything")


async def test_a_caller_finds_the_role_again_after_it_restarted(tmp_path: Path) -> None:
    path, caller = socket_path(tmp_path, "role"), Caller(tmp_path, "role")
    async with listening(path, {"shout": _shout}):
        assert await asyncio.to_thread(caller.call, "shout", b"one") == b"ONE"
    with pytest.raises(LinkDownError):
        await asyncio.to_thread(caller.call, "shout", b"two")
    async with listening(path, {"shout": _shout}):
        assert await asyncio.to_thread(caller.call, "shout", b"three") == b"THREE"
        caller.close()


async def test_an_unknown_call_ends_the_connection_and_not_the_role(tmp_path: Path) -> None:
    async with listening(socket_path(tmp_path, "role"), {"shout": _shout}):
        with pytest.raises(LinkDownError):
            await AsyncCaller(tmp_path, "role").call("whisper")
        assert await AsyncCaller(tmp_path, "role").call("shout", b"still") == b"STILL"


@pytest.mark.parametrize("steps", range(6))
async def test_a_connection_ends_with_the_role_however_far_it_has_come(tmp_path: Path, steps: int) -> None:
    path = socket_path(tmp_path, "role")
    with socket.socket(socket.AF_UNIX) as caller:
        async with listening(path, {"shout": _shout}):
            caller.connect(str(path))
            for _ in range(steps):
                await asyncio.sleep(0)
        caller.settimeout(PATIENCE_S)
        with suppress(ConnectionResetError):
            assert caller.recv(1) == b""


@pytest.mark.skipif(MOST_BYTES < SEND_BUFFER_BYTES, reason="the kernel keeps no more for a socket: net.core.wmem_max")
async def test_a_large_reply_needs_few_iterations_of_a_busy_loop(tmp_path: Path) -> None:
    rounds, loop, done = count(), asyncio.get_running_loop(), asyncio.Event()

    async def batch(_: bytes) -> bytes:
        go_round()
        return bytes(SEND_BUFFER_BYTES)

    def go_round() -> None:
        next(rounds)
        time.sleep(0.01)  # a loop under load: each iteration takes long
        if not done.is_set():
            loop.call_soon(go_round)

    caller = Caller(tmp_path, "receiver")
    async with listening(socket_path(tmp_path, "receiver"), {"batch": batch}):
        reply = await asyncio.to_thread(caller.call, "batch")
        done.set()
        caller.close()
    assert len(reply) == SEND_BUFFER_BYTES
    assert next(rounds) < 12
