import asyncio
import json
import socket
from collections.abc import AsyncIterator, Set
from datetime import timedelta
from pathlib import Path

import pytest
from uvicorn.protocols.utils import ClientDisconnected
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosedError
from websockets.frames import Frame, Opcode

from deconflict.operator.http.server.server_protocols import WebSocketProtocol
from deconflict.operator.store.publisher import MOST_LINES, PublishedPage
from deconflict.operator.store.store import Store
from deconflict_client.advisory import EVERY_KIND
from deconflict_client.situations import BAD_AFTER, BAD_KINDS, POSITION_LOST, STORE_FAILED
from tests.deconflict.operator.http.served_face import Served, served, stuck_subscriber, until
from tests.helpers.made_advisories import START, cleared, cleared_situation, deadlock, made, situation

RESTARTING = 1012


@pytest.fixture
async def face(tmp_path: Path) -> AsyncIterator[Served]:
    async with served(tmp_path) as served_face:
        yield served_face


async def heard(face: Served, after: int | None, last: int) -> list[int]:
    """The numbers a new subscriber hears, up to `last`."""
    seqs: list[int] = []
    async with connect(face.stream("" if after is None else f"?after={after}")) as socket_:
        while not seqs or seqs[-1] < last:
            seqs.append(json.loads(await socket_.recv())["seq"])
    return seqs


async def test_a_message_is_one_revision_as_stored(face: Served) -> None:
    (stored,) = await face.publish(made(1))
    async with connect(face.stream("?after=0")) as subscriber:
        assert json.loads(await subscriber.recv()) == stored.model_dump(mode="json")


async def test_without_after_the_stream_begins_with_the_next_revision(face: Served) -> None:
    await face.publish(made(1))
    async with connect(face.stream()) as subscriber:
        await face.publish(made(2), made(1, 2))
        assert [json.loads(await subscriber.recv())["seq"] for _ in range(2)] == [2, 3]


async def test_resuming_anywhere_while_a_writer_appends_loses_and_doubles_nothing(face: Served) -> None:
    last = 3000
    await face.publish(*(made(number) for number in range(1, 1501)))

    async def write() -> None:
        for first in range(1501, last + 1, 10):
            await face.publish(*(made(number) for number in range(first, first + 10)))

    writing = asyncio.create_task(write())
    for part in (0, 37, 800, 1499, 1500):
        everything = await asyncio.gather(*(heard(face, after, last) for after in (part, part + 1)))
        assert everything == [list(range(after + 1, last + 1)) for after in (part, part + 1)]
    await writing


async def test_a_returning_subscriber_resumes_at_its_position(face: Served) -> None:
    async def write() -> None:
        for number in range(1, 1001):
            await face.publish(made(number))

    writing = asyncio.create_task(write())
    seqs: list[int] = []
    while not seqs or seqs[-1] < 1000:
        async with connect(face.stream(f"?after={seqs[-1] if seqs else 0}")) as subscriber:
            seqs += [json.loads(await subscriber.recv())["seq"] for _ in range(min(77, 1000 - len(seqs)))]
    await writing
    assert seqs == list(range(1, 1001))


async def test_a_stream_resumes_after_a_restart_of_the_service(tmp_path: Path) -> None:
    async with served(tmp_path) as first:
        await first.publish(made(1), made(2))
    async with served(tmp_path) as second:
        await second.publish(made(3))
        assert await heard(second, 1, 3) == [2, 3]


async def kinds_heard(face: Served, query: str, count: int) -> list[tuple[int, str]]:
    """Number and kind of the first messages."""
    async with connect(face.stream(query)) as subscriber:
        messages = [json.loads(await subscriber.recv()) for _ in range(count)]
    return [(message["seq"], message["kind"]) for message in messages]


@pytest.mark.parametrize(
    ("kinds", "expected"),
    [
        ("", [(1, "conflict"), (3, "deadlock"), (5, "conflict")]),
        ("&kinds=situation", [(2, "situation"), (4, "situation")]),
        ("&kinds=deadlock,situation", [(2, "situation"), (3, "deadlock"), (4, "situation")]),
        ("&kinds=conflict", [(1, "conflict"), (5, "conflict")]),
        ("&kinds=advisory", [(1, "conflict"), (3, "deadlock"), (5, "conflict")]),
        ("&kinds=situation,advisory", [*enumerate(["conflict", "situation", "deadlock", "situation", "conflict"], 1)]),
    ],
)
async def test_a_subscriber_hears_the_kinds_that_it_asks_for(
    face: Served, kinds: str, expected: list[tuple[int, str]]
) -> None:
    await face.publish(made(1), situation(1), deadlock("r-1", "r-2"), situation(2), made(2))
    assert await kinds_heard(face, f"?after=0{kinds}", len(expected)) == expected


async def test_a_subscriber_that_is_filtered_resumes_anywhere_and_loses_nothing(face: Served) -> None:
    """Mostly others lie between, in the store and in memory."""
    last, every = 12_000, 40
    for first in range(1, last, 1000):
        numbers = range(first, first + 1000)
        await face.publish(*(situation(number) if number % every == 0 else made(number) for number in numbers))
    for after in (0, 39, 40, 5000, 11_000, last - 1):
        wanted = [number for number in range(after + 1, last + 1) if number % every == 0]
        found = await kinds_heard(face, f"?after={after}&kinds=situation", len(wanted))
        assert found == [(number, "situation") for number in wanted]


