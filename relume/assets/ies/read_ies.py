"""Import of IES files, LM-63-1986 to 2019, from untrusted sources: photometric webs of type C.

    I(θ, C) = candela · multiplier · ballast factor [· photometric factor, until 1995]

θ is measured from the nadir, C about it. The web is interpolated bilinearly between the angles of the file, and zero
outside them.
"""

from __future__ import annotations

import codecs
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, quote

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_FILE_BYTES = 2_000_000
MAX_ANGLES = 2_000  # of each kind
POLAR_ANGLES, AZIMUTHS = 721, 361  # of the stored web: steps of 0.25° and 1°, which files hardly exceed
_MAX_CANDELA = 1e12
_TILT = re.compile(r"^\s*TILT\s*=[ \t]*(\S*)", re.MULTILINE | re.IGNORECASE)
_FUTURE_USE = re.compile(r"LM-63-(200\d|201\d|202\d)")  # in these, the photometric factor has no meaning
_NUM_FIELDS = 13
_ANGLE_KINDS = ("vertical", "horizontal")
_PHOTOMETRY = {1: "C", 2: "B", 3: "A"}


class PhotometricWeb(NamedTuple):
    """Intensity over directions.

    Attributes:
        relative_intensity: over the maximum, at equidistant θ in [0°, 180°] and C in [0°, 360°]; one column if it is
            symmetric about the axis.
        candela: maximum intensity.
    """

    relative_intensity: Shaped[F32, "polar azimuth"]
    candela: float


def mean_intensity(relative_intensity: Shaped[F32, "polar azimuth"]) -> float:
    """Return the mean of a web over all directions, as in `PhotometricWeb.relative_intensity`."""
    circle = relative_intensity[:, : max(relative_intensity.shape[1] - 1, 1)]  # 0° is 360°
    solid_angle = np.sin(np.linspace(0, np.pi, len(circle)))
    return float(circle.mean(axis=1) @ solid_angle / solid_angle.sum())


def read_ies(path: Path, name: str) -> tuple[PhotometricWeb, tuple[ImporterWarning, ...]]:
    """Read an IES file; also return warnings about simplifications.

    Args:
        path: the file. name: shown to users.
    Raises:
        SceneError: unsupported, damaged, or too large.
    """
    with path.open("rb") as file:
        return parse_ies(file.read(MAX_FILE_BYTES + 1), name)


def parse_ies(data: bytes, name: str) -> tuple[PhotometricWeb, tuple[ImporterWarning, ...]]:
    """Read the content of an IES file as `read_ies` does."""
    label = f"IES file {name!r}"
    if len(data) > MAX_FILE_BYTES:
        raise SceneError(f"{label} is larger than {MAX_FILE_BYTES / 1e6:g} MB; choose a file of one luminaire")
    text = _decode(data)
    tilt = _TILT.search(text)
    if tilt is None:
        raise SceneError(f"{label} has no line TILT=; choose a file in the format LM-63")
    numbers, warnings = text[tilt.end() :], tuple[ImporterWarning, ...]()
    if tilt[1].upper() != "NONE":
        warnings = (approximated(f"The tilt of IES file {quote(name)} was ignored: it emits as it was measured."),)
    values = _skip_tilt(_numbers(numbers), label) if tilt[1].upper() == "INCLUDE" else _numbers(numbers)
    has_photometric_factor = _FUTURE_USE.search(text[: tilt.start()]) is None
    return _web(values, label, has_photometric_factor=has_photometric_factor), warnings


def _decode(data: bytes) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    if data[1:2] == b"\0" or data[:1] == b"\0":  # UTF-16 without a mark
        return data.decode("utf-16-le" if data[1:2] == b"\0" else "utf-16-be", errors="replace")
    return data.decode("utf-8-sig", errors="replace")


def _numbers(text: str) -> F64:
    """Parse numbers until the first word that is none. Commas separate numbers, or are decimal marks."""
    if "." not in text:
        decimal = _leading_numbers(text.replace(",", ".").split())
        if len(decimal) == len(text.split()):
            return decimal
    return _leading_numbers(text.replace(",", " ").split())


def _leading_numbers(words: list[str]) -> F64:
    numbers = []
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError:
            break
    return np.array(numbers, np.float64)


def _skip_tilt(values: F64, label: str) -> F64:
    """Skip the position, the number of angles, the angles, and their factors."""
    num_angles = _count(values, 1, label, "tilt angles")
    return values[2 + 2 * num_angles :]


