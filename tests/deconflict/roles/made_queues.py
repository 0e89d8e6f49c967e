"""A site with shared places, and scripted robots that queue there."""

from deconflict.settings.site import Operator
from ingest.settings import ReceiverSettings
from tests.deconflict.contention.scenes import Script, aisle, resource, site

SITE = site(
    aisle("lane", -8, 12),
    resource("c1", 0, 40, kind="charger", service_s=100.0),
    receiver=ReceiverSettings(port=0),
    operator=Operator(port=0),
)


def scripts() -> dict[str, Script]:
    """Two that drive into a lane from both ends, and two that wait for a charger that a third one has."""

    def waits(_: float) -> str:
        return "waitingExternalEvent"

    return {
        "A": Script([(0, -14, 0), (60, 46, 0)]),
        "B": Script([(0, 18, 0), (60, -42, 0)], vendor="Corvid"),
        "C": Script([(0, 0, 40)], state=lambda _: "charging"),
        "D": Script([(0, 30, 40)], [(60, 0, 40)], state=waits),
        "E": Script([(0, 30, 50)], [(70, 0, 40)], vendor="Basalt", state=waits),
    }
