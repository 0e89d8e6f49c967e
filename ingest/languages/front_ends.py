"""The languages that are read, by name."""

from ingest.languages.front_end import FrontEnd
from ingest.languages.iso21423.iso_front_end import IsoFrontEnd
from ingest.languages.massrobotics.massrobotics_front_end import MassRoboticsFrontEnd
from ingest.languages.vda5050.vda_front_end import VdaFrontEnd

MASSROBOTICS = "massrobotics"
"""The language of WebSockets."""
FRONT_ENDS: dict[str, FrontEnd] = {
    MASSROBOTICS: MassRoboticsFrontEnd(),
    "vda5050": VdaFrontEnd(),
    "iso21423": IsoFrontEnd(),
}


def language_of_topic(topic: str) -> str | None:
    """The language of a topic of a broker, by its form. None if no language has such topics."""
    return next((name for name, front_end in FRONT_ENDS.items() if front_end.has_topic(topic)), None)
