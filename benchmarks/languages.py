"""The processor time of one message of each language, from bytes to a row of a batch: `python -m benchmarks.languages`.

Robots with ten points, or ten nodes, ahead of them. Beside it stands the time of `json.loads` and a validation by the
JSON Schema of the standard alone (ISO 21423: none that is free). Each is the best of many short runs.
"""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

from benchmarks.messages import ROBOTS, SITE, START_S, Lines, conforming, identity, later, row_us, us
from deconflict.settings.fleet_factory import fast_fleet_of, fleet_of
from ingest.languages.massrobotics.report_models import StatusReport
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from tests.helpers import iso_saying, vda_saying

AHEAD = 10
SPEED_MPS = 1.0
SCHEMA = Path(__file__).parents[1] / "tests/helpers/vda5050_schemas/2.1.0/state.schema.json"
SOCKET = Connection(1)


def massrobotics(second: int) -> Iterator[tuple[bytes, Connection]]:
    """The statuses of all robots; before the first second their identities."""
    for robot in range(ROBOTS):
        uuid = f"6b2f3f0a-54a2-4d6e-9b0e-{robot:012x}"
        report = identity(uuid) if second < 0 else later(conforming() | {"uuid": uuid}, second)
        yield json.dumps(report).encode(), SOCKET


def vda5050(second: int) -> Iterator[tuple[bytes, Connection]]:
    """The states of all robots; before the first second their factsheets and orders."""
    nodes = [vda_saying.node(number, 10.0 * number) for number in range(AHEAD + 1)]
    t_s = START_S + second
    for robot in range(ROBOTS):
        serial = f"{robot:05}"
        keys: dict[str, Any] = {"serialNumber": serial}
        if second < 0:
            yield vda_saying.factsheet(t_s, **keys), vda_saying.line("factsheet", serial)
            yield vda_saying.order(t_s, nodes, **keys), vda_saying.line("order", serial)
        else:
            velocity = {"vx": SPEED_MPS, "vy": 0.0, "omega": 0.0}
            raw = vda_saying.under_way(t_s, SPEED_MPS * second / 2, 0.0, nodes[1:], velocity=velocity, **keys)
            yield raw, vda_saying.line("state", serial)


def iso21423(second: int) -> Iterator[tuple[bytes, Connection]]:
    """A trajectory and an odometry of each robot; before the first second their identities and states."""
    t_s = START_S + second
    for robot in range(ROBOTS):
        uuid = f"91403a21-7534-4467-99a6-{robot:012d}"
        ahead = [(t_s + i, SPEED_MPS * (second + i), 0.0) for i in range(1, AHEAD + 1)]
        first = iso_saying.identity(t_s), iso_saying.states(t_s, "MODE_AUTO", "FORWARD")
        then = iso_saying.trajectory(t_s, *ahead), iso_saying.odometry(t_s, SPEED_MPS * second, 0.0, 0.0, SPEED_MPS)
        raws, kinds = (first, ("identity", "status")) if second < 0 else (then, ("localTrajectory", "odometry"))
        for raw, kind in zip(raws, kinds, strict=True):
            yield raw, iso_saying.line(kind, uuid)


def validation_us(raw: bytes, schema: dict[str, Any]) -> float:
    """Of `json.loads` and a validation by a schema."""
    validator = Draft202012Validator(schema)
    if not validator.is_valid(json.loads(raw)):
        raise SystemExit("a message is not valid by its schema")
    return us(lambda: validator.validate(json.loads(raw)))


def main() -> None:
    lines: dict[str, Lines] = {"massrobotics": massrobotics, "vda5050": vda5050, "iso21423": iso21423}
    schemas = {"massrobotics": StatusReport.model_json_schema(by_alias=True), "vda5050": json.loads(SCHEMA.read_text())}
    slow_us = row_us(fleet_of(SITE, Measures()), massrobotics)
    print(f"{'language':<26}{'bytes':>7}{'loads us':>10}{'+ schema us':>13}{'to a batch us':>15}{'ratio':>7}")
    for name, of_second in lines.items():
        raw, _ = next(iter(of_second(0)))
        alone_us, schema = us(partial(json.loads, raw)), schemas.get(name)
        checked = f"{validation_us(raw, schema):>13.0f}" if schema else f"{'-':>13}"
        whole_us = slow_us if name == "massrobotics" else row_us(fleet_of(SITE, Measures()), of_second)
        print(f"{name:<26}{len(raw):>7}{alone_us:>10.1f}{checked}{whole_us:>15.1f}{whole_us / slow_us:>7.2f}")
    fast_us = row_us(fast_fleet_of(SITE, Measures()), massrobotics)
    print(f"{'massrobotics, compiled':<26}{'':>30}{fast_us:>15.1f}{fast_us / slow_us:>7.2f}")


if __name__ == "__main__":
    main()
