"""Delivery of the engine's decisions to the operator face, by a thread of its own."""

import json
import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

from pydantic_core import to_json

from deconflict.adviser.advice_lifecycle import AnsweredAdvice
from deconflict.engine.message_latency import observe_latency
from deconflict.operator.ledger.loss_ledger import LedgerEntry
from deconflict.runtime.learned_state import Part, packed
from deconflict.runtime.parcels import MOST_LINES, REFUSED, STORED, cut_into_parcels, packed_parcel
from deconflict.runtime.rpc import Caller, LinkDownError
from deconflict.runtime.set_asides import SetAsides
from deconflict_client.advisory import AnyAdvisory
from deconflict_client.advisory.robot_advice import RobotAdvice
from ingest.batch import Floats
from ingest.measures.measures import Measures

MEASURES_EVERY_S, ANSWERS_EVERY_S = 1.0, 0.25
RETRY_S, MOST_RETRY_S = 0.2, 2.0
"""First and longest pause before a parcel is sent again."""
STUCK_S = 5.0
"""If too much waits and none of it was taken for this long, the engine ends."""
MOST_WAITING_BYTES = 64 << 20
"""If more waits for the operator face, some five minutes of a crowded floor, the engine makes no further pass."""

log = logging.getLogger(__name__)


class UndeliveredError(Exception):
    """The operator face has taken nothing for long."""

    def __init__(self) -> None:
        size = f"{MOST_WAITING_BYTES >> 20} MiB"
        super().__init__(
            f"{size} wait for an operator face that has taken nothing for {STUCK_S:g} s; "
            "they are dropped, and the engine starts again once it answers"
        )


class DeliveryFaultError(Exception):
    """Nothing is delivered any more, after a fault of the program."""


class WaitingParcel(NamedTuple):
    """Revisions that the operator face has not taken yet, and the messages that they reflect."""

    payload: bytes
    """The packed parcel. Empty if a pass decided nothing."""
    arrivals_s: dict[str, Floats]
    """By vendor, the arrival times of the messages that are reflected once this parcel is stored."""

    @property
    def size_bytes(self) -> int:
        """Approximate memory."""
        return len(self.payload) + sum(arrived_s.nbytes for arrived_s in self.arrivals_s.values())


