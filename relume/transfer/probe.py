"""From a pixel to the curve behind it, and from a stretch of a curve to the pixels that it lights."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.daubechies import analysis, synthesis
from relume.color import luminance
from relume.errors import EditNotSupportedError, ParameterError
from relume.transfer.along import AlongCurve
from relume.transfer.pointer import CurvePointer, ParameterPointer
from relume.transfer.resolve import resolve
from relume.transfer.stream import columns_of, stream
from relume.transfer.term_image import TermImage
from relume.transfer.view_images import ViewImages

F32 = NDArray[np.float32]


def probe(
    images: ViewImages,
    radiance: F32,
    gain: NDArray[np.float64],
    touched: CurvePointer | ParameterPointer | None,
    x: int,
    y: int,
) -> dict[str, Any]:
    """A pixel's material, where its surface is, radiance, and what each band of its active curve gives to it.

    Args:
        radiance: of every view sample. (3, samples) float32. gain: multiplies each channel. (3,)
        touched: of the term to answer for, where it is the pixel's material's.
    Raises:
        ParameterError: the pixel lies outside the picture.
    """
    view = images.view
    if not (0 <= x < view.width and 0 <= y < view.height):
        raise ParameterError("pixel", [x, y], f"x below {view.width} and y below {view.height}")
    pixel = y * view.width + x
    entries = slice(int(view.first[pixel]), int(view.first[pixel + 1]))
    samples, weights = view.order[entries], view.weight[entries]
    seen = gain * (radiance[:, samples] * weights).sum(axis=1)
    heaviest = int(samples[np.argmax(weights)])
    index = int(np.searchsorted(view.bounds, heaviest, side="right")) - 1
    found = {"material": None, "position": None, "normal": None, "radiance": seen, "bands": None, "curve": None}
    if index >= len(images.by_name):
        return found
    name = images.transfer.material_names[index]
    position, normal = view.surface_at(heaviest)
    found |= {"material": name, "position": position, "normal": normal}
    for k, term in _touched_first(images, name, touched):
        bands = _contributions(images, name, term, samples, weights)
        if bands is not None and isinstance(term.active, AlongCurve):
            pointer = str(CurvePointer(name, k, term.active.name))
            return found | {"bands": gain[:, None] * bands, "curve": pointer}
    return found


def _touched_first(
    images: ViewImages, name: str, touched: CurvePointer | ParameterPointer | None
) -> list[tuple[int, TermImage]]:
    terms = list(enumerate(images.by_name[name].terms))
    if touched is not None and touched.material == name:
        terms.sort(key=lambda item: item[0] != touched.term)
    return terms


def _contributions(
    images: ViewImages, name: str, term: TermImage, samples: NDArray[np.int32], weights: F32
) -> NDArray[np.float64] | None:
    """T_j · c_j of the term's active curve, summed over a pixel's samples, (3, J); None where none is frozen."""
    material = images.by_name[name]
    frozen = images.operator(material, term)
    if frozen is None or not isinstance(term.active, AlongCurve):
        return None
    rows = images.view.rows(material.index)
    curve = synthesis(term.shown) if term.shown is not None else term.target[term.active.name]
    bands = np.zeros_like(curve)
    for sample, weight in zip(samples, weights, strict=True):
        if rows.start <= sample < rows.stop:
            row = int(sample) - rows.start
            tile, offset = divmod(row, frozen.transport.shape[3])
            columns = synthesis(frozen.transport[tile, :, :, offset].astype(np.float64))
            bands += weight * columns * material.factors_at(term, row)[:, None] * curve
    return bands


def brush(images: ViewImages, radiance: F32, pointer: CurvePointer, from_deg: float, to_deg: float) -> F32:
    """How much of each pixel comes from a stretch of a curve, 0 to 1. (height, width) float32

    Raises:
        EditNotSupportedError: the curve is not frozen yet; touch it and freeze first.
    """
    material, term = images.find(pointer)
    frozen = images.operator(material, term)
    if frozen is None or term.active != images.along(pointer) or term.shown is None:
        raise EditNotSupportedError(images.transfer.method, "a brush over a curve that is not open; open it first")
    bands = synthesis(term.shown)
    edges = np.linspace(0, 90, bands.shape[1] + 1)
    overlap = np.clip(np.minimum(edges[1:], to_deg) - np.maximum(edges[:-1], from_deg), 0, None) / np.diff(edges)
    part = np.zeros_like(term.image)
    stream(frozen.transport, columns_of(analysis(bands * overlap)), part)
    lit_radiance = np.zeros_like(radiance)
    material.term_radiance(term, part, lit_radiance)
    view = images.view
    whole = [(0, 0, view.width, view.height)]
    lit = luminance(np.maximum(resolve(view, lit_radiance, whole, 1.0), 0))
    total = luminance(resolve(view, radiance, whole, 1.0))
    share = np.divide(lit, total, out=np.zeros_like(lit), where=total > 1e-9)
    return np.clip(share, 0, 1).reshape(view.height, view.width).astype(np.float32)
