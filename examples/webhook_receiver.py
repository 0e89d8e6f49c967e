"""A receiver of webhooks that accepts only what the service has signed. It needs Python's standard library alone.

    DECONFLICT_SECRET=replace-this-secret python examples/webhook_receiver.py 9000

It prints one line for each revision. `DECONFLICT_SECRET` is the secret of the webhook in the site file, of
at least 16 characters.
"""

import argparse
import hmac
import json
import os
import sys
import time
from base64 import b64decode, b64encode
from email.message import Message
from hashlib import sha256
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

TOLERANCE_S = 300
"""A request whose time differs by more may be an old one that somebody else sends again."""
MOST_BYTES = 100_000
WAIT_S = 10


def is_signed(headers: Message, body: bytes, secret: str, now_s: float) -> bool:
    """Whether the service sent this body lately. A secret that begins with `whsec_` is base64."""
    message_id, stamp = headers.get("webhook-id", ""), headers.get("webhook-timestamp", "")
    if not (stamp.isascii() and stamp.isdigit() and abs(now_s - int(stamp)) <= TOLERANCE_S):
        return False
    coded = secret.removeprefix("whsec_")
    key = b64decode(coded) if coded != secret else secret.encode()
    content = f"{message_id}.{stamp}.".encode() + body
    expected = b"v1," + b64encode(hmac.digest(key, content, sha256))
    return any(hmac.compare_digest(expected, each.encode()) for each in headers.get("webhook-signature", "").split())


class Receiver(BaseHTTPRequestHandler):
    """Answers 204 to a signed revision once it is handled. The service sends a revision again until then."""

    timeout = WAIT_S
    secret = ""

    def do_POST(self) -> None:
        length = self.headers.get("content-length", "")
        if not (length.isascii() and length.isdigit() and int(length) <= MOST_BYTES):
            self._answer(413)
            return
        body = self.rfile.read(int(length))
        if is_signed(self.headers, body, self.secret, time.time()):
            self._handle(json.loads(body))
            self._answer(204)
        else:
            self._answer(401)

    def _handle(self, revision: dict[str, Any]) -> None:
        """Print a revision. After a crash of the service it may come a second time, with the same `seq`."""
        sys.stdout.write(f"{revision['seq']} {revision['state']} {revision['kind']}: {revision['summary']}\n")
        sys.stdout.flush()

    def _answer(self, status: int) -> None:
        self.send_response(status)
        self.send_header("content-length", "0")
        self.end_headers()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Prints the revisions that the service has signed.")
    parser.add_argument("port", type=int, help="where to listen, on 127.0.0.1")
    port = parser.parse_args().port
    if not os.environ.get("DECONFLICT_SECRET"):
        parser.error("DECONFLICT_SECRET is required: the secret of the webhook in the site file")
    Receiver.secret = os.environ["DECONFLICT_SECRET"]
    ThreadingHTTPServer(("127.0.0.1", port), Receiver).serve_forever()
