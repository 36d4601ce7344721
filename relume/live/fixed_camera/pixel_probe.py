"""Map a pixel to the curve that lights it, and a range of a curve to the pixels that it lights."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.core.errors import NotPrecomputedError, ParameterError
from relume.live.fixed_camera.edit_pointers import CurvePointer, ParameterPointer
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.view_images import ViewImages
from relume.math.daubechies import analysis, synthesis
from relume.operators.edit_basis import CurveBasis
from relume.views.resolve import resolve

F32 = NDArray[np.float32]


def probe(
    images: ViewImages,
    radiance: Shaped[F32, "3 samples"],
    gain: Shaped[NDArray[np.float64], " 3"],
    prepared_pointer: CurvePointer | ParameterPointer | None,
    x: int,
    y: int,
) -> dict[str, Any]:
    """Return a pixel's material, surface position, radiance, and the contribution of each band of its active curve.

    Args:
        images: images of the picture. x, y: the pixel.
        radiance: radiance of every view sample, float32. gain: multiplies each channel.
        prepared_pointer: the term to report, if it belongs to the pixel's material.
    Raises:
        ParameterError: the pixel lies outside the image.
    """
    view = images.view
    if not (0 <= x < view.width and 0 <= y < view.height):
        raise ParameterError("pixel", [x, y], f"x below {view.width} and y below {view.height}")
    pixel = y * view.width + x
    entries = slice(int(view.first[pixel]), int(view.first[pixel + 1]))
    samples, gains = view.order[entries], images.throughput[entries]
    pixel_radiance = gain * (radiance[:, samples] * gains.T).sum(axis=1)
    main_sample = int(samples[np.argmax(view.throughput[entries].max(axis=1))])
    index = int(np.searchsorted(view.bounds, main_sample, side="right")) - 1
    properties = {
        "material": None,
        "position": None,
        "normal": None,
        "radiance": pixel_radiance,
        "bands": None,
        "curve": None,
    }
    if index >= len(images.by_name):
        return properties
    name = images.transfer.material_names[index]
    position, normal = view.surface_at(main_sample)
    properties |= {"material": name, "position": position, "normal": normal}
    for k, term in _prepared_first(images, name, prepared_pointer):
        bands = _contributions(images, name, term, samples, gains)
        if bands is not None and isinstance(term.ready.basis, CurveBasis):
            pointer = str(CurvePointer(name, k, term.ready.basis.name))
            return properties | {"bands": gain[:, None] * bands, "curve": pointer}
    return properties


def _prepared_first(
    images: ViewImages, name: str, prepared_pointer: CurvePointer | ParameterPointer | None
) -> list[tuple[int, LiveTerm]]:
    terms = list(enumerate(images.by_name[name].terms))
    if prepared_pointer is not None and prepared_pointer.material == name:
        terms.sort(key=lambda item: item[0] != prepared_pointer.term)
    return terms


def _contributions(
    images: ViewImages, name: str, term: LiveTerm, samples: NDArray[np.int32], gains: F32
) -> NDArray[np.float64] | None:
    """T_j · c_j of the term's active curve, summed over a pixel's samples, (3, J); None if it has no operator."""
    material = images.by_name[name]
    operator = images.operator(material, term)
    ready = term.ready
    if operator is None or not isinstance(ready.basis, CurveBasis):
        return None
    rows = images.view.rows(material.index)
    curve = synthesis(ready.coefficients) if ready.coefficients is not None else term.target_bands[ready.basis.name]
    bands = np.zeros(curve.shape[-2:])
    for sample, sample_gain in zip(samples, gains, strict=True):
        if rows.start <= sample < rows.stop:
            row = int(sample) - rows.start
            columns = synthesis(operator.columns_at(row))
            sample_curve = curve if curve.ndim == 2 else curve[material.level_at(row)]
            bands += sample_gain[:, None] * columns * material.factors_at(term, row)[:, None] * sample_curve
    return bands


def highlight_pixels(
    images: ViewImages, radiance: Shaped[F32, "3 samples"], pointer: CurvePointer, from_deg: float, to_deg: float
) -> Shaped[F32, "height width"]:
    """Return the fraction of each pixel's luminance due to a range of a curve, 0 to 1, float32.

    Args:
        images, radiance: as in `probe`. pointer: to the curve. from_deg, to_deg: ends of the range, degrees.
    Raises:
        NotPrecomputedError: the curve has no operator yet; prepare it and run the job first.
    """
    material, term = images.material_term(pointer)
    operator = images.operator(material, term)
    if operator is None or term.ready.basis != images.basis(pointer) or term.ready.coefficients is None:
        raise NotPrecomputedError("this curve is not precomputed yet; select it and wait until it is ready")
    bands = synthesis(term.ready.coefficients)
    edges = np.linspace(0, 90, bands.shape[-1] + 1)
    overlap = np.clip(np.minimum(edges[1:], to_deg) - np.maximum(edges[:-1], from_deg), 0, None) / np.diff(edges)
    range_image = np.empty_like(term.ready.image)
    operator.write_image(analysis(bands * overlap), range_image)
    lit_radiance = np.zeros_like(radiance)
    material.term_radiance(term, range_image, lit_radiance)
    view = images.view
    whole = [(0, 0, view.width, view.height)]
    lit = luminance(np.maximum(resolve(view, lit_radiance, whole, 1.0, images.throughput), 0))
    total = luminance(resolve(view, radiance, whole, 1.0, images.throughput))
    fraction = np.divide(lit, total, out=np.zeros_like(lit), where=total > 1e-9)
    return np.clip(fraction, 0, 1).reshape(view.height, view.width).astype(np.float32)
