"""From the bytes of a message of VDA 5050 to a model of it, with the deviations of its keys and header."""

from operator import attrgetter

from ingest.languages import tolerant_json
from ingest.languages.rules import Findings
from ingest.languages.vda5050.vda_messages import KINDS, REQUIRED, Header

_REQUIRED_KEYS = {kind: attrgetter(*keys) for kind, keys in REQUIRED.items()}
_READABLE = ("2.", "3.")
"""Versions begin with one of these."""


def decoded(kind: str, raw: bytes, findings: Findings) -> Header:
    """The message of a topic that ends in `kind`. Raises `RejectedError` if it can't be understood."""
    message = tolerant_json.decoded(KINDS[kind], raw, findings)
    if None in _REQUIRED_KEYS[kind](message):
        findings["key-absent"] = None
    if message.version and not message.version.startswith(_READABLE):
        findings["version-unknown"] = None
    return message
