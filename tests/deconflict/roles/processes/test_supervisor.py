"""`deconflict serve` as a user runs it: processes that are killed, and what is left of them."""

import asyncio
import os
import platform
import signal
import sys
import time
from pathlib import Path

import pytest

from deconflict.roles.processes.role_process import STEADY_S, RoleProcess, by_command
from deconflict.runtime.heartbeat import LONG_SILENCE_LIMIT_S
from tests.deconflict.roles.made_service import Served, healthy
from tests.deconflict.roles.role_processes import children, fork_servers
from tests.helpers.patience import PATIENCE_S

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux's /proc")


async def test_a_killed_engine_shows_in_health_and_resumes_its_advisory(tmp_path: Path) -> None:
    service = Served(tmp_path)
    with service.running() as pid:
        await service.until("/healthz", healthy)
        async with service.with_robots(time.time() - 21.0):
            before = await service.until("/advisories", lambda answer: len(answer["advisories"]) == 1)
            (fork_server,), engine = fork_servers(pid), children(pid)["engine"]
            os.kill(fork_server, signal.SIGSTOP)
            os.kill(engine, signal.SIGKILL)
            row = await service.until("/healthz", lambda health: health["restarts"].get("engine") == 1)
            assert (row["status"], row["roles"]["engine"]) == ("degraded", "down"), "healthy before it can be"
            os.kill(fork_server, signal.SIGCONT)
            await service.until("/healthz", healthy)
            revision = before["advisories"][0]["revision"]
            after = await service.until(
                "/advisories?state=all", lambda answer: answer["advisories"][0]["revision"] > revision
            )
        assert [advisory["id"] for advisory in after["advisories"]] == [before["advisories"][0]["id"]]


def test_a_role_restarts_at_once_and_with_growing_waits_if_it_keeps_ending() -> None:
    role, now_s, waits_s = RoleProcess("engine", by_command([sys.executable, "-c", ""])), 0.0, []
    for ran_for_s in (0.0, 0.0, 0.0, STEADY_S + 1.0, 0.0):
        if role.process is None:
            role.ensure(now_s)
        assert role.process
        role.process.wait(PATIENCE_S)
        now_s += ran_for_s
        role.ensure(now_s)
        waits_s.append(role.due_s - now_s)
        now_s = role.due_s
    role.stop()
    assert waits_s == pytest.approx([0.0, 0.2, 0.4, 0.0, 0.2])


THREADED = """
import ctypes, sys, threading
libc, together = ctypes.CDLL(None), threading.Barrier(12)
libc.fopen.restype = ctypes.c_void_p
def work():
    together.wait(60)
    kept = [bytes(1000 + n) for n in range(2000)]
    together.wait(60)
threads = [threading.Thread(target=work) for _ in range(12)]
for one in threads: one.start()
for one in threads: one.join()
file = ctypes.c_void_p(libc.fopen(sys.argv[1].encode(), b"w"))
libc.malloc_info(0, file)
libc.fclose(file)
"""
"""Many threads that need memory at the same time, and then how many heaps there are."""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another malloc")
def test_the_threads_of_a_role_share_a_heap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def heaps() -> int:
        role = RoleProcess("engine", by_command([sys.executable, "-c", THREADED, str(tmp_path / "heaps")]))
        role.ensure(0.0)
        assert role.process
        assert role.process.wait(PATIENCE_S) == 0
        role.stop()
        return (tmp_path / "heaps").read_text().count("<heap nr=")

    monkeypatch.delenv("MALLOC_ARENA_MAX", raising=False)
    assert heaps() == 2
    monkeypatch.setenv("MALLOC_ARENA_MAX", "1")
    assert heaps() == 1, "who sets it is heard"


def test_a_role_that_hangs_is_killed_and_restarted() -> None:
    role, now_s = RoleProcess("engine", by_command([sys.executable, "-c", "import time; time.sleep(600)"])), 0.0
    role.ensure(now_s)
    first = role.process
    assert first
    while first.poll() is None:
        assert now_s < LONG_SILENCE_LIMIT_S + 60.0, "nobody killed it"
        now_s += 1.0
        role.ensure(now_s)
        if now_s > LONG_SILENCE_LIMIT_S:
            time.sleep(0.1)  # a process takes a moment to end
    role.ensure(now_s)
    assert (role.restarts, first.returncode) == (1, -signal.SIGKILL)
    assert role.process
    assert role.process.poll() is None
    role.process.kill()
    role.stop()


