"""Compile every kernel once, so that no user waits for compilation: `python -m relume.precompile`.

Most of the time is Numba's own work in Python. `inline="always"` makes Numba type the helper again at every call: the
kernel of free-camera pixels took 27 s that way. `forceinline=True` leaves inlining to LLVM, which takes a tenth of that
for equally fast code; use `inline` only for helpers that take objects with arrays, whose references would be counted.

Bakes a thumbnail of the built-in scene, edits each term by each of its curves and by each parameter that changes
several curves, moves local lights and cameras, applies a BTF, renders the reference, and evaluates measured materials.
`relume.core.numba_cache` chooses the cache for the compiled kernels; every later process loads them from there.
"""

from __future__ import annotations

import gc
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np

from relume.assets.btf.btf_store import STORE, store_btf
from relume.assets.btf.direction_rings import make_direction_grid
from relume.assets.btf.local_pca_btf import LocalPcaBtf, SharedTexels
from relume.assets.measured.interpolate import NUM_KNOTS, QuotientKind, measured_over_model
from relume.brdf.parameter_sweep import curves_of_parameter
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.core.cache import Cache
from relume.image_io.ocio import lut
from relume.image_io.ocio.sampling import apply_display_lut, apply_lut
from relume.image_io.tone_mapping import tone_map
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.normal_mapping import light_gradient
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.reference import ReferencePoints, environment_texels, reference_radiance
from relume.reference.btf_surfaces import sample_btf_surface
from relume.scene.examples.still_life import demo_scene
from relume.scene.model import Scene
from relume.scene.scene_folder import load_scene, save_scene
from relume.scene_io.obj_ply.weld import compile_kernels
from relume.store.bake_protocol import BakeMethod, Recipe
from relume.store.run_bake import bake_in_process

SIZE, NUM_LIGHTS, NUM_PROBES, NUM_PATCHES, NUM_RAYS = (16, 12), 256, 300, 300, 64  # enough lights to be grouped
LARGER_SIZE = 64, 48  # of a free camera: with edges and edges of shadows
CACHE_BYTES = 1 << 28
VIEW = "front"  # of the built-in scene
ANALYTIC = tuple(model for model, term in TERMS.items() if not term.needs_data)
# the first has no angle, the second has an angle with a parameter: rays distinguish no more cases
RAY_MODELS = (
    "lambert",
    "ggx",
)
_POLISHED_ROUGHNESS = (0.1, 0.09)


def precompile() -> None:
    """Bake with every method, edit each analytic term by each curve and parameter, add and move local lights.

    Raises:
        ChildProcessError: the process that compiles half of the kernels failed; its error is printed.
    """
    context = get_context("spawn")
    has_shared = context.Event()
    pictures = context.Process(target=_compile_pictures, args=(has_shared,))
    pictures.start()
    try:
        _compile_rays(has_shared)
    finally:
        pictures.join()
    if pictures.exitcode:
        raise ChildProcessError(f"compiling the kernels of fixed cameras ended with status {pictures.exitcode}")


