"""Reader of .cube files, of Iridas/Adobe and of DaVinci Resolve: 1D and 3D LUTs of display values.

OpenColorIO reads them, too, but takes "nan" for 0, rejects byte order marks and comments behind a size, and caches each
file for the life of the process.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported
from relume.image_io.ocio.lut import SIZE
from relume.image_io.ocio.sampling import apply_display_lut

F64 = NDArray[np.float64]
U16 = NDArray[np.uint16]

MAX_BYTES = 32 << 20
MAX_3D_SIZE, MAX_1D_SIZE = 65, 65_536
_SIZES = {"LUT_1D_SIZE": MAX_1D_SIZE, "LUT_3D_SIZE": MAX_3D_SIZE}
_RANGES = ("LUT_1D_INPUT_RANGE", "LUT_3D_INPUT_RANGE")  # Resolve's; two numbers for all channels
_DOMAINS = ("DOMAIN_MIN", "DOMAIN_MAX")
_KEYWORD = re.compile(r"[A-Z][A-Z0-9_]*")
_BYTE_ORDER_MARK = "\ufeff".encode()
_MAX_DOMAIN = 1e6
_HALF_STEP = 0.5 / 255  # of a display of 8 bits


@dataclass
class _Parsed:
    sizes: dict[str, int] = field(default_factory=dict)
    minimum: F64 = field(default_factory=lambda: np.zeros(3))
    maximum: F64 = field(default_factory=lambda: np.ones(3))
    rows: list[tuple[float, ...]] = field(default_factory=list)
    unknown: dict[str, None] = field(default_factory=dict)


def read_cube(path: Path, name: str) -> tuple[Shaped[U16, "N N N 3"], tuple[ImporterWarning, ...]]:
    """Read a .cube file as a table of display values with nodes at equal distances over [0, 1].

    Args:
        path: the file. name: its name in messages.
    Returns:
        Display values, 65535 for 1, red slowest. N is the file's own size for a 3D LUT over [0, 1]; 1D LUTs and other
        domains have 65 nodes. And warnings.
    Raises:
        SceneError: the file is unusable; the message says why.
    """
    label = quote(name)
    if path.stat().st_size > MAX_BYTES:
        raise SceneError(f"{label} is larger than {MAX_BYTES >> 20} MB; export it with at most {MAX_3D_SIZE} nodes")
    parsed = _parse(path.read_bytes().removeprefix(_BYTE_ORDER_MARK), label)
    values = _check_values(parsed, label)
    warnings = [ignored(f"{label} has {keyword}, which was not used.") for keyword in parsed.unknown]
    if values.min() < 0 or values.max() > 1:
        warnings.append(unsupported(f"{label} has values outside 0 to 1, which were clipped."))
    table, error = _make_table(parsed, np.clip(values, 0, 1))
    if error > _HALF_STEP:
        text = f"{label} was resampled to {SIZE} nodes, which changes display values by up to {255 * error:.1f} of 255."
        warnings.append(approximated(text))
    return table, tuple(warnings)


def _parse(content: bytes, label: str) -> _Parsed:
    parsed = _Parsed()
    for number, line in enumerate(content.splitlines(), start=1):
        words = line.split(b"#", 1)[0].decode("latin-1").split()
        if not words:
            continue
        numbers = _numbers(words)
        if numbers is not None and len(numbers) == 3:
            parsed.rows.append(numbers)
        elif _KEYWORD.fullmatch(words[0]) and numbers is None:
            _read_keyword(parsed, words, label)
        else:
            raise SceneError(f"line {number} of {label} is neither a keyword nor three numbers; export the LUT again")
    return parsed


def _numbers(words: list[str]) -> tuple[float, ...] | None:
    try:
        return tuple(map(float, words))
    except ValueError:
        return None


def _read_keyword(parsed: _Parsed, words: list[str], label: str) -> None:
    keyword, numbers = words[0], _numbers(words[1:])
    if keyword in _SIZES:
        maximum = _SIZES[keyword]
        if numbers is None or len(numbers) != 1 or numbers[0] not in range(2, maximum + 1):
            given = " ".join(words[1:])[:40]
            raise SceneError(f"{label} has {keyword} {given}; export it with a size from 2 to {maximum}")
        parsed.sizes[keyword] = int(numbers[0])
    elif keyword in (*_DOMAINS, *_RANGES):
        count = 2 if keyword in _RANGES else 3
        if numbers is None or len(numbers) != count or not np.abs(numbers).max() <= _MAX_DOMAIN:
            raise SceneError(f"{keyword} of {label} is not {count} numbers; export the LUT again")
        if keyword in _RANGES:
            parsed.minimum, parsed.maximum = np.full(3, numbers[0]), np.full(3, numbers[1])
        elif keyword == "DOMAIN_MIN":
            parsed.minimum = np.array(numbers)
        else:
            parsed.maximum = np.array(numbers)
    elif keyword != "TITLE" and len(parsed.unknown) < 8:
        parsed.unknown[keyword[:40]] = None


def _check_values(parsed: _Parsed, label: str) -> F64:
    """The rows of the file. (n, 3) Raises SceneError."""
    if len(parsed.sizes) != 1:
        found = "no LUT_3D_SIZE or LUT_1D_SIZE" if not parsed.sizes else "a 1D and a 3D LUT"
        raise SceneError(f"{label} has {found}; export one LUT as .cube")
    ((keyword, size),) = parsed.sizes.items()
    expected = size if keyword == "LUT_1D_SIZE" else size**3
    if len(parsed.rows) != expected:
        raise SceneError(
            f"{label} has {len(parsed.rows)} rows, but {keyword} {size} needs {expected}; export the LUT again"
        )
    values = np.array(parsed.rows)
    if not np.isfinite(values).all():
        raise SceneError(f"{label} has values that are no numbers; export the LUT again")
    if not (parsed.minimum < parsed.maximum).all():
        raise SceneError(f"the domain of {label} is empty; DOMAIN_MIN must be below DOMAIN_MAX")
    return values


def _make_table(parsed: _Parsed, values: F64) -> tuple[U16, float]:
    """The table, and the largest error of resampling at the file's nodes in [0, 1]. (N, N, N, 3)"""
    is_3d = "LUT_3D_SIZE" in parsed.sizes
    size = next(iter(parsed.sizes.values()))
    table = _quantize(values.reshape(*[size] * (3 if is_3d else 1), 3))
    if is_3d:
        table = np.ascontiguousarray(table.transpose(2, 1, 0, 3))  # red varies fastest in files
        if (parsed.minimum == 0).all() and (parsed.maximum == 1).all():
            return table, 0.0
    extent = parsed.maximum - parsed.minimum
    positions = np.clip((np.linspace(0, 1, SIZE)[:, None] - parsed.minimum) / extent, 0, 1)
    resampled = _quantize(_sample(table, np.stack(np.meshgrid(*positions.T, indexing="ij"), axis=-1)))
    inputs = parsed.minimum + np.linspace(0, 1, size)[:, None] * extent
    inputs = np.stack(np.meshgrid(*inputs.T, indexing="ij"), axis=-1) if is_3d else inputs
    is_inside = ((inputs >= 0) & (inputs <= 1)).all(axis=-1)
    errors = np.abs(_sample(resampled, np.clip(inputs, 0, 1)) - table / 65535)
    return resampled, float(errors[is_inside].max(initial=0))


def _quantize(values: F64) -> U16:
    return np.asarray(values * 65535 + 0.5, np.uint16)


def _sample(table: U16, positions: F64) -> F64:
    """Values of a LUT, 3D or one curve per channel, at positions in [0, 1]. (…, 3)"""
    if table.ndim == 2:
        knots = np.linspace(0, 1, len(table))
        return np.stack([np.interp(positions[..., c], knots, table[:, c] / 65535) for c in range(3)], axis=-1)
    values = np.ascontiguousarray(positions.reshape(-1, 3), np.float32)
    apply_display_lut(table, values)
    return values.reshape(positions.shape).astype(np.float64)
