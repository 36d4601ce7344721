"""Indirect light alone, of a gather bake and of Mitsuba's path tracer, with the same number of bounces."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import Reflectance, material_reflectance, scatters_diffusely
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.look import validate
from relume.look.document import MAX_BOUNCES
from relume.output.render_image import render_image
from relume.scene.model import Scene
from relume_bench.mitsuba import read_passes, render

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

PASSES = 8  # independent images by the peer, which give the noise of their mean


def reflected(transfer: FixedViewTransfer, terms: Mapping[str, Sequence[Mapping[str, Any]]]) -> F64:
    """Indirect light of an image. (height, width, 3)

    Args:
        transfer: the bake. terms: terms of materials that differ from the scene's default look.
    """
    document = copy.deepcopy(transfer.default_look)
    for name, material_terms in terms.items():
        document["materials"][name]["terms"] = [dict(term) for term in material_terms]
    pictures = []
    for light_paths in ("all", "direct"):
        document["transport"]["show"] = light_paths
        look = validate(document, transfer.default_look)
        pictures.append(render_image(transfer, "front", look).astype(np.float64))
    return np.asarray(pictures[0] - pictures[1])


@contextmanager
def ignore_glossy_reflection() -> Iterator[None]:
    """Restrict relume's indirect light to diffuse terms, for peers with the same restriction."""

    def reflectance_of_diffuse_terms(terms: Sequence[Mapping[str, Any]], *of_textures: Any) -> Reflectance:
        return material_reflectance(list(filter(scatters_diffusely, terms)), *of_textures)

    with patch("relume.live.fixed_camera.illumination.material_reflectance", reflectance_of_diffuse_terms):
        yield


def mitsuba_job(camera_bsdfs: Sequence[Any], bounce_bsdfs: Sequence[Any]) -> dict[str, Any]:
    """Job for `relume_bench.mitsuba.render`, without counts; arguments as for `reflected_by_mitsuba`."""
    return {"seen": camera_bsdfs, "bsdfs": bounce_bsdfs, "bounces": MAX_BOUNCES}


def reflected_by_mitsuba(
    scene: Scene,
    size: tuple[int, int],
    camera_bsdfs: Sequence[Any],
    bounce_bsdfs: Sequence[Any],
    spp: int,
    folder: Path,
) -> F32:
    """Independent passes of Mitsuba's image of the same light. (`PASSES`, height, width, 3)

    Args:
        scene: its first view is rendered.
        size: width and height, pixels.
        camera_bsdfs, bounce_bsdfs: BSDFs of the meshes at the first hit, and further along paths.
        spp: samples per pixel in each pass, a power of two.
        folder: for exchanged files.
    """
    render(scene, size, {"spp": [spp], "passes": PASSES, **mitsuba_job(camera_bsdfs, bounce_bsdfs)}, folder)
    return read_passes(folder)
