"""A fleet, and how to read its counters and documents."""

from typing import Any

import numpy as np

from ingest.fleet import fleet_report
from ingest.fleet.fleet import Fleet
from ingest.fleet.owners.vendor_registry import VendorRegistry
from ingest.fleet.prediction.forecast_model import Forecast
from ingest.fleet.shown.quarantine import Quarantine
from ingest.frames.frame_registry import FrameRegistry
from ingest.measures.measures import Measures
from ingest.port.connection import Connection
from ingest.settings import Datum, Reading, Vendor
from tests.helpers.saying import HALL, robot
from tests.helpers.vda_saying import MAP

NOW_S = 1_790_000_000.0


LINE = Connection(1)


def fleet(*vendors: Vendor, datums: tuple[Datum, ...] = (Datum(id=HALL, name="Hall"),), **reading: Any) -> Fleet:
    measures = Measures()
    return Fleet(VendorRegistry(vendors), FrameRegistry(datums, vendors), Reading(**reading), measures, Quarantine())


def counted(of: Fleet, name: str) -> dict[tuple[str, ...], float]:
    return of.measures.values[f"deconflict_{name}"]


def document(of: Fleet, name: str, now_s: float = NOW_S) -> dict[str, Any]:
    return fleet_report.robot_document(of, of.robots[robot(name)], now_s)


def documents(of: Fleet, now_s: float = NOW_S) -> list[dict[str, Any]]:
    """The documents of all robots, by UUID."""
    return [fleet_report.robot_document(of, of.robots[uuid], now_s) for uuid in sorted(of.robots)]


def hall() -> Fleet:
    return fleet(datums=(Datum(id=MAP, name="Hall"), Datum(id=HALL, name="Other hall")))


def at(forecast: Forecast | None, t_s: float) -> tuple[float, float, float]:
    """x, y and yaw at a time."""
    assert forecast is not None
    knots = np.array(forecast.knots)
    x, y = (float(np.interp(t_s, knots[:, 0], knots[:, column])) for column in (1, 2))
    return x, y, float(np.interp(t_s, knots[:, 0], np.unwrap(knots[:, 3])))
