"""Images of narrow terms by few lobe rays a sample, which take a frame's time in any light."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.protocols import LobeShader
from relume.live.fixed_camera.view_images import TermTarget
from relume.operators.shade import ShadedTerm

F32 = NDArray[np.float32]


def has_round_narrow_lobe(live: LiveTerm) -> bool:
    """Return whether few rays along its lobe show a term."""
    return not live.levels.pairs and live.lobe is not None and live.lobe.is_round


def lobe_image(
    target: TermTarget,
    light: Illumination,
    shader: LobeShader,
    document: Mapping[str, Any],
    view_factor: Shaped[F32, "channels n"] | None,
) -> Shaped[F32, "tiles 3 samples"]:
    """Return the image of a term with a round narrow lobe.

    Args:
        target: the term. light: the illumination. shader: prepared for it. document: of the term.
        view_factor: of the term, by which images are divided; None for none.
    """
    images, material, _ = target
    samples = images.transfer.samples(images.view, material.index, images.cache)
    sample_args = samples, images.unlit_samples(material), images.view, material.index
    rows = shader.shade(*sample_args, light, document)
    assert rows is not None  # its lobe is narrow
    if view_factor is not None:
        rows /= np.maximum(view_factor.T, np.float32(1e-6))
    return ShadedTerm.from_rows(rows).image
