"""How messages are read: robots of a kind in one way, which is then at hand from one to the next."""

from functools import lru_cache, partial

from ingest.fleet.forecast import Body, View, body_of
from ingest.fleet.robot import Robot
from ingest.fleet.vendor_registry import Vendors
from ingest.frames.floor_index import Floors
from ingest.settings import Reading

SHARED = 1024
"""Ways to read messages that robots have in common, at most."""


class Views:
    """Of each robot, by what it is and carries and where it says that it is."""

    def __init__(self, vendors: Vendors, floors: Floors, reading: Reading) -> None:
        self._vendors, self._floors, self._reading = vendors, floors, reading
        self._shared = lru_cache(SHARED)(self._new)

    def renew(self, vendors: Vendors, reading: Reading) -> None:
        """Read by other settings from now on."""
        self._vendors, self._reading = vendors, reading
        self._shared.cache_clear()

    def of(self, robot: Robot, loaded: bool, datum: str) -> View:
        """How a message is read of the robot with its load, on a datum: mostly as the one before."""
        of = loaded, datum
        if robot.view is None or robot.view_of != of:
            robot.view, robot.view_of = self._shared(robot.vendor, datum, self._body(robot, loaded)), of
        return robot.view

    def _new(self, vendor: str, datum: str, body: Body) -> View:
        return View(body, partial(self._floors.named, vendor, datum), self._reading)

    def _body(self, robot: Robot, loaded: bool) -> Body:
        if robot.identity is None:
            vendor = self._vendors.settings(robot.vendor)
            return Body(vendor.default_envelope_m or self._reading.default_envelope_m)
        model = self._vendors.model(robot.vendor, robot.identity.model)
        return body_of(model, robot.identity.envelope_m, loaded, robot.identity.max_speed_mps)
