"""The languages that are read, by name."""

from ingest.languages.front_end import FrontEnd
from ingest.languages.massrobotics.massrobotics_front_end import MassRoboticsFrontEnd

MASSROBOTICS = "massrobotics"
"""The language of WebSockets."""
FRONT_ENDS: dict[str, FrontEnd] = {
    MASSROBOTICS: MassRoboticsFrontEnd(),
}
