"""Signatures of webhooks by the Standard Webhooks specification 1.0 (symmetric, `v1`)."""

import hmac
from base64 import b64decode, b64encode
from collections.abc import Mapping
from hashlib import sha256

from deconflict_client.situations import REVISION, AnyRevision

TOLERANCE_S = 300.0
"""A request whose time differs by more may be an old one that somebody else sends again."""

BASE64_PREFIX = "whsec_"


class SignatureError(ValueError):
    """The sender of the request does not know the secret, or the request is old."""


def signed(message_id: str, body: bytes, secret: str, now_s: float) -> dict[str, str]:
    """The signature headers of a request with this body."""
    stamp = str(int(now_s))
    return {
        "webhook-id": message_id,
        "webhook-timestamp": stamp,
        "webhook-signature": f"v1,{_signature(message_id, stamp, body, secret)}",
    }


def verified(headers: Mapping[str, str], body: bytes, secret: str, now_s: float) -> AnyRevision:
    """The revision in a request. Header names are in lower case. Raises `SignatureError`."""
    message_id, stamp = headers.get("webhook-id", ""), headers.get("webhook-timestamp", "")
    if not (stamp.isascii() and stamp.isdigit() and abs(now_s - int(stamp)) <= TOLERANCE_S):
        raise SignatureError(f"webhook-timestamp: found {stamp!r}; expected the present time, seconds since the epoch")
    expected = f"v1,{_signature(message_id, stamp, body, secret)}"
    signatures = headers.get("webhook-signature", "").split()
    if not any(hmac.compare_digest(expected.encode(), signature.encode()) for signature in signatures):
        raise SignatureError("webhook-signature: does not match the body and the shared secret")
    return REVISION.validate_json(body)


def _signature(message_id: str, stamp: str, body: bytes, secret: str) -> str:
    content = f"{message_id}.{stamp}.".encode() + body
    return b64encode(hmac.digest(_key(secret), content, sha256)).decode()


def _key(secret: str) -> bytes:
    """A secret that begins with `whsec_` is base64; any other is used as it is."""
    coded = secret.removeprefix(BASE64_PREFIX)
    return b64decode(coded) if coded != secret else secret.encode()
