"""RGL .bsdf: BRDFs of EPFL's database in the adaptive parameterization of Dupuy and Jakob 2018.

    f(ωi, ωo) cos θo = V(u) D(u_m) / (4 σ(u_i)),   u = R(u_m; ωi)

u_m = (√(2 θm / π), (φm + π) / 2π) is the half vector, in isotropic files with its azimuth relative to that of ωi; u_i
likewise. D and σ are the facets' distribution and projected area. R(·; ωi) maps the density of visible facets, `vndf`,
to a uniform one: its marginal in the second coordinate, then its conditional in the first. V holds spectra, or Rec. 709
in files named …_rgb. All arrays are bilinear. Files without the factor D / 4σ say so by `jacobian` 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.measured.measurement import Measurement, coverage_warnings, sample_on_grid
from relume.assets.measured.spectra import rec709_weights
from relume.assets.measured.tensor_file import read_tensors
from relume.core.errors import MaterialError

F64 = NDArray[np.float64]
Indices = NDArray[np.intp]

_MAX_AXIS = 1024
_MAX_VALUES = 1 << 24  # of one array in memory, as float64
_MAX_THETA = math.radians(88)  # the cosine that divides vanishes beyond
_NUM_AZIMUTHS = 12  # of the mean of anisotropic materials; a quarter turn away from symmetric ones
_AXES = {"theta_i": 1, "phi_i": 1, "ndf": 2, "sigma": 2, "vndf": 4, "jacobian": 1}


@dataclass(frozen=True)
class RglBrdf:
    """A BRDF by its arrays; leading axes are φi and θi, then come azimuth and elevation of `u_m` or `u`.

    Attributes:
        density, cumulative: `vndf` with a sum of 1, and its integral along the last axis.
        values: linear Rec. 709. has_jacobian: whether D / 4σ is a factor.
    """

    phi_i: Shaped[F64, " p"]
    theta_i: Shaped[F64, " t"]
    ndf: Shaped[F64, "a b"]
    sigma: Shaped[F64, "c d"]
    density: Shaped[F64, "p t h w"]
    cumulative: Shaped[F64, "p t h w"]
    values: Shaped[F64, "p t r r 3"]
    has_jacobian: bool

    @property
    def is_isotropic(self) -> bool:
        """True if the azimuth of ωi does not matter."""
        return len(self.phi_i) <= 2

    def evaluate(self, wi: Shaped[F64, "n 3"], wo: Shaped[F64, "n 3"]) -> Shaped[F64, "n 3"]:
        """Evaluate f, 1/sr, for unit directions above the horizon."""
        if not self.is_isotropic:
            wi, wo = self._to_measured_quadrant(wi, wo)
        half = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
        (theta_i, phi_i), (theta_m, phi_m) = _angles(wi), _angles(half)
        u_i = np.sqrt(theta_i * (2 / math.pi)), (phi_i + math.pi) / (2 * math.pi)
        relative = phi_m - phi_i if self.is_isotropic else phi_m
        u_m = np.sqrt(theta_m * (2 / math.pi)), ((relative + math.pi) / (2 * math.pi)) % 1.0
        value = self._interpolate(np.zeros_like(phi_i) if self.is_isotropic else phi_i, theta_i, *u_m)
        factor = 1 / wo[:, 2]
        if self.has_jacobian:
            factor = factor * _bilinear(self.ndf, *u_m) / (4 * np.maximum(_bilinear(self.sigma, *u_i), 1e-6))
        return np.asarray(value * factor[:, None])

    def _to_measured_quadrant(self, wi: F64, wo: F64) -> tuple[F64, F64]:
        """Mirror both directions into the azimuths that were measured: a half or a quarter, from −π."""
        parts = _num_parts(self.phi_i)
        if parts < 2:
            return wi, wo
        mirror_y = np.where(wi[:, 1] > 0, -1.0, 1.0)
        mirror_x = np.where(wi[:, 0] > 0, -1.0, 1.0) if parts == 4 else mirror_y
        mirror = np.stack([mirror_x, mirror_y, np.ones_like(mirror_y)], axis=-1)
        return wi * mirror, wo * mirror

    def _interpolate(self, phi_i: F64, theta_i: F64, x: F64, y: F64) -> Shaped[F64, "n 3"]:
        """V at R(x, y; ωi), all arrays linear in φi and θi."""
        slices = [
            ((p, t), weight_p * weight_t)
            for p, weight_p in _neighbors(self.phi_i, phi_i)
            for t, weight_t in _neighbors(self.theta_i, theta_i)
        ]
        x, y = self._warp(slices, x, y)
        (ix, fx), (iy, fy) = _cell(x, self.values.shape[3]), _cell(y, self.values.shape[2])
        total = np.zeros((len(x), 3))
        for (p, t), weight in slices:
            for row, weight_y in ((iy, 1 - fy), (iy + 1, fy)):
                total += (weight * weight_y * (1 - fx))[:, None] * self.values[p, t, row, ix]
                total += (weight * weight_y * fx)[:, None] * self.values[p, t, row, ix + 1]
        return total

    def _warp(self, slices: list[tuple[tuple[Indices, Indices], F64]], x: F64, y: F64) -> tuple[F64, F64]:
        """R: marginal distribution in y, conditional one in x, of the interpolated density."""
        height, width = self.density.shape[2:]
        (ix, fx), (iy, fy) = _cell(x, width), _cell(y, height)
        along, total, marginal = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
        row_sums = self.cumulative[..., -1]
        below = _trapezoids(row_sums)
        for (p, t), weight in slices:
            sums = [row_sums[p, t, iy + k] for k in (0, 1)]
            partial = []
            for k in (0, 1):
                left, right = self.density[p, t, iy + k, ix], self.density[p, t, iy + k, ix + 1]
                partial.append(self.cumulative[p, t, iy + k, ix] + fx * (left + 0.5 * fx * (right - left)))
            along += weight * ((1 - fy) * partial[0] + fy * partial[1])
            total += weight * ((1 - fy) * sums[0] + fy * sums[1])
            marginal += weight * (below[p, t, iy] + fy * (sums[0] + 0.5 * fy * (sums[1] - sums[0])))
        warped_x = np.divide(along, total, out=np.zeros_like(along), where=total > 0)
        return np.clip(warped_x, 0, 1), np.clip(marginal, 0, 1)


def read_rgl(path: Path, label: str) -> Measurement:
    """Read a file, as the mean of both orders of the directions, and of all azimuths of anisotropic materials.

    Raises:
        MaterialError: it is damaged, too large, or of another kind.
    """
    brdf = _read_brdf(path, label)
    turns = [0.0] if brdf.is_isotropic else [2 * math.pi * (k + 0.25) / _NUM_AZIMUTHS for k in range(_NUM_AZIMUTHS)]

    def evaluate(wi: F64, wo: F64, node_angles: F64) -> F64:
        total = np.zeros((len(wi), 3))
        for turn in turns:
            rotation = np.array([[math.cos(turn), math.sin(turn), 0], [-math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
            a, b = wi @ rotation, wo @ rotation
            total += brdf.evaluate(a, b) + brdf.evaluate(b, a)
        return total / (2 * len(turns))

    max_theta = min(float(brdf.theta_i[-1]), _MAX_THETA)
    planes, negative = sample_on_grid(evaluate, max_theta, label)
    warnings = coverage_warnings(max_theta, negative)
    if not brdf.is_isotropic:
        warnings = ("the material is anisotropic; its mean over all azimuths is used, which is isotropic", *warnings)
    return Measurement(planes, warnings)


def _read_brdf(path: Path, label: str) -> RglBrdf:
    tensors = read_tensors(path, label)
    if "M" in tensors:
        raise MaterialError(f"{label} is a polarized measurement; give the material's .bsdf")
    spectral = "spectra" in tensors
    axes = _AXES | ({"spectra": 5, "wavelengths": 1} if spectral else {"rgb": 5})
    for name, num_axes in axes.items():
        tensor = tensors.get(name)
        if tensor is None or tensor.ndim != num_axes or not 1 <= min(tensor.shape) <= max(tensor.shape) <= _MAX_AXIS:
            raise MaterialError(f"{label} has no array {name!r} of {num_axes} axes of 1 to {_MAX_AXIS}; give a .bsdf")
    phi_i, theta_i = (_floats(label, tensors[name], name) for name in ("phi_i", "theta_i"))
    leading = len(phi_i), len(theta_i)
    values = tensors["spectra" if spectral else "rgb"]
    num_channels = len(tensors["wavelengths"]) if spectral else 3
    if values.shape[:3] != (*leading, num_channels) or tensors["vndf"].shape[:2] != leading:
        raise MaterialError(f"{label} has arrays of different directions; download it again")
    if not all((np.diff(axis) > 0).all() for axis in (phi_i, theta_i)) or not 0 <= theta_i[0] <= theta_i[-1] < 1.6:
        raise MaterialError(f"{label} has angles that do not ascend within a quarter; download it again")
    if len(phi_i) > 2 and _num_parts(phi_i) not in (1, 2, 4):
        raise MaterialError(f"{label} has azimuths of neither a whole, a half nor a quarter turn; download it again")
    grids = {name: _floats(label, tensors[name], name) for name in ("ndf", "sigma", "vndf")}
    if any(min(grid.shape[-2:]) < 2 or grid.min() < 0 for grid in grids.values()) or min(values.shape[3:]) < 2:
        raise MaterialError(f"{label} has a density below zero or of one value; download it again")
    density, cumulative = _normalized(grids["vndf"])
    rgb = _to_rec709(label, tensors) if spectral else _floats(label, values, "rgb")
    has_jacobian = bool(np.asarray(tensors["jacobian"]).ravel()[0])
    channels_last = np.ascontiguousarray(np.moveaxis(rgb, 2, -1))
    return RglBrdf(phi_i, theta_i, grids["ndf"], grids["sigma"], density, cumulative, channels_last, has_jacobian)


def _num_parts(phi_i: F64) -> int:
    """Number of times that the measured azimuths fit into a turn: symmetric materials are measured in part of it."""
    return round(2 * math.pi / max(float(phi_i[-1] - phi_i[0]), 0.1))


def _to_rec709(label: str, tensors: dict[str, NDArray[np.generic]]) -> Shaped[F64, "p t 3 r r"]:
    """Convert spectra, one direction at a time, as there may be hundreds of megabytes."""
    wavelengths, spectra = _floats(label, tensors["wavelengths"], "wavelengths"), tensors["spectra"]
    if not (np.diff(wavelengths) > 0).all():
        raise MaterialError(f"{label} has wavelengths that do not ascend; download it again")
    shape = (*spectra.shape[:2], 3, *spectra.shape[3:])
    _check_size(label, math.prod(shape), "spectra")
    weights, rgb = rec709_weights(wavelengths), np.empty(shape)
    for index in np.ndindex(*spectra.shape[:2]):
        rgb[index] = np.einsum("wc,wyx->cyx", weights, _floats(label, spectra[index], "spectra"))
    return rgb


def _floats(label: str, tensor: NDArray[np.generic], name: str) -> F64:
    """Finite float64 values of an array in a file."""
    _check_size(label, tensor.size, name)
    values = np.array(tensor, np.float64)
    if not np.isfinite(values).all():
        raise MaterialError(f"{label} has non-finite values in {name!r}; download it again")
    return values


def _check_size(label: str, size: int, name: str) -> None:
    if size > _MAX_VALUES:
        raise MaterialError(f"{label} has {size:,} values in {name!r}, more than {_MAX_VALUES:,}; give its _rgb file")


def _normalized(vndf: Shaped[F64, "p t h w"]) -> tuple[F64, F64]:
    """Density per cell with a sum of 1 per direction, and its integral along the last axis."""
    rows = _trapezoids(vndf)
    total = _trapezoids(rows[..., -1])[..., -1]
    scale = np.divide(1.0, total, out=np.zeros_like(total), where=total > 0)[..., None, None]
    return vndf * scale, rows * scale


def _trapezoids(values: F64) -> F64:
    """Integral up to each node along the last axis, of linear values between nodes one apart."""
    steps = 0.5 * (values[..., 1:] + values[..., :-1])
    return np.concatenate([np.zeros_like(values[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)


def _angles(directions: Shaped[F64, "n 3"]) -> tuple[F64, F64]:
    x, y, z = directions.T
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def _neighbors(nodes: F64, at: F64) -> list[tuple[NDArray[np.intp], F64]]:
    """Nodes around positions with their weights; constant beyond the ends."""
    if len(nodes) == 1:
        return [(np.zeros(len(at), np.intp), np.ones(len(at)))]
    index = np.clip(np.searchsorted(nodes, at) - 1, 0, len(nodes) - 2)
    fraction = np.clip((at - nodes[index]) / (nodes[index + 1] - nodes[index]), 0, 1)
    return [(index, 1 - fraction), (index + 1, fraction)]


def _cell(position: F64, num: int) -> tuple[NDArray[np.intp], F64]:
    """Cell and place in it of positions in [0, 1]."""
    scaled = np.clip(position, 0, 1) * (num - 1)
    index = np.minimum(scaled.astype(np.intp), num - 2)
    return index, scaled - index


def _bilinear(grid: Shaped[F64, "h w"], x: F64, y: F64) -> F64:
    """Value of a grid at x along its last axis and y along its first, both in [0, 1]."""
    (ix, fx), (iy, fy) = _cell(x, grid.shape[1]), _cell(y, grid.shape[0])
    low = (1 - fx) * grid[iy, ix] + fx * grid[iy, ix + 1]
    high = (1 - fx) * grid[iy + 1, ix] + fx * grid[iy + 1, ix + 1]
    return np.asarray((1 - fy) * low + fy * high)
