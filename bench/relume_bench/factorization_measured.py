"""factorization.measured_terms: terms of measured BRDFs per (l*)², median.

Mahajan 2008, section 4 and Fig. 7, find 1/4. l* is the frequency content of a θh curve: the mean BRDF over θd, averaged
over RGB, whose zonal harmonics up to l* have 99 % of its energy. The curve keeps its last value up to 90° and is
mirrored there: a step would not be the material's, and gave diffuse ones l* of 40. Terms are counted by the SVD. Zenith
angles end at 80°, as the paper leaves out grazing ones, where data are incomplete. The materials are the non-parametric
factors of the MERL BRDFs (Bagher 2016), of the shared data:

    ρ = (ρ_d + ρ_s D(θh) F(θd) G(θi) G(θo) / (cos θi cos θo)) / π .

`half_angle_gaussians` are the same ratio of eq. 14. Materials whose l* exceeds what the SVD resolves are left out.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relume_bench.brdf_svd import (
    Angles,
    Brdf,
    count_terms,
    factorize,
    frequency_content,
    gauss_zenith,
    half_angle_gaussian,
    singular_values,
)
from relume_bench.figure import Figure, skipped
from relume_bench.scenes import shared_data

F64 = NDArray[np.float64]

_NAME = "factorization.measured_terms"
_LEAST_COSINE = float(np.cos(np.radians(80)))
_BINS = 90
_MAX_FREQUENCY = 30
_NUM_CURVE, _NUM_DEGREES = 256, 120
_SIGMAS = (0.15, 0.2, 0.3, 0.4)


def measure(tiny: bool) -> list[Figure]:
    """Compare terms with frequency contents of all materials."""
    folder = shared_data() / "materials" / "npf"
    if not (folder / "npf.bin").is_file():
        return skipped((_NAME,), "terms / l*²", "the tables of measured materials are not there: materials/npf")
    size = 16 if tiny else 80
    rows = [
        (name, frequency, count(brdf, size))
        for name, brdf in materials(folder)
        if (frequency := content(brdf)) <= _MAX_FREQUENCY
    ][: 3 if tiny else None]
    frequencies, terms = (np.array([row[k] for row in rows], np.float64) for k in (1, 2))
    gaussians = [(content(half_angle_gaussian(s)), count(half_angle_gaussian(s), size)) for s in _SIGMAS]
    ratios = terms / np.maximum(frequencies, 1) ** 2
    context = {
        "materials": len(rows),
        "quartiles": np.quantile(ratios, [0.25, 0.75]).tolist(),
        "half_angle_gaussians": [number / frequency**2 for frequency, number in gaussians],
        "sigmas": list(_SIGMAS),
        "terms": {name: [frequency, number] for name, frequency, number in rows},
        "to": "80°",
    }
    return [Figure(_NAME, float(np.median(ratios)), "terms / l*²", context)]


def materials(folder: Path) -> Iterator[tuple[str, Brdf]]:
    """Yield names and BRDFs, mean over RGB, of all tables."""
    names = json.loads((folder / "rows.json").read_text("utf-8"))
    tables = np.fromfile(folder / "npf.bin", "<f4").reshape(256, 512, 3)
    for name, table in zip(names, tables, strict=False):
        yield name, _brdf(table.astype(np.float64))


def _brdf(table: F64) -> Brdf:
    """Return the mean over RGB of one table. (512, 3)"""
    distribution, masking, fresnel = (table[first : first + _BINS] for first in (2, 92, 182))

    def evaluate(angles: Angles) -> F64:
        half, difference, incident, outgoing = (
            np.arccos(cosine) / (np.pi / 2)
            for cosine in (angles.half, angles.difference, angles.incident, angles.outgoing)
        )
        total: F64 = np.zeros(np.broadcast_shapes(half.shape, incident.shape, outgoing.shape))
        for c in range(3):
            specular = _at(distribution[:, c], np.sqrt(half)) * _at(fresnel[1:, c], difference, 1)
            specular = specular * _at(masking[1:, c], incident, 1) * _at(masking[1:, c], outgoing, 1)
            total += (table[0, c] + table[1, c] * specular / (angles.incident * angles.outgoing)) / np.pi
        return total / 3

    return evaluate


def _at(values: F64, fraction: F64, first: int = 0) -> F64:
    """Interpolate bins that begin at `first`. fraction: of the range of all bins"""
    return np.asarray(np.interp(np.asarray(fraction) * _BINS, np.arange(first, _BINS), values))


def content(brdf: Brdf) -> int:
    """Return l* of a BRDF's θh curve."""
    zenith = gauss_zenith(_NUM_CURVE)
    cos_half = zenith.cosine[:, None, None]
    cos_difference = np.cos(np.radians(np.arange(2.5, 60, 5)))[:, None]
    across = np.sqrt((1 - cos_half**2) * (1 - cos_difference**2)) * np.cos(np.pi * (np.arange(8) + 0.5) / 8)
    incident, outgoing = cos_half * cos_difference - across, cos_half * cos_difference + across
    is_inside = np.minimum(incident, outgoing) > _LEAST_COSINE
    clamped = np.maximum(incident, _LEAST_COSINE), np.maximum(outgoing, _LEAST_COSINE)
    half, difference = (np.broadcast_to(cosine, incident.shape) for cosine in (cos_half, cos_difference))
    values = np.where(is_inside, brdf(Angles(*clamped, half, half, difference)), 0)
    num = is_inside.sum(axis=(1, 2))
    known = num > 0
    curve = np.interp(zenith.cosine, zenith.cosine[known], values.sum(axis=(1, 2))[known] / num[known])
    polynomials = np.polynomial.legendre.legvander(zenith.cosine, _NUM_DEGREES - 1)
    coefficients = (zenith.weight * curve) @ polynomials
    coefficients[1::2] = 0  # mirrored at 90°
    return frequency_content(coefficients)


def count(brdf: Brdf, size: int) -> int:
    """Return the number of terms of a BRDF up to 80°."""
    return count_terms(singular_values(factorize(brdf, gauss_zenith(size, _LEAST_COSINE), size)))