class Delivery:
    """Delivers revisions in order, in parcels. Sends each parcel again until the operator face has taken it."""

    def __init__(self, runtime: Path) -> None:
        self.runtime = runtime
        self.measures = Measures()
        self.set_asides = SetAsides(self.measures)
        self._operator = Caller(runtime, "operator")
        self._waiting: queue.SimpleQueue[WaitingParcel | None] = queue.SimpleQueue()
        self._sender, self._lost = uuid4().hex, 0
        """The name under which losses are sent, and the number of their last parcel."""
        self._added_bytes = self._delivered_bytes = 0
        self._learned: deque[tuple[dict[str, Part], dict[str, Part]]] = deque(maxlen=1)
        self._answers: deque[AnsweredAdvice] = deque()
        self._answers_seq, self._answers_s, self._asks = -1, 0.0, False
        """The last number of the stream that was read for answers, when that was, and whether there may be any."""
        self._thread = threading.Thread(target=self._deliver, name="delivery")
        self._fault: Exception | None = None
        """What has ended the thread before its time."""
        self._stopping = threading.Event()
        self._sending_since_s: float | None = None
        """Since when the first parcel is being sent, monotonic time; None if none waits."""
        self._measured_s = 0.0
        self._passes_s: list[float] = []
        """Times of the passes that no parcel names yet, in their order."""

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Deliver what waits, up to the first parcel that is not taken at once, and end."""
        self._stopping.set()
        self._waiting.put(None)
        self._thread.join()
        self._operator.close()

    def has_room(self) -> bool:
        """Whether another pass may be added. Raises `UndeliveredError` if nothing is taken any more, and
        `DeliveryFaultError` if nothing is sent."""
        if self._fault:
            raise DeliveryFaultError("the engine starts again and delivers what is open") from self._fault
        if self._added_bytes - self._delivered_bytes <= MOST_WAITING_BYTES:
            return True
        since_s = self._sending_since_s
        if since_s is not None and time.monotonic() - since_s > STUCK_S:
            raise UndeliveredError
        return False

    def add_pass(
        self,
        now_s: float,
        revisions: Sequence[AnyAdvisory],
        arrivals_s: dict[str, Floats],
        measures: Measures,
        near_misses: Sequence[tuple[str, str, float, tuple[str, str]]] = (),
        presence: Callable[[], dict[str, Any] | None] = lambda: None,
        losses: Sequence[LedgerEntry] = (),
    ) -> None:
        """Queue one pass: its revisions, near misses and losses, and once a second its measures and presence.

        Measures wait for the revisions before them, also while the store refuses these. `now_s` is the time of the
        pass. `arrivals_s` has by vendor the arrival times of the messages that it reflects.
        """
        self._passes_s.append(now_s)
        queued_s = time.monotonic()
        is_due = queued_s - self._measured_s >= MEASURES_EVERY_S
        report: dict[str, Any] = {}
        if losses:
            self._lost += 1
            report["losses"] = {"sender": self._sender, "number": self._lost, "entries": losses}
        near = [near_misses[first : first + MOST_LINES] for first in range(0, len(near_misses), MOST_LINES)]
        parts = list(zip_longest(cut_into_parcels(self._lines(revisions)), near, fillvalue=()))
        parts = parts or ([((), ())] if report else [])
        if parts:
            report["passes_s"], self._passes_s = self._passes_s, []
        for number, (lines, pairs) in enumerate(parts, 1):
            head = {"queued_s": queued_s, "near_misses": pairs, **(report if number == len(parts) else {})}
            self._add(WaitingParcel(packed_parcel(head, lines), arrivals_s if number == len(parts) else {}))
        if not parts:
            self._add(WaitingParcel(b"", arrivals_s))
        if is_due:  # after the revisions, which do not wait for it
            self._measured_s, passes_s, self._passes_s = queued_s, self._passes_s, []
            documents = [measures.as_document(), self.measures.as_document()]
            head = {"measures": documents, "presence": presence(), "passes_s": passes_s}
            self._add(WaitingParcel(packed_parcel(head), {}))

    def add_canary(self, canary: dict[str, Any]) -> None:
        """Queue what the engine made of a canary."""
        self._add(WaitingParcel(packed_parcel({"canary": canary}), {}))

    def add_advice(self, revisions: Sequence[RobotAdvice]) -> None:
        """Queue what is asked of robots."""
        for lines in cut_into_parcels(self._lines(revisions)):
            self._add(WaitingParcel(packed_parcel({}, lines), {}))
        self._asks = True

    def take_answers(self) -> list[AnsweredAdvice]:
        """The answers to advice that have come since the last call."""
        return [self._answers.popleft() for _ in range(len(self._answers))]

    def keep(self, learned: dict[str, Part], under_way: dict[str, Part]) -> None:
        """Deliver the learned state, and what is under way, after the next parcel. Replaces what still waits."""
        self._learned.append((learned, under_way))

    def _lines(self, revisions: Iterable[AnyAdvisory | RobotAdvice]) -> Iterator[bytes]:
        """Each revision as a line of JSON."""
        for revision in revisions:
            try:
                yield to_json(revision)
            except ValueError as error:
                self.set_asides.add("invalid", f"{revision.id}, revision {revision.revision}", error)

    def _add(self, parcel: WaitingParcel) -> None:
        self._added_bytes += parcel.size_bytes
        self._waiting.put(parcel)

    def _deliver(self) -> None:
        try:
            self._deliver_all()
        except Exception as error:  # noqa: BLE001 - the engine ends with it
            self._fault = error

    def _deliver_all(self) -> None:
        while (parcel := self._waiting.get()) is not None:
            if parcel.payload and not self._is_taken(parcel.payload):
                waiting_mb = (self._added_bytes - self._delivered_bytes) / 1e6
                log.warning("%.1f MB of decisions are not delivered: the operator face takes nothing", waiting_mb)
                break
            self._delivered_bytes += parcel.size_bytes
            observe_latency(self.measures, parcel.arrivals_s, time.time())
            self._deliver_learned()
            self._fetch_answers()
        self._deliver_learned()

    def _deliver_learned(self) -> None:
        with suppress(LinkDownError):  # the next one comes in a minute
            while self._learned:
                learned, under_way = self._learned.pop()
                self._operator.call("under_way", packed(under_way))
                self._operator.call("learn", packed(learned))

    def _fetch_answers(self) -> None:
        """Ask the operator face for answers to advice, some times a second."""
        is_due = self._asks and time.monotonic() - self._answers_s >= ANSWERS_EVERY_S
        if self._answers_seq >= 0 and not is_due:
            return
        self._answers_s = time.monotonic()
        with suppress(LinkDownError):  # the next call asks for the same
            found = json.loads(self._operator.call("answers", b"%d" % self._answers_seq))
            self._answers_seq = found["last"]
            self._answers.extend(AnsweredAdvice(*answer) for answer in found["answers"])

    def _is_taken(self, payload: bytes) -> bool:
        """Send a parcel until it is taken. False if it was not and this is to stop."""
        self._sending_since_s, retry_s = time.monotonic(), RETRY_S
        while (answer := self._answer(payload)) != STORED:
            retry_s = min(2 * retry_s, MOST_RETRY_S) if answer == REFUSED else RETRY_S
            if self._stopping.wait(retry_s):
                return False
        self._sending_since_s = None
        return True

    def _answer(self, payload: bytes) -> bytes | None:
        """None if the operator face does not answer."""
        try:
            return self._operator.call("publish", payload)
        except LinkDownError:
            return None
