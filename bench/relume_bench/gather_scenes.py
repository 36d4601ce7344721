"""gather.rmse_SCENE: indirect light of the built-in scenes, each a whole image.

As gather.rmse_diffuse, but with the highlights that the camera sees; surfaces on the path reflect by their diffuse
terms on both sides, which leaves errors of patches, rays and noise (`relume_bench.gather_full` has full materials).
Relume renders twice the width and height, averaged over 2 × 2 pixels like Mitsuba's box filter. Mitsuba has no
textures, and only the highlights of peer_mitsuba_plugins.py: in the still life both renderers have the mean color of
the tray's wood, and Cook–Torrance highlights on teapot, handles and bowl. The other scenes are unchanged.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import scatters_diffusely
from relume.core.cache import Cache
from relume.live.opened.openers import open_transfer
from relume.scene.examples.catalog import built_in
from relume.scene.examples.cornell import cornell_box
from relume.scene.model import Scene
from relume.store.bake_protocol import Recipe
from relume_bench.figure import Figure, skipped
from relume_bench.gather import bake
from relume_bench.indirect import PASSES, ignore_glossy_reflection, reflected, reflected_by_mitsuba
from relume_bench.mitsuba import bsdf, missing
from relume_bench.standard_error import compare_with_passes

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Terms = tuple[Mapping[str, Any], ...]

SIZES = {"cornell_box": (400, 400), "tableau": (400, 300), "still_life": (400, 300), "interior": (400, 400)}
_FINER = 2
_SPP = 128  # of each pass
_UNIT = "relative RMSE"


class Pair(NamedTuple):
    """Indirect light of one scene.

    Attributes:
        rendered: (height, width, 3). passes: independent ones by Mitsuba. (passes, height, width, 3)
    """

    rendered: F64
    passes: F32


def measure(tiny: bool) -> list[Figure]:
    """A bake and a render of each."""
    names = tuple(f"gather.rmse_{name}" for name in SIZES)
    if (why := missing()) is not None:
        return skipped(names, _UNIT, why)
    figures, spp = [], 2 if tiny else _SPP
    for figure, name in zip(names, SIZES, strict=True):
        pair = render_pair(name, spp, tiny)
        comparison = compare_with_passes(*pair)
        details = {**comparison.context, "size": list(pair.rendered.shape[1::-1]), "spp": PASSES * spp}
        figures.append(Figure(figure, comparison.error.value, _UNIT, details, comparison.error.standard_error))
    return figures


def render_pair(name: str, spp: int = _SPP, tiny: bool = False, *, is_full: bool = False) -> Pair:
    """Bake and render one of `SIZES` with both renderers.

    Args:
        name: name of the scene. spp: per Mitsuba pass. tiny: a trial run.
        is_full: surfaces on the path reflect by all their terms; otherwise by diffuse ones.
    """
    scene = cornell_box(is_floor_glossy=True) if name == "cornell_box" else built_in(name)
    size = (40, 30) if tiny else SIZES[name]
    terms: dict[str, Terms] = {material.name: material.terms for material in scene.materials}
    if name == "still_life":
        terms |= _choose_replacement_terms(scene)
    mesh_materials = [terms[scene.materials[mesh.material].name] for mesh in scene.meshes]
    camera_bsdfs = [bsdf(mesh_terms) for mesh_terms in mesh_materials]
    beyond = (
        camera_bsdfs
        if is_full
        else [bsdf([term for term in mesh_terms if scatters_diffusely(term)]) for mesh_terms in mesh_materials]
    )
    finer = (_FINER * size[0], _FINER * size[1])
    recipe = Recipe("gather", (scene.cameras[0].name,), finer, 60 if tiny else 2000)
    with tempfile.TemporaryDirectory() as folder, nullcontext() if is_full else ignore_glossy_reflection():
        transfer = open_transfer(bake(scene, recipe, Path(folder) / "gather.zarr").path, Cache(4 << 30))
        fine = reflected(transfer, terms).reshape(size[1], _FINER, size[0], _FINER, 3)
        reference_passes = reflected_by_mitsuba(scene, size, camera_bsdfs, beyond, spp, Path(folder))
        return Pair(fine.mean(axis=(1, 3)), reference_passes)


def _choose_replacement_terms(scene: Scene) -> dict[str, Terms]:
    """Terms of the still life that both renderers support."""
    materials_by_name = {material.name: material for material in scene.materials}
    wood = materials_by_name["Tray"].textures["diffuse"].pixels.mean(axis=(0, 1), dtype=np.float64).tolist()
    teapot, bowl = materials_by_name["Teapot"].terms[0], materials_by_name["Bowl"].terms[0]
    return {
        "Teapot": (teapot, _facets([1.0, 1.0, 1.0], 0.1, 1.7)),
        "Tray": ({"model": "lambert", "color": wood, "texture": None}, materials_by_name["Tray"].terms[1]),
        "Handles": (_facets([0.91, 0.70, 0.34], 0.2, 5.0),),
        "Bowl": (bowl, _facets([1.0, 1.0, 1.0], 0.12, 1.5)),
    }


def _facets(color: list[float], sigma: float, ior: float) -> dict[str, Any]:
    return {"model": "cook_torrance", "color": color, "params": {"sigma": sigma, "ior": ior}}
