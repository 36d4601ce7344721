"""Reflected light alone, of a gather bake and of Mitsuba's path tracer, with the same bounces."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from bench.mitsuba import passes_of, render
from relume.brdf.albedo import is_diffuse, reflectances_of
from relume.brdf.channels import NormalMap
from relume.look import validate
from relume.look.document import MAX_BOUNCES
from relume.picture.transfer import Transfer
from relume.render.image import render_image
from relume.scene.model import Scene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

PASSES = 8  # independent pictures of the peer, from which the noise of their mean is known


def reflected(transfer: Transfer, terms: Mapping[str, Sequence[Mapping[str, Any]]]) -> F64:
    """Light of a picture that surfaces have reflected onto what is seen. (height, width, 3)

    Args:
        terms: of materials that have others than in the scene's own look.
    """
    document = copy.deepcopy(transfer.default_look)
    for name, of_material in terms.items():
        document["materials"][name]["terms"] = [dict(term) for term in of_material]
    pictures = []
    for shown in ("all", "direct"):
        document["transport"]["show"] = shown
        look = validate(document, transfer.default_look)
        pictures.append(render_image(transfer, "front", look).astype(np.float64))
    return np.asarray(pictures[0] - pictures[1])


@contextmanager
def highlights_send_nothing() -> Iterator[None]:
    """Restrict our light between surfaces to what diffuse terms send, for peers that are restricted alike."""

    def of_diffuse(terms: Sequence[Mapping[str, Any]], normals: NormalMap | None) -> bytes:
        return reflectances_of(list(filter(is_diffuse, terms)), normals)

    with patch("relume.picture.light.reflectances_of", of_diffuse):
        yield


def mitsuba_job(seen: Sequence[Any], beyond: Sequence[Any]) -> dict[str, Any]:
    """What `bench.mitsuba.render` is to be told besides counts; arguments as of `reflected_by_mitsuba`."""
    return {"seen": seen, "bsdfs": beyond, "bounces": MAX_BOUNCES}


def reflected_by_mitsuba(
    scene: Scene, size: tuple[int, int], seen: Sequence[Any], beyond: Sequence[Any], spp: int, folder: Path
) -> F32:
    """Independent passes of Mitsuba's picture of the same light. (`PASSES`, height, width, 3)

    Args:
        scene: its first view is rendered.
        size: width and height, pixels.
        seen, beyond: BSDFs of the meshes where the camera sees them, and further along paths.
        spp: samples of a pixel in each pass, a power of two.
        folder: where files of the exchange are written.
    """
    render(scene, size, {"spp": [spp], "passes": PASSES, **mitsuba_job(seen, beyond)}, folder)
    return passes_of(folder)
