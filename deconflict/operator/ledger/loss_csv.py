"""Lost time as a table for spreadsheets."""

import csv
import io

from deconflict.operator.ledger.loss_questions import FIGURES, LossQuestion
from deconflict_client.answers.loss_models import LossList


def as_csv(question: LossQuestion, found: LossList) -> str:
    """The rows with a header. Texts that a spreadsheet would take for a formula begin with an apostrophe."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*question.keys, *FIGURES])
    for row in found.rows:
        values = row.model_dump()
        writer.writerow([_safe(values[key]) for key in (*question.keys, *FIGURES)])
    return text.getvalue()


def _safe(value: object) -> object:
    if isinstance(value, tuple):
        return " ".join(map(str, value))
    return f"'{value}" if isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r")) else value