@contextmanager
def _rare_collections() -> Iterator[None]:
    """Collect garbage rarely: with Python's thresholds it takes a tenth of the time of compiling."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    try:
        yield
    finally:
        gc.unfreeze()  # else libraries report what is left at the end of the process as leaks


def _compile_pictures(has_shared: Event) -> None:
    """Compile the kernels of the method `direct`, half of all there are.

    Args:
        has_shared: set when the kernels exist that other methods use as well.
    """
    with _rare_collections(), _temporary_scene() as (scene, folder):
        try:
            transfer = _bake_and_open(METHODS["direct"], scene, folder)
            _polish(transfer, _picture(transfer))
            _drag_roughness(transfer, _picture(transfer))
            _move_lights(transfer, _picture(transfer), ("point", "spot", "directional", "rectangle"))
        finally:
            has_shared.set()
        _apply_btf(transfer, _picture(transfer), folder)
        _edit(transfer, _picture(transfer), ANALYTIC)
        _compare(scene)
    _evaluate_measured()
    compile_kernels()


def _compile_rays(has_shared: Event) -> None:
    """Compile the kernels of free cameras and gather rays, less those that `direct` uses: see `_compile_pictures`."""
    with _rare_collections(), _temporary_scene() as (scene, folder):
        transfer = _bake_and_open(METHODS["probes"], scene, folder)
        _move_cameras(transfer, FreeCameraPicture(transfer, VIEW, is_watched=True))
        has_shared.wait()
        _polish(transfer, FreeCameraPicture(transfer, VIEW))
        _apply_btf(transfer, FreeCameraPicture(transfer, VIEW), folder)
        transfer = _bake_and_open(METHODS["gather"], scene, folder)
        _polish(transfer, _picture(transfer))
        _move_lights(transfer, _picture(transfer), ("point",))
        _apply_btf(transfer, _picture(transfer), folder)
        _edit(transfer, _picture(transfer), RAY_MODELS)


@contextmanager
def _temporary_scene() -> Iterator[tuple[Scene, Path]]:
    """The built-in scene, loaded as in the worker, and a folder for its bakes."""
    with tempfile.TemporaryDirectory(prefix="relume-warm-") as name:
        save_scene(demo_scene(), Path(name) / "scene")
        yield load_scene(Path(name) / "scene"), Path(name)


def _bake_and_open(method: BakeMethod, scene: Scene, folder: Path) -> Any:
    """Bake the first view of a scene, and open it."""
    recipe = Recipe(
        method.name, (VIEW,), SIZE, NUM_LIGHTS,
        num_probes=NUM_PROBES, num_patches=NUM_PATCHES, gather_rays=None if method.name == "direct" else NUM_RAYS,
    )  # fmt: skip
    return open_bake(bake_in_process(method, scene, recipe, folder / f"{method.name}.zarr"), Cache(CACHE_BYTES))


def _picture(transfer: FixedViewTransfer) -> Picture:
    """Return a new picture with an empty cache."""
    return Picture(transfer, VIEW, Cache(CACHE_BYTES))


def _edit(transfer: FixedViewTransfer, picture: Picture, models: Iterable[str]) -> None:
    """Edit each curve of a term, and each parameter that changes several curves."""
    material = transfer.material_names[0]
    for term in map(TERMS.__getitem__, models):
        partial = {"materials": {material: {"terms": [{"model": term.model}]}}}
        _set_look(transfer, picture, partial)
        _render(picture)
        for curve in term.curves:
            picture.prepare(f"/materials/{material}/terms/0/curves/{curve.name}")
            _render(picture)
        for parameter in (
            candidate for candidate in term.parameters if len(curves_of_parameter(term, candidate.name)) > 1
        ):
            picture.prepare(f"/materials/{material}/terms/0/params/{parameter.name}")
            _render(picture)
    tone_map(picture.image(), 0.0, "agx")
    table = np.zeros((lut.SIZE, lut.SIZE, lut.SIZE, 3), np.uint16)
    for apply in (apply_lut, apply_display_lut):
        apply(table, np.zeros((1, 3), np.float32))


def _polish(transfer: FixedViewTransfer | BakedFreeCamera, picture: Picture | FreeCameraPicture) -> None:
    """Trace along the lobes of polished metals that see each other."""
    for roughness in _POLISHED_ROUGHNESS:
        _set_look(transfer, picture, {"materials": dict.fromkeys(transfer.material_names, _metal(roughness))})
        picture.advance(None)
        if isinstance(picture, Picture):
            _render(picture)


def _drag_roughness(transfer: FixedViewTransfer, picture: Picture) -> None:
    """Drag the width of the lobes of one polished metal among dark surfaces."""
    polished, *others = transfer.material_names
    dark: dict[str, Any] = {name: {"terms": []} for name in others}
    _set_look(transfer, picture, {"materials": {polished: _metal(_POLISHED_ROUGHNESS[0]), **dark}})
    picture.prepare(f"/materials/{polished}/terms/0/params/roughness")
    _render(picture)


def _metal(roughness: float) -> dict[str, Any]:
    """A polished metal, as a material of a look."""
    return {"terms": [{"model": "ggx", "params": {"roughness": roughness, "f0": 0.9}, "texture": None}]}


def _set_look(
    transfer: FixedViewTransfer | BakedFreeCamera, picture: Picture | FreeCameraPicture, partial: dict[str, Any]
) -> None:
    """Set the default look with some changes."""
    picture.set_look(validate(complete(partial, transfer.default_look), transfer.default_look))


def _move_lights(transfer: FixedViewTransfer, picture: Picture, kinds: Iterable[str]) -> None:
    """Add a light of each kind in sequence and move each twice while it is prepared; one material is enough."""
    dark: dict[str, Any] = {name: {"terms": []} for name in transfer.material_names[1:]}
    for kind in kinds:
        picture.prepare("/lights/Lamp")
        for height in (1.0, 1.1, 1.2):
            geometry = {} if kind == "directional" else {"position": [0.0, height, 0.5]}
            partial = {"materials": dark, "lights": {"Lamp": {"kind": kind, "intensity": height, **geometry}}}
            _set_look(transfer, picture, partial)
            _render(picture)


def _move_cameras(transfer: BakedFreeCamera, picture: FreeCameraPicture) -> None:
    """Render free-camera images that are not all edges: kernels are the same for all terms and lights.

    The light gradient for normal maps is computed explicitly, because the scene has no normal maps.
    """
    partial = {"lights": {"Lamp": {"kind": "point", "position": [0.0, 1.0, 0.5]}}}
    _set_look(transfer, picture, partial)
    picture.advance(None)
    picture.advance(None)
    picture.set_camera(picture.sized_camera[0], LARGER_SIZE)
    picture.advance(None)
    zero_coefficients, all_probes = (
        np.zeros(transfer.vectors_shape, np.float32),
        np.ones(transfer.vectors_shape[0], np.uint8),
    )
    light_gradient(transfer.stored_scene, zero_coefficients, all_probes)
    for form in ("rgb9e5", "f32"):
        picture.encode(picture.all_tiles(), form)


def _apply_btf(transfer: Any, picture: Picture | FreeCameraPicture, folder: Path) -> None:
    """Apply a BTF of 2 × 2 texels to all surfaces."""
    source, grid = folder / "btf.txt", make_direction_grid([(0.0, 1), (45.0, 4)])
    source.write_text("grey")
    gray = LocalPcaBtf(
        grid, np.array([[0, 2, 2], [4, 1, 1]], np.int32), np.zeros((5, 5), np.uint8), np.zeros((5, 5, 1), np.int8),
        np.full((5, 1, 5, 3), 0.1, np.float16), np.zeros((5, 1), np.float32), np.zeros((5, 1, 1, 5, 3), np.int8),
        np.ones((5, 1, 1), np.float32), np.full((5, 5, 3), 0.1, np.float32),
        np.array([[0, 0.01], [0, 0]], np.float32), (0.0, 0.0),
        SharedTexels(np.zeros(4, np.uint8), np.zeros((4, 1), np.int8)),
    )  # fmt: skip
    with STORE.with_search_folder(folder / "btfs"):
        terms = store_btf(folder / "btfs", source, "Grey", None, lambda: gray).terms()
        _sample_btf(complete_term(("warm",), terms[0], None))
        partial = {"materials": {name: {"terms": terms} for name in transfer.material_names}}
        _set_look(transfer, picture, partial)
        if isinstance(picture, Picture):
            _render(picture)
        else:
            picture.advance(None)


def _sample_btf(term: dict[str, Any]) -> None:
    """Sample BTF texels as the reference does."""
    texels, up = TERMS[term["model"]].normalized(term).texels, np.array([[0.0, 0.0, 1.0]])
    assert texels is not None
    sample_btf_surface(texels, np.ones((1, 5), np.float32), up, np.random.default_rng(0)).evaluate(
        np.zeros(1, np.int64), up
    )


def _compare(scene: Scene) -> None:
    """Render the reference radiance of a point, with all environment texels and with a few samples."""
    up, tangent = np.array([[0, 1, 0]], np.float32), np.array([[1, 0, 0]], np.float32)
    points = ReferencePoints(
        position=9 * up, normal=up, tangent=tangent, wo=up, textures={"diffuse": up}, roughness=up[:, 1]
    )
    terms = [[complete_term(("warm",), {"model": "lambert"}, None)]]
    for spp in (0, 16):
        reference_radiance(build_scene_buffers(scene), environment_texels(scene.environment), points, terms, spp)


def _evaluate_measured() -> None:
    """Divide a measured material by its curves, in both precisions that quotients use."""
    table, curves = np.ones((90, 90, 180, 3), np.float32), np.ones((4, 3, NUM_KNOTS))
    for kind in (np.float32, np.float64):
        measured_over_model(QuotientKind.DIFFUSE, table, curves, *np.array([[0], [0], [1], [0], [0], [1]], kind))


def _render(picture: Picture) -> None:
    """Precompute pending operators, take a short and a full step, encode."""
    while picture.next_job():
        picture.run_next_job(lambda _: None, lambda: False)
    picture.advance(1)
    picture.advance(None)
    for form in ("rgb9e5", "f32"):
        picture.encode(picture.all_tiles(), form)


if __name__ == "__main__":
    precompile()
