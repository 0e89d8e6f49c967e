"""`deconflict check`: what a person should see of a site file before robots rely on it."""

from math import degrees
from pathlib import Path
from typing import TextIO

import numpy as np

from deconflict.site import Site, SiteError, datum_of, load, problems
from ingest.fits import Fit, FitError
from ingest.frames import fit_map
from ingest.settings import Vendor, VendorMap


def check(path: Path, out: TextIO) -> int:
    """Print every vendor's fit and every problem; 0 where there is none, else 1."""
    try:
        site = load(path)
    except SiteError as error:
        out.write(f"{error}\n")
        return 1
    out.write(f"{site.name}: {len(site.datums)} datums, {len(site.vendors)} vendors\n")
    for vendor in site.vendors:
        out.writelines(f"{line}\n" for line in _vendor(site, vendor))
    wrong = problems(site)
    out.writelines(f"FAILS {one}\n" for one in wrong)
    out.write("every map fits\n" if not wrong else f"{len(wrong)} problems\n")
    return 1 if wrong else 0


def _vendor(site: Site, vendor: Vendor) -> list[str]:
    if not vendor.maps:
        return [f"\n{vendor.name}: sends in the datums' own coordinates"]
    lines = []
    for one in vendor.maps:
        datum = datum_of(site, one)
        lines.append(f"\n{vendor.name}: own map {one.datum} on {datum.name}")
        try:
            lines += _fit(fit_map(one, datum), one)
        except FitError as error:
            lines.append(f"  {error}")
    return lines


def _fit(found: Fit, one: VendorMap) -> list[str]:
    affine = found.affine
    large, small = affine.scales
    origin = found.transform(np.zeros((1, 2)))[0]
    lines = [
        f"  method {found.method}, {len(one.readings)} points, {'mirrored' if affine.mirrored else 'not mirrored'}",
        f"  rotation {degrees(affine.rotation_rad):.3f} deg, scale {large:.5f} / {small:.5f}",
        f"  the map's (0, 0) lies at ({origin[0]:.3f}, {origin[1]:.3f}) m on the floor",
        "  reference point                    map x      map y  ->  floor x    floor y  residual m  left out m",
    ]
    for row, (point, reading) in enumerate(one.readings.items()):
        placed = found.transform(np.array([reading]))[0]
        lines.append(
            f"  {point:33} {reading[0]:10.3f} {reading[1]:10.3f}  -> {placed[0]:9.3f}  {placed[1]:9.3f}"
            f"  {found.residuals_m[row]:10.4f}  {_metres(found.left_out_m[row])}"
        )
    return lines


def _metres(value: float) -> str:
    return "         -" if np.isnan(value) else f"{value:10.4f}"
