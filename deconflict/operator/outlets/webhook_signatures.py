"""Signatures of webhooks, as the Standard Webhooks specification 1.0 has them (symmetric, `v1`)."""

import hmac
from base64 import b64decode, b64encode
from collections.abc import Mapping
from hashlib import sha256

from deconflict.advisory import ADVISORY, AnyAdvisory

TOLERANCE_S = 300.0
"""A request whose time is further off than this may be an old one sent again by somebody else."""

CODED = "whsec_"


class SignatureError(ValueError):
    """A request that was not sent by who knows the secret, or not now."""


def signed(message_id: str, body: bytes, secret: str, now_s: float) -> dict[str, str]:
    """The headers of a request with this body."""
    stamp = str(int(now_s))
    return {
        "webhook-id": message_id,
        "webhook-timestamp": stamp,
        "webhook-signature": f"v1,{_signature(message_id, stamp, body, secret)}",
    }


def verified(headers: Mapping[str, str], body: bytes, secret: str, now_s: float) -> AnyAdvisory:
    """The advisory of a request, header names in lower case. Raises `SignatureError`."""
    message_id, stamp = headers.get("webhook-id", ""), headers.get("webhook-timestamp", "")
    if not (stamp.isascii() and stamp.isdigit() and abs(now_s - int(stamp)) <= TOLERANCE_S):
        raise SignatureError(f"webhook-timestamp: found {stamp!r}; expected seconds since the epoch, of now")
    wanted = f"v1,{_signature(message_id, stamp, body, secret)}"
    told = headers.get("webhook-signature", "").split()
    if not any(hmac.compare_digest(wanted.encode(), one.encode()) for one in told):
        raise SignatureError("webhook-signature: is not that of the body and the shared secret")
    return ADVISORY.validate_json(body)


def _signature(message_id: str, stamp: str, body: bytes, secret: str) -> str:
    signing = f"{message_id}.{stamp}.".encode() + body
    return b64encode(hmac.digest(_key(secret), signing, sha256)).decode()


def _key(secret: str) -> bytes:
    """A secret that begins with `whsec_` is base64, any other is meant as it stands."""
    coded = secret.removeprefix(CODED)
    return b64decode(coded) if coded != secret else secret.encode()
