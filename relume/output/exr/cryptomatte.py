"""Cryptomatte, version 1.2 (Psyop): for each pixel the ids of the objects in it, and how much of it each one covers.

An id is the MurmurHash3 of a name, as the bits of a float that is neither infinite, NaN nor denormal. Two ids and their
coverage fill one layer of four channels; the first has the two that cover most. The background has no id.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]

RANKS = 6  # ids of a pixel; those that cover less are left out
BACKGROUND = np.uint32(0)
_MASK = 0xFFFFFFFF


def murmur3_32(data: bytes) -> int:
    """MurmurHash3_x86_32 with seed 0 (A. Appleby, public domain)."""
    value, tail = 0, len(data) & ~3
    for start in range(0, tail, 4):
        value ^= _mixed(int.from_bytes(data[start : start + 4], "little"))
        value = (_rotated(value, 13) * 5 + 0xE6546B64) & _MASK
    value ^= _mixed(int.from_bytes(data[tail:], "little"))
    value ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        value = ((value ^ (value >> shift)) * factor) & _MASK
    return value


def _mixed(block: int) -> int:
    return (_rotated((block * 0xCC9E2D51) & _MASK, 15) * 0x1B873593) & _MASK


def _rotated(value: int, count: int) -> int:
    return ((value << count) | (value >> (32 - count))) & _MASK


def id_of(name: str) -> np.uint32:
    """Id of a name; its bits are those of a normal float."""
    value = murmur3_32(name.encode("utf-8", "surrogatepass"))
    return np.uint32(value ^ (1 << 23) if (value >> 23) & 255 in (0, 255) else value)


def ranked_coverage(ids: Shaped[U32, "n samples"]) -> tuple[Shaped[U32, "n ranks"], Shaped[F32, "n ranks"]]:
    """Rank the ids of pixels by coverage, then by id.

    Args:
        ids: of each sample of n pixels; `BACKGROUND` for none.
    Returns:
        Ids and the fractions of the samples that have them; `BACKGROUND` and 0 where a pixel has fewer.
    """
    n, samples = ids.shape
    by_id = np.sort(ids, axis=1)
    is_first = np.concatenate([np.ones((n, 1), np.bool_), by_id[:, 1:] != by_id[:, :-1]], axis=1)
    run = np.cumsum(is_first, axis=1) - 1 + samples * np.arange(n)[:, None]
    count = np.bincount(run.ravel(), minlength=n * samples).reshape(n, samples)
    run_ids = np.zeros(n * samples, np.uint32)
    run_ids[run[is_first]] = by_id[is_first]
    run_ids = run_ids.reshape(n, samples)
    count[run_ids == BACKGROUND] = 0
    order = np.argsort(-count, axis=1, kind="stable")[:, :RANKS]
    ranked, coverage = np.take_along_axis(run_ids, order, axis=1), np.take_along_axis(count, order, axis=1)
    missing = ((0, 0), (0, RANKS - order.shape[1]))
    return np.pad(ranked, missing), np.pad((coverage / samples).astype(np.float32), missing)


def cryptomatte_channels(
    layer: str, ids: Shaped[U32, "n ranks"], coverage: Shaped[F32, "n ranks"]
) -> dict[str, Shaped[F32, " n"]]:
    """Channels of a Cryptomatte by name, all of 32-bit floats.

    Args:
        layer: its name, such as "CryptoObject". ids, coverage: from `ranked_coverage`.
    """
    values = np.stack([ids.view(np.float32), coverage], axis=-1).reshape(-1, 2 * RANKS)
    return {f"{layer}{k // 4:02d}.{'RGBA'[k % 4]}": values[:, k] for k in range(2 * RANKS)}


def cryptomatte_attributes(layer: str, names: Sequence[str]) -> dict[str, str]:
    """Attributes of a file with a Cryptomatte.

    Args:
        layer: its name. names: everything that may have an id.
    """
    manifest = {name: f"{int(id_of(name)):08x}" for name in names}
    prefix = f"cryptomatte/{murmur3_32(layer.encode()):08x}"[: len("cryptomatte/") + 7]
    return {
        f"{prefix}/name": layer,
        f"{prefix}/hash": "MurmurHash3_32",
        f"{prefix}/conversion": "uint32_to_float32",
        f"{prefix}/manifest": json.dumps(manifest, separators=(",", ":")),
    }
