"""Losses of one day, as the ledger takes them."""

from deconflict.operator.ledger.loss_ledger import LedgerEntry
from deconflict.operator.ledger.loss_questions import DAY_S, HOUR_S, LossQuestion

START_S = 1_800_000_000 // HOUR_S * HOUR_S
QUEUED = LedgerEntry(
    START_S + 60.0, "Alder", "A100", "Corvid", "Basalt", "queue", "hall", "Aisle 3", 4.1, 7.9, 8.0, 6.0,
    is_sure=True, is_warned=True, is_advised=True,
)  # fmt: skip
CROSSED = QUEUED._replace(
    by_vendor="Basalt", kind="crossing", place="", lost_s=3.0, over_usual_s=2.5, is_sure=False, is_advised=False
)
REFUSED = QUEUED._replace(
    by_vendor="Basalt", kind="deadlock", lost_s=0.0, over_usual_s=0.0, losses=0, refusals=2, refused_s=70.0,
    unable=1, unable_s=12.0,
)  # fmt: skip
LATER = QUEUED._replace(from_s=START_S + HOUR_S + 1.0, vendor="Corvid", model="C20", lost_s=5.0, is_heeded=True)


def question(*keys: str, **fields: object) -> LossQuestion:
    return LossQuestion(**{"from_s": START_S, "until_s": START_S + DAY_S, "keys": keys} | fields)  # type: ignore[arg-type]
