import pytest

from ingest.port.connection import Connection


@pytest.mark.parametrize(
    ("connection", "source"),
    [
        (Connection(1, "10.0.0.7"), "10.0.0.7"),
        (Connection(2, "10.0.0.7", "/Alder", "Alder"), "10.0.0.7"),
        (Connection(3, "10.0.0.7", vendor="Alder", proven=True), "vendor Alder"),
        (Connection(4, "10.0.0.7", proven=True), "10.0.0.7"),
        (Connection(5, "2001:db8:1:2:aaaa::1"), "2001:db8:1:2::"),
        (Connection(6, "2001:db8:1:2:bbbb::2", vendor="Basalt"), "2001:db8:1:2::"),
        (Connection(7, "::ffff:10.0.0.7"), "10.0.0.7"),
        (Connection(8, "hall", topic="uagv/v2/KIT/1/state", vendor="KIT", proven=True), "broker hall uagv/v2 KIT"),
        (Connection(9, "hall", topic="uagv/v2/One/1/state", vendor="One"), "broker hall uagv/v2"),
        (Connection(10, "hall", topic="uagv/v2/Two/2/state", vendor="Two"), "broker hall uagv/v2"),
        (Connection(11, "hall", topic="/ISO_21423/v1/AMR/4/odometry"), "broker hall /ISO_21423/v1"),
        (Connection(12, "hall", topic="KIT/1/state", vendor="KIT", proven=True), "broker hall KIT"),
    ],
    ids=lambda value: str(value.id) if isinstance(value, Connection) else None,
)
def test_the_source_of_a_connection_is_what_it_proves_and_not_what_it_claims(
    connection: Connection, source: str
) -> None:
    assert connection.source == source


def test_a_sender_of_many_makers_is_as_many_sources_as_it_has_connections_to_prove() -> None:
    topics = [f"uagv/v2/Maker {n}/{n}/state" for n in range(3000)]
    on_a_broker = {Connection(n, "hall", topic=topic, vendor=topic[8:18]).source for n, topic in enumerate(topics)}
    over_sockets = {Connection(n, "10.0.0.7", f"/V{n}", f"V{n}").source for n in range(64)}
    assert len(on_a_broker) == len(over_sockets) == 1