async def test_a_live_subscriber_hears_a_situation_after_many_advisories(face: Served) -> None:
    async with connect(face.stream("?kinds=situation")) as subscriber:
        for first in range(1, 3000, 1000):
            await face.publish(*(made(number) for number in range(first, first + 1000)))
        await face.publish(situation(1))
        assert json.loads(await subscriber.recv())["seq"] == 3001


@pytest.mark.parametrize("kinds", ["", "rumour", "conflict,", "Situation", "\u00e9" * 900])
async def test_unknown_kinds_are_refused_with_the_reason(face: Served, kinds: str) -> None:
    async with connect(face.stream(f"?kinds={kinds}")) as subscriber:
        with pytest.raises(ConnectionClosedError, match="expected situation, advice, advisory") as closed:
            await subscriber.recv()
    assert closed.value.rcvd
    assert closed.value.rcvd.code == BAD_KINDS


@pytest.mark.parametrize("after", ["x", "-1", "1.5", "", "%C2%B2", "9" * 19])
async def test_an_after_that_is_not_a_number_is_refused_with_the_reason(face: Served, after: str) -> None:
    async with connect(face.stream(f"?after={after}")) as subscriber:
        with pytest.raises(ConnectionClosedError, match="whole number") as closed:
            await subscriber.recv()
    assert closed.value.rcvd
    assert closed.value.rcvd.code == BAD_AFTER


async def test_after_beyond_the_last_number_is_refused_and_the_last_itself_is_not(face: Served) -> None:
    await face.publish(made(1))
    async with connect(face.stream("?after=2")) as subscriber:
        with pytest.raises(ConnectionClosedError, match="beyond the last seq 1") as closed:
            await subscriber.recv()
    assert closed.value.rcvd
    assert closed.value.rcvd.code == POSITION_LOST
    async with connect(face.stream("?after=1")) as subscriber:
        await face.publish(made(2))
        assert json.loads(await subscriber.recv())["seq"] == 2


def with_removed(folder: Path) -> None:
    """Numbers 1 to 6 of a store, of which 2 and 3, a conflict, and 5, its situation, were removed."""
    store = Store(folder)
    store.append([made(1), made(2), cleared(2), situation(1), cleared_situation(2, 1), made(3)])
    assert store.prune(START + timedelta(days=1)) == 2
    store.close()


@pytest.mark.parametrize("query", ["?after=1", "?after=2", "?after=4&kinds=situation", "?after=2&kinds=conflict"])
async def test_a_subscriber_that_missed_what_was_removed_is_told_to_read_again(tmp_path: Path, query: str) -> None:
    with_removed(tmp_path)
    async with served(tmp_path) as face, connect(face.stream(query)) as subscriber:
        with pytest.raises(ConnectionClosedError, match="removed; get /advisories afresh") as closed:
            await subscriber.recv()
    assert closed.value.rcvd
    assert closed.value.rcvd.code == POSITION_LOST


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("?after=0&kinds=situation,advisory", [1, 4, 6, 7]),
        ("?after=3", [6, 7]),
        ("?after=5&kinds=situation,advisory", [6, 7]),
        ("?after=1&kinds=deadlock", [7]),
        ("", [7]),
    ],
)
async def test_a_subscriber_that_missed_nothing_of_its_kinds_hears_what_is_left(
    tmp_path: Path, query: str, expected: list[int]
) -> None:
    with_removed(tmp_path)
    async with served(tmp_path) as face, connect(face.stream(query)) as subscriber:
        await face.publish(deadlock("r-1", "r-2"))
        assert [json.loads(await subscriber.recv())["seq"] for _ in expected] == expected


async def test_a_new_subscriber_is_told_if_something_is_removed_while_it_reads(tmp_path: Path) -> None:
    with_removed(tmp_path)
    store = Store(tmp_path)
    store.append([made(number) for number in range(4, 4 + MOST_LINES)] + [cleared(4)])
    store.close()
    async with served(tmp_path) as face:
        page_after = face.publisher.after

        async def after(seq: int, kinds: Set[str] = EVERY_KIND, removed_to: int = 0) -> PublishedPage:
            page = await page_after(seq, kinds, removed_to)
            face.store.prune(START + timedelta(days=1))
            return page

        face.publisher.after = after  # type: ignore[method-assign]
        async with connect(face.stream("?after=0")) as subscriber:
            for _ in range(MOST_LINES):
                await subscriber.recv()
            with pytest.raises(ConnectionClosedError, match="some revisions after 104 were removed"):
                await subscriber.recv()


async def test_a_subscriber_of_a_new_file_whose_numbers_continue_is_told_to_read_again(tmp_path: Path) -> None:
    with_removed(tmp_path)
    (tmp_path / "advisories.db").unlink()
    async with served(tmp_path) as face, connect(face.stream("?after=6")) as subscriber:
        with pytest.raises(ConnectionClosedError, match="removed; get /advisories afresh"):
            await subscriber.recv()


