"""Scattered measurements of Cornell's Program of Computer Graphics: isotropic BRDF spectra, as text.

Lines that begin with # are comments. Then numbers: how many wavelengths; the wavelengths in nanometers; and rows of θi,
φi, θs, φs in radians and one BRDF value in 1/sr a wavelength.

Values between are interpolated in the logarithm by biharmonic splines, s(x) = Σ_k w_k |x − x_k| + w_0, over

    x = (4 r, r/2 · sin θd (cos 2φd, |sin 2φd|), θd),   r = √(θh / 90°)

which resolve highlights, have no seam at θh = 0, and are equal for reciprocal and mirrored pairs of directions.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator, RegularGridInterpolator

from relume.assets.measured.measurement import Measurement, coverage_warnings, sample_on_grid
from relume.assets.measured.merl import MAX_VALUE, grid_angles
from relume.assets.measured.spectra import rec709_weights
from relume.core.errors import MaterialError
from relume.math.polar import polar

F64 = NDArray[np.float64]

MAX_BYTES = 4 << 20
MAX_ROWS = 4000  # the splines' matrix has their square
MIN_ROWS = 20
MAX_WAVELENGTHS = 500
_FLOOR = 1e-3  # of a channel's mean, added before the logarithm: dark values are noise
_DUPLICATE_DECIMALS = 6


def looks_like_cornell(start: bytes) -> bool:
    """True if a file may be of this layout, by its first bytes: text that begins with a comment or a digit."""
    return start[:1] == b"#" or start.lstrip()[:1].isdigit()


def read_cornell(path: Path, label: str) -> Measurement:
    """Read a file. Raises MaterialError if it is damaged or too large."""
    angles, rgb = _read_rows(path, label)
    coordinates, values = _without_duplicates(_coordinates_of_rows(angles), rgb)
    floor = _FLOOR * np.maximum(values.mean(axis=0), 0.0) + 1e-12
    positive = np.maximum(values, 0.0)
    try:
        spline = RBFInterpolator(coordinates, np.log(positive + floor), kernel="linear", degree=0)
    except np.linalg.LinAlgError as error:
        raise MaterialError(f"{label} has too few different directions; give another file") from error

    # the spline has a term per row: few nodes of it, as the measurement is coarse in θd and φd, and linear between
    nodes = (grid_angles()[0].ravel(), np.radians(np.arange(0, 91, 2)), np.radians(np.arange(0, 91, 6)))
    theta_h, theta_d, phi_d = (axis.ravel() for axis in np.meshgrid(*nodes, indexing="ij"))
    logarithm = spline(_coordinates(theta_h, theta_d, phi_d)).reshape(*map(len, nodes), 3)
    on_nodes = np.clip(np.exp(logarithm) - floor, positive.min(axis=0), positive.max(axis=0))
    between_nodes = RegularGridInterpolator(nodes, on_nodes)

    def evaluate(wi: F64, wo: F64, node_angles: F64) -> F64:
        folded = np.minimum(node_angles[:, 2], math.pi - node_angles[:, 2])
        return np.asarray(between_nodes(np.column_stack([node_angles[:, :2], folded])))

    max_theta = float(angles[:, [0, 2]].max())
    planes, _ = sample_on_grid(evaluate, max_theta, label)
    negative = float((values < 0).any(axis=-1).mean())
    scattered = f"interpolated between {len(values):,} pairs of directions; highlights narrower than these are lost"
    return Measurement(planes, (scattered, *coverage_warnings(max_theta, negative)))


def _read_rows(path: Path, label: str) -> tuple[Shaped[F64, "n 4"], Shaped[F64, "n 3"]]:
    """Angles and linear Rec. 709 of all rows."""
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise MaterialError(f"{label} has {size:,} bytes, more than {MAX_BYTES:,} of a table of scattered values")
    lines = path.read_text(encoding="latin-1").splitlines()
    try:
        numbers = np.array(" ".join(line for line in lines if not line.lstrip().startswith("#")).split(), np.float64)
    except ValueError as error:
        raise MaterialError(f"{label} has words between its numbers ({str(error)[:60]}); download it again") from error
    count = float(numbers[0]) if len(numbers) else 0.0
    if not (count.is_integer() and 1 <= count <= MAX_WAVELENGTHS):
        raise MaterialError(f"{label} does not start with 1 to {MAX_WAVELENGTHS} wavelengths; give a Cornell .brdf")
    num = int(count)
    num_rows, rest = divmod(len(numbers) - 1 - num, 4 + num)
    if rest or not MIN_ROWS <= num_rows <= MAX_ROWS:
        allowed = f"{MIN_ROWS} to {MAX_ROWS:,} whole rows of {4 + num} numbers"
        raise MaterialError(f"{label} has {num_rows:,} rows and {rest} numbers more; give {allowed}")
    wavelengths, rows = numbers[1 : 1 + num], numbers[1 + num :].reshape(num_rows, 4 + num)
    _check(label, wavelengths, rows)
    return rows[:, :4], rows[:, 4:] @ rec709_weights(wavelengths)


def _check(label: str, wavelengths: F64, rows: F64) -> None:
    if not (np.isfinite(wavelengths).all() and np.isfinite(rows).all()):
        raise MaterialError(f"{label} has non-finite values; download it again")
    if not (np.diff(wavelengths) > 0).all() or wavelengths[0] <= 0:
        raise MaterialError(f"{label} has wavelengths that do not ascend; download it again")
    theta = rows[:, [0, 2]]
    if theta.min() < 0 or theta.max() >= math.pi / 2 or np.abs(rows[:, [1, 3]]).max() > 4 * math.pi:
        raise MaterialError(f"{label} has directions below the horizon; its angles must be radians, θ below π/2")
    if np.abs(rows[:, 4:]).max() > MAX_VALUE:
        raise MaterialError(f"{label} has values above {MAX_VALUE:g} per steradian; no material reflects that much")


def _coordinates_of_rows(angles: Shaped[F64, "n 4"]) -> Shaped[F64, "n 4"]:
    """Coordinates of pairs of directions, given by θi, φi, θs, φs."""
    wi, wo = (polar(theta, phi).T for theta, phi in ((angles[:, 0], angles[:, 1]), (angles[:, 2], angles[:, 3])))
    half = wi + wo
    length, across = np.linalg.norm(half, axis=0), np.hypot(half[0], half[1])
    # as in `relume.assets.measured.interpolate`: sin θh sin θd times cosine and sine of φd, up to a factor
    phi_d = np.arctan2(wi[1] * wo[0] - wi[0] * wo[1], 0.5 * (wo[2] - wi[2]) * length)
    theta_d = np.arctan2(np.linalg.norm(wi - wo, axis=0), length)
    return _coordinates(np.arctan2(across, half[2]), theta_d, phi_d)


def _coordinates(theta_h: F64, theta_d: F64, phi_d: F64) -> Shaped[F64, "n 4"]:
    root = np.sqrt(theta_h / (math.pi / 2))
    aside = 0.5 * root * np.sin(theta_d)
    return np.stack([4 * root, aside * np.cos(2 * phi_d), aside * np.abs(np.sin(2 * phi_d)), theta_d], axis=-1)


def _without_duplicates(coordinates: Shaped[F64, "n 4"], values: F64) -> tuple[F64, F64]:
    """Replace rows at equal coordinates, such as mirrored pairs, by their mean."""
    _, first, inverse = np.unique(
        coordinates.round(_DUPLICATE_DECIMALS), axis=0, return_index=True, return_inverse=True
    )
    inverse = inverse.ravel()
    counts = np.bincount(inverse)
    means = np.stack([np.bincount(inverse, channel) / counts for channel in values.T], axis=-1)
    return coordinates[first], means
