"""Errors of forecasts, made for tests."""

import numpy as np

from deconflict.foresight.forecast_errors.track_kernels import ERROR, Errors
from deconflict.foresight.forecast_errors.upper_quantiles import bins
from ingest.batch import Floats


def off(kind: int, horizon_s: int, along_m: Floats, across_m: Floats, bands_m: Floats) -> Errors:
    """Errors (n,) of n robots at one horizon; `bands_m` are (3,) or (n, 3)."""
    errors = np.zeros(len(along_m), ERROR)
    errors["kind"], errors["robot"], errors["horizon_s"] = kind, np.arange(len(along_m)), horizon_s
    errors["bands_m"] = bands_m
    for name, size_m in (("radial", np.hypot(along_m, across_m)), ("along", along_m), ("across", across_m)):
        errors[f"{name}_m"], errors[f"{name}_bin"] = size_m, bins(np.abs(size_m))
    return errors