async def test_subscribers_are_counted_while_they_stay(face: Served) -> None:
    async with connect(face.stream()), connect(face.stream()):
        await until(lambda: face.measured("deconflict_stream_subscribers") == 2)
    await until(lambda: face.measured("deconflict_stream_subscribers") == 0)
    assert face.measured("deconflict_stream_dropped_total") == 0


async def test_messages_of_a_subscriber_are_ignored_unless_they_are_too_long(face: Served) -> None:
    async with connect(face.stream()) as subscriber:
        await subscriber.send("hello")
        await subscriber.send(b"hello")
        await face.publish(made(1))
        assert json.loads(await subscriber.recv())["seq"] == 1
        await subscriber.send("x" * 100_000)
        with pytest.raises(ConnectionClosedError):
            await subscriber.recv()
    await until(lambda: face.measured("deconflict_stream_subscribers") == 0)


async def test_a_subscriber_that_floods_is_ended_with_the_reason_and_one_that_pings_now_and_then_is_not(
    face: Served,
) -> None:
    async with connect(face.stream()) as subscriber, connect(face.stream()) as flooding:
        flooding.transport.write(Frame(Opcode.PING, b"").serialize(mask=True) * 10_000)
        with pytest.raises(ConnectionClosedError) as ended:
            await flooding.recv()
        assert ended.value.rcvd is None or ended.value.rcvd.reason == "a subscriber has nothing to send but a few pings"
        for _ in range(20):
            await (await subscriber.ping())
        await face.publish(made(1))
        assert json.loads(await subscriber.recv())["seq"] == 1


async def test_a_revision_for_a_subscriber_that_has_just_been_ended_is_no_fault(
    face: Served, caplog: pytest.LogCaptureFixture
) -> None:
    async with connect(face.stream()):
        await until(lambda: face.measured("deconflict_stream_subscribers") == 1)
        (connection,) = face.server.server_state.connections
        assert isinstance(connection, WebSocketProtocol)
        connection.keepalive_timeout()
        with pytest.raises(ClientDisconnected):
            await connection.send({"type": "websocket.send", "text": "{}"})
        await face.publish(made(1))
        await until(lambda: face.measured("deconflict_stream_subscribers") == 0)
    assert "Exception in ASGI application" not in caplog.text


async def test_pings_of_a_subscriber_that_reads_nothing_are_not_answered(face: Served) -> None:
    stuck = await stuck_subscriber(face)
    (connection,) = face.server.server_state.connections
    assert isinstance(connection, WebSocketProtocol)
    connection.pause_writing()
    before = connection.transport.get_write_buffer_size()
    connection.data_received(Frame(Opcode.PING, b"there?").serialize(mask=True))
    assert connection.transport.get_write_buffer_size() == before
    assert connection.conn.data_to_send() == []
    stuck.close()


async def test_a_stuck_subscriber_is_dropped_and_the_others_go_on(tmp_path: Path) -> None:
    async with served(tmp_path, stream_send_timeout_s=600.0) as face:
        site = face.app.state.site
        operator = site.operator.model_copy(update={"stream_send_timeout_s": 0.5})
        face.app.state.site = site.model_copy(update={"operator": operator})
        stuck = await stuck_subscriber(face)
        listening = asyncio.create_task(heard(face, None, 101))
        await until(lambda: face.measured("deconflict_stream_subscribers") == 2)
        for number in range(1, 101):
            await face.publish(made(number, summary="x" * 100_000))
        await until(lambda: face.measured("deconflict_stream_subscribers") == 1)
        assert face.measured("deconflict_stream_dropped_total") == 1
        await until(lambda: face.connections() == 1)
        await face.publish(made(101))
        assert await listening == list(range(1, 102))
        assert face.measured("deconflict_stream_dropped_total") == 1
        stuck.close()


async def test_small_messages_are_sent_without_waiting_for_more(face: Served) -> None:
    async with connect(face.stream()):
        await until(lambda: face.measured("deconflict_stream_subscribers") == 1)
        (connection,) = face.server.server_state.connections
        served_socket = connection.transport.get_extra_info("socket")
        assert served_socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


async def test_a_store_that_fails_ends_the_stream_with_the_reason(face: Served) -> None:
    await face.publish(made(1))
    face.store.close()
    async with connect(face.stream("?after=0")) as subscriber:
        with pytest.raises(ConnectionClosedError, match="healthz") as closed:
            await subscriber.recv()
    assert closed.value.rcvd
    assert closed.value.rcvd.code == STORE_FAILED


async def test_stopping_the_server_ends_streams_even_those_of_stuck_subscribers(tmp_path: Path) -> None:
    async with served(tmp_path) as face:
        subscriber = await connect(face.stream())
        stuck = await stuck_subscriber(face)
        for number in range(1, 101):
            await face.publish(made(number, summary="x" * 100_000))
            await subscriber.recv()
    assert face.connections() == 0
    await subscriber.wait_closed()
    assert subscriber.close_code == RESTARTING
    stuck.close()
