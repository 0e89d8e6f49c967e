"""Learned state of the first file format, whose parts state no form: what is certain to fit is brought to this one.

Columns that were kept by labels are certain: by name of vendor, place or kind of forecast. Rows that were numbered by
another part are not, since each part left out rows by itself. If the `Form` of a part changes, its conversion goes.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from deconflict.contention.ordinary import usual_durations
from deconflict.contention.queues import dwell_times
from deconflict.contention.robots import arrival_forecast, battery_use, overdue_times
from deconflict.engine.learned import map_drift
from deconflict.foresight.forecast_errors import arrival_errors, degradation
from deconflict.foresight.forecast_errors.error_ledger import COLUMNS
from deconflict.foresight.learned_estimates import ERRORS, FOLLOWING, MODELS, PROBABILITIES, STARTS
from deconflict.foresight.presence import removed_robots, silence_outcomes
from deconflict.foresight.probability.calibration import Calibration
from deconflict.foresight.probability.pair_table import slots_of
from deconflict.runtime.learned_state import DAMAGE, FORM, Form, Part

Parts = Mapping[str, Part]
NO_LABELS = "an older release wrote it, and its rows are numbered by a part that may have other rows"


class _DoesNotFitError(ValueError):
    """A part can't be used; the message says why."""


def upgraded(parts: Parts) -> dict[str, Part]:
    """The parts as this release writes them. Parts that state their form stay as they are."""
    if any(FORM in part or DAMAGE in part for part in parts.values()):
        return dict(parts)
    found: dict[str, Part] = {"starts": {DAMAGE: NO_LABELS}} if "starts" in parts else {}
    for name, convert in _CONVERSIONS.items():
        if name in parts:
            try:
                found[name] = convert(parts)
            except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
                reason = str(error) if isinstance(error, _DoesNotFitError) else f"{type(error).__name__}: {error}"
                found[name] = {DAMAGE: f"an older release wrote it, and it does not fit this one: {reason}"}
    return found


def _errors(parts: Parts) -> Part:
    """The kinds that both ledgers have."""
    if "following" not in parts:
        raise _DoesNotFitError("errors of robots on their way, with the same kinds of forecasts, are not in it")
    ledgers = parts["ledger"], parts["following"]
    row_of = [{tuple(kind): row for row, kind in enumerate(ledger["kinds"])} for ledger in ledgers]
    kinds = [kind for kind in row_of[0] if kind in row_of[1]]
    state: Part = {"kinds": [list(kind) for kind in kinds], "starts_as_of_s": None}
    for begin, ledger, rows in zip(("", FOLLOWING), ledgers, row_of, strict=True):
        if any(len(ledger[name]) != len(ledger["kinds"]) for name in COLUMNS):
            raise _DoesNotFitError("its columns are not of its kinds")
        state |= {begin + name: ledger[name][[rows[kind] for kind in kinds]] for name in COLUMNS}
    state[STARTS] = np.zeros((len(kinds), *ERRORS.columns[STARTS].axes[1:]))
    return ERRORS.part(state)


def _probabilities(parts: Parts) -> Part:
    """The weights, with their pairs of vendors by name."""
    if not {"calibration", "contact"} <= parts.keys() or "vendor_names" not in parts["calibration"]:
        raise _DoesNotFitError("the names of its vendors, or the weights for contact, are not in it")
    first = parts["calibration"]
    names = first["vendor_names"]
    part: Part = {name: first[name] for name in ("vendor_names", "clearance_m", "horizon_s")}
    for model, prior in MODELS.items():
        state = parts[model]
        if not np.array_equal(state["prior"], prior.mean):
            raise _DoesNotFitError(f"the weights for {model} were learned from another prior")
        pairs = zip(*(column.tolist() for column in slots_of(state["vendors"].astype(np.int64))), strict=True)
        part[f"{model}_pairs"] = [[names[a], names[b]] for a, b in pairs]
        part |= {f"{model}_{name}": state[name] for name in ("as_of_s", *Calibration(prior).columns(""))}
    return PROBABILITIES.part(part)


def _arrival_errors(parts: Parts) -> Part:
    part = parts["lateness"]
    as_of_s = np.array([at_s for _, at_s in part["vendors"]], np.float64)
    counts = part["counts"].reshape(-1, *arrival_errors.FORM.columns["counts"].axes[1:])
    vendors = [vendor for vendor, _ in part["vendors"]]
    return arrival_errors.FORM.part({"vendors": vendors, "as_of_s": as_of_s, "counts": counts})


def _batteries(parts: Parts) -> Part:
    part = parts["batteries"]
    columns = ("levels_pct", "drains", "used")
    return battery_use.FORM.part({name: dict(zip(part["vendors"], part[name], strict=True)) for name in columns})


def _same(name: str, form: Form) -> Callable[[Parts], Part]:
    """A part that has the same names."""
    return lambda parts: form.part(parts[name])


def _named(name: str, form: Form, key: str) -> Callable[[Parts], Part]:
    """A part whose values by vendor or place have a name now."""
    return lambda parts: form.part({key: parts[name]})


_CONVERSIONS: dict[str, Callable[[Parts], Any]] = {
    "ledger": _errors,
    "calibration": _probabilities,
    "changes": _named("changes", degradation.FORM, "levels"),
    "arrivals": _named("arrivals", arrival_forecast.FORM, "ratios"),
    "overdue": _named("overdue", overdue_times.FORM, "late"),
    "stays": _named("stays", dwell_times.FORM, "dwells_s"),
    "lateness": _arrival_errors,
    "batteries": _batteries,
    "silences": _same("silences", silence_outcomes.FORM),
    "taken_off": _same("taken_off", removed_robots.FORM),
    "rests": _same("rests", map_drift.FORM),
    **{
        name: _same(name, usual_durations.FORM)
        for name in ("blockages_of_fleet", "blockages_of_vendors", "queues_of_fleet")
    },
}