def _count(values: F64, index: int, label: str, quantity: str) -> int:
    """Return a number of angles. Raises SceneError if it is none."""
    value = values[index] if index < len(values) else float("nan")
    if not (1 <= value <= MAX_ANGLES and value == int(value)):
        raise SceneError(f"{label} has {value:.7g} {quantity}, it must be 1 to {MAX_ANGLES}; export the file again")
    return int(value)


def _web(values: F64, label: str, *, has_photometric_factor: bool) -> PhotometricWeb:
    num_polar, num_azimuths = (_count(values, 3 + k, label, f"{kind} angles") for k, kind in enumerate(_ANGLE_KINDS))
    num_values = _NUM_FIELDS + num_polar + num_azimuths + num_polar * num_azimuths
    if len(values) < num_values:
        raise SceneError(
            f"{label} ends after {len(values):,} of {num_values:,} numbers, or has a word among them; "
            "export the file again"
        )
    values = values[:num_values]
    if not np.isfinite(values).all():
        raise SceneError(f"{label} has numbers that are infinite or NaN; export the file again")
    photometry = _PHOTOMETRY.get(int(values[5]), f"{values[5]:g}")
    if photometry != "C":
        raise SceneError(f"{label} has photometry of type {photometry}; export it as type C")
    polar, azimuth, candela = np.split(values[_NUM_FIELDS:], [num_polar, num_polar + num_azimuths])
    _check_angles(polar, azimuth, label)
    factor = values[2] * values[10] * (values[11] if has_photometric_factor else 1)
    intensity = factor * candela.reshape(num_azimuths, num_polar)
    maximum = float(intensity.max())
    if intensity.min() < 0 or not 0 < maximum <= _MAX_CANDELA:
        raise SceneError(f"{label} has intensities from {intensity.min():g} to {maximum:g} cd; they must be positive")
    relative_intensity = _resample(polar, azimuth, intensity / maximum)
    return PhotometricWeb(relative_intensity, maximum)


def _check_angles(polar: F64, azimuth: F64, label: str) -> None:
    for angles, quantity, limit in zip((polar, azimuth), _ANGLE_KINDS, (180, 360), strict=True):
        if (np.diff(angles) <= 0).any() or angles[0] < 0 or angles[-1] > limit:
            raise SceneError(f"{label}: its {quantity} angles must increase from 0° to {limit}°; export the file again")
    if len(polar) < 2:
        raise SceneError(f"{label} has one vertical angle, it needs at least 2; export the file again")
    is_whole = azimuth[0] == 0 and (len(azimuth) == 1 or azimuth[-1] > 180)
    if not is_whole and (azimuth[0], azimuth[-1]) not in {(0, 90), (0, 180), (90, 270)}:
        raise SceneError(
            f"{label}: its horizontal angles are {azimuth[0]:g}° to {azimuth[-1]:g}°, they must be 0° to 90°, 180° or "
            "360°, or 90° to 270°; export the file again"
        )


def _resample(polar: F64, azimuth: F64, intensity: Shaped[F64, "azimuth polar"]) -> Shaped[F32, "rows columns"]:
    """Interpolate a web at the stored angles, with its symmetries."""
    stored_polar = np.linspace(0, 180, POLAR_ANGLES)
    if len(azimuth) == 1:
        symmetric = np.interp(stored_polar, polar, intensity[0], left=0, right=0)
        return np.asarray(symmetric[:, None], np.float32)
    if 180 < azimuth[-1] < 360 and azimuth[0] == 0:  # the first plane is the last as well
        azimuth, intensity = np.append(azimuth, 360), np.concatenate([intensity, intensity[:1]])
    interpolate = RegularGridInterpolator((azimuth, polar), intensity, bounds_error=False, fill_value=0)
    folded = _fold(np.linspace(0, 360, AZIMUTHS), azimuth[0], azimuth[-1])
    angles = np.meshgrid(folded, stored_polar)
    return np.asarray(interpolate(np.stack(angles, axis=-1)), np.float32)


def _fold(azimuth: F64, first: float, last: float) -> F64:
    """Mirror azimuths into the range of a file: a quadrant, the half about C0 or about C180, or all."""
    if first == 90:
        return np.where((azimuth < 90) | (azimuth > 270), (180 - azimuth) % 360, azimuth)
    if last == 90:
        return np.asarray(90 - np.abs(90 - azimuth % 180))
    return np.asarray(180 - np.abs(180 - azimuth)) if last == 180 else azimuth