async def test_hanging_roles_show_in_health_and_resume_their_advisory(tmp_path: Path) -> None:
    """Stopped processes: their sockets are open and nobody answers at them."""
    service = Served(tmp_path)
    with service.running() as pid:
        await service.until("/healthz", healthy)
        async with service.with_robots(time.time() - 21.0):
            before = await service.until("/advisories", lambda answer: len(answer["advisories"]) == 1)
            roles = children(pid)
            for role in ("engine", "receiver"):
                os.kill(roles[role], signal.SIGSTOP)
            row = await service.until(
                "/healthz", lambda health: "up" not in (health["roles"]["engine"], health["roles"]["receiver"])
            )
            assert (row["status"], row["restarts"]) == ("degraded", {"operator": 0, "receiver": 0, "engine": 0})
            os.kill(roles["operator"], signal.SIGSTOP)
            row = await service.until("/healthz", healthy, within_s=180)
            assert row["restarts"] == {"operator": 1, "receiver": 1, "engine": 1}
            assert not set(roles.values()) & set(children(pid).values())
        async with service.with_robots(time.time() - 21.0):
            after = await service.until("/advisories?state=all", lambda answer: answer["seq"] > before["seq"])
        assert after["advisories"][-1]["id"] == before["advisories"][0]["id"]


async def test_a_service_that_is_killed_loses_no_stored_advisory_and_leaves_no_process(tmp_path: Path) -> None:
    service = Served(tmp_path)
    with service.running() as pid:
        await service.until("/healthz", healthy)
        async with service.with_robots(time.time() - 21.0):
            before = await service.until("/advisories", lambda answer: len(answer["advisories"]) == 1)
            orphans = children(pid)
            os.kill(pid, signal.SIGKILL)
            os.kill(orphans["operator"], signal.SIGKILL)
    async with asyncio.timeout(PATIENCE_S):
        while any(Path(f"/proc/{orphan}/cmdline").exists() and _is_role(orphan) for orphan in orphans.values()):
            await asyncio.sleep(0.05)
    with service.running():
        after = await service.until("/advisories?state=all", lambda answer: answer["seq"] >= before["seq"])
        assert [advisory["id"] for advisory in after["advisories"]] == [before["advisories"][0]["id"]]
        robots = await service.until("/robots", lambda answer: len(answer.get("robots", [])) == 2)
        assert all(robot["location"] for robot in robots["robots"])


def _is_role(pid: int) -> bool:
    try:
        return b"deconflict.roles" in Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except FileNotFoundError:
        return False


async def test_health_shows_that_the_supervisor_is_stopped(tmp_path: Path) -> None:
    service = Served(tmp_path)
    with service.running() as pid:
        await service.until("/healthz", healthy)
        os.kill(pid, signal.SIGSTOP)
        row = await service.until("/healthz", lambda health: health["supervisor"]["status"] != "ok")
        assert (row["status"], "restarts no role" in row["supervisor"]["reason"]) == ("degraded", True)
        os.kill(pid, signal.SIGCONT)
        await service.until("/healthz", healthy)


async def test_roles_outlive_a_killed_fork_server_and_restart_from_the_next_one(tmp_path: Path) -> None:
    service = Served(tmp_path)
    with service.running() as pid:
        await service.until("/healthz", healthy)
        (first,), engine = fork_servers(pid), children(pid)["engine"]
        os.kill(first, signal.SIGKILL)
        async with asyncio.timeout(PATIENCE_S):
            while fork_servers(pid) in ([], [first]):
                await asyncio.sleep(0.05)
        health = await service.until("/healthz", healthy)
        assert health["restarts"] == {"operator": 0, "receiver": 0, "engine": 0}, "the roles run on"
        os.kill(engine, signal.SIGKILL)
        await service.until("/healthz", lambda health: health["restarts"].get("engine") == 1 and healthy(health))
        assert children(pid).keys() == {"engine"}


async def test_after_a_crash_in_its_first_minute_an_engine_starts_without_the_learned_state(tmp_path: Path) -> None:
    service, learned = Served(tmp_path), tmp_path / "learned.npz"
    with service.running():
        await service.until("/healthz", healthy)
    kept = learned.read_bytes()
    for number in (signal.SIGKILL, signal.SIGSEGV):
        with service.running() as pid:
            await service.until("/healthz", healthy)
            os.kill(children(pid)["engine"], number)
            aside = learned.with_name("learned.npz.unreadable")
            if number is signal.SIGSEGV:
                await service.until(
                    "/healthz", lambda health: "set it aside as learned.npz" in health["files"].get("reason", "")
                )
            else:
                await service.until("/healthz", lambda health: health["restarts"].get("engine") and healthy(health))
            assert (aside.exists() and aside.read_bytes() == kept) == (number is signal.SIGSEGV)
            kept = learned.read_bytes() if learned.exists() else b""
        kept = learned.read_bytes()
